/* A program in C that uses DiracStep as its solver: a skate on a slope, given by two callbacks.
 * L = ½ (vx² + vy² + w²) + 0.7 x, and the blade does not slide: sin(a) vx − cos(a) vy = 0. */
#include <diracstep/c_interface/diracstep.h>
#include <math.h>
#include <stdio.h>

static int lagrangian(const void *data, double t, const double *q, const double *v, double *l) {
  (void)t;
  *l = 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + *(const double *)data * q[0];
  return 0;
}

static int blade(const void *data, double t, const double *q, double *a, double *b) {
  (void)data, (void)t;
  a[0] = sin(q[2]);
  a[1] = -cos(q[2]);
  a[2] = 0.0;
  b[0] = 0.0;
  return 0;
}

int main(void) {
  const double slope = 0.7;
  const double start_q[] = {0.0, 0.0, 0.0}, start_v[] = {0.0, 0.0, 1.0};
  const diracstep_function l = {.data = &slope, .value = lagrangian};
  const diracstep_rows row = {.rows = 1, .coefficients = blade};
  const diracstep_rows *const rows[] = {&row};
  const diracstep_scene skate = {.name = "skate",
                                 .dimension = 3,
                                 .lagrangian = &l,
                                 .row_blocks = 1,
                                 .rows = rows,
                                 .start_q = start_q,
                                 .start_v = start_v};
  const diracstep_options options = {.method = "type1/gl:3", .step = 0.1};

  const diracstep_source source = {.callbacks = &skate};
  diracstep_model *model;
  diracstep_integrator *integrator = NULL;
  double q[3], v[3], force;
  diracstep_state state = {.q = q, .v = v, .lambda = &force};
  int status = diracstep_open(DIRACSTEP_VERSION_OF_C_INTERFACE, &source, &model);
  if (status == DIRACSTEP_OK) status = diracstep_create(model, &options, &integrator);
  for (int k = 0; k <= 5 && status == DIRACSTEP_OK; ++k) {
    if (k > 0) status = diracstep_step(integrator, 20);
    if (status == DIRACSTEP_OK) status = diracstep_read(integrator, DIRACSTEP_PROJECTED, &state);
    if (status == DIRACSTEP_OK)
      printf("t = %4.1f  x = %.9f  y = %.9f  force across the blade = %+.6f\n", state.time, q[0], q[1],
             force);
  }
  if (status != DIRACSTEP_OK) fprintf(stderr, "%s\n", diracstep_message());
  diracstep_destroy(integrator);
  diracstep_close(model);
  if (status != DIRACSTEP_OK) return 1;
  /* It swings: x = (g/2) sin²t with g = 0.7 and a(t) = t; the blade is pushed by -2 g sin t. */
  const double position = 0.35 * sin(state.time) * sin(state.time), push = -1.4 * sin(state.time);
  return fabs(q[0] - position) < 1e-9 && fabs(force - push) < 1e-8 ? 0 : 1;
}
