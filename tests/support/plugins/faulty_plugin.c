/* Plugins that are wrong in one way each, chosen by FAULT at compile time. */
#include <diracstep/plugins/diracstep_plugin.h>
#include <math.h>

static int value(void *self, const diracstep_system *system, diracstep_interval step, const double *y,
                 double *s) {
  (void)self, (void)system, (void)step, (void)y;
#if FAULT == 3 /* an error number */
  if (step.start > 0.1) return 42;
#endif
  const int n = system->dimension;
  double v[64];
  for (int i = 0; i < n; ++i) v[i] = (y[n + i] - y[i]) / step.size;
  const int status = system->lagrangian.value(system->lagrangian.data, step.start, y, v, s);
  *s *= step.size;
#if FAULT == 4 /* NaN */
  if (step.start > 0.1) *s = NAN;
#endif
  return status;
}
static const char *text(void *self, int status) {
  (void)self;
  return status == 42 ? "the answer is refused" : 0;
}
static const diracstep_method method = {
#if FAULT == 2 /* a name that is taken */
    .name = "type1/midpoint",
#else
    .name = "type1/faulty",
#endif
    .type = 1,
    .order = 1,
    .constraint_rule = "left",
    .value = value,
    .error_text = text};
static const diracstep_method *const methods[] = {&method};
static const diracstep_plugin plugin = {
#if FAULT == 1 /* another version */
    .version = DIRACSTEP_PLUGIN_VERSION + 6,
#else
    .version = DIRACSTEP_PLUGIN_VERSION,
#endif
    .size = sizeof(diracstep_plugin),
    .name = "faulty",
    .methods = 1,
    .method = methods};

#if FAULT == 0 /* no entry */
const diracstep_plugin *another_entry(void) { return &plugin; }
#else
const diracstep_plugin *diracstep_plugin_entry(void) { return &plugin; }
#endif
