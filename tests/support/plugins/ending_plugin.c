/* A plugin that behaves until t = 1 and then, as ENDING says in the environment, loops for ever, ends the
 * program by exit(), or returns an error. */
#include <diracstep/plugins/diracstep_plugin.h>
#include <stdlib.h>
#include <string.h>

static int ends(const char *how) {
  const char *wanted = getenv("ENDING");
  return wanted != NULL && strcmp(wanted, how) == 0;
}

static int value(void *self, const diracstep_system *system, diracstep_interval step, const double *y,
                 double *s) {
  (void)self;
  volatile int forever = 1;
  if (step.start > 1.0 && ends("loop"))
    while (forever) continue;
  if (step.start > 1.0 && ends("exit")) exit(0);
  if (step.start > 1.0 && ends("error")) return 7;
  const int n = system->dimension;
  double v[64];
  for (int i = 0; i < n; ++i) v[i] = (y[n + i] - y[i]) / step.size;
  const int status = system->lagrangian.value(system->lagrangian.data, step.start, y, v, s);
  *s *= step.size;
  return status;
}
static const diracstep_method method = {
    .name = "type1/ending", .type = 1, .order = 1, .constraint_rule = "left", .value = value};
static const diracstep_method *const methods[] = {&method};
static const diracstep_plugin plugin = {.version = DIRACSTEP_PLUGIN_VERSION,
                                        .size = sizeof(diracstep_plugin),
                                        .name = "ending",
                                        .methods = 1,
                                        .method = methods};
const diracstep_plugin *diracstep_plugin_entry(void) { return &plugin; }
