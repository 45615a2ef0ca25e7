/* A plugin in C: a discrete Lagrangian that is exact for the harmonic part of L.
 *
 * With v = (q1 − q0)/h and, coordinate by coordinate, the constants m = ∂²L/∂v² and k = −∂²L/∂q² at q = v = 0
 * (taken elsewhere, say at the start, the step back would be of another method: not self-adjoint),
 *
 *   S(q0,q1) = Σ S_i(q0_i,q1_i) + h/2 [R(q0,v) + R(q1,v)],     R = L − Σ ½ m_i v_i² − ½ k_i q_i²,
 *
 * where S_i is the action of the oscillator ½ m v² − ½ k q² along its true motion (ω² = k/m, θ = ωh):
 *
 *   S_i = mω / (2 sin θ) [(q0² + q1²) cos θ − 2 q0 q1],
 *
 * with sinh and cosh for k < 0 and m (q1 − q0)²/2h for k = 0.  A fast oscillator costs no small steps: only
 * the rest R is approximated, by the trapezoidal rule, as in the impulse method (Hairer, Lubich, Wanner,
 * Geometric Numerical Integration, XIII.1).  The step must stay away from θ = π, 2π, …
 */
#include <diracstep/plugins/diracstep_plugin.h>
#include <math.h>
#include <stdlib.h>

enum { RESONANT = 2 };

/* Constants of one coordinate, and room for derivatives of L. */
struct harmonic {
  int entries;
  double *mass, *stiffness; /* n each */
  double *v, *lq, *lv;      /* n each */
  double *lqq, *lqv, *lvv;  /* one for each entry of the pattern */
  int *transposed;          /* the mirror entry of each entry */
  double numbers[];
};

/* S_i = ½ a (q0² + q1²) − b q0 q1. */
static int oscillator(double m, double k, double h, double *a, double *b) {
  const double omega = sqrt(fabs(k / m)), angle = omega * h;
  if (fabs(angle) < 1e-4) { /* series: the closed forms lose digits here */
    *a = m / h - k * h / 3.0;
    *b = m / h + k * h / 6.0;
    return 0;
  }
  const double s = k / m > 0.0 ? sin(angle) : sinh(angle);
  if (fabs(s) < 1e-6) return RESONANT;
  *a = m * omega * (k / m > 0.0 ? cos(angle) : cosh(angle)) / s;
  *b = m * omega / s;
  return 0;
}

static int entry_count(const diracstep_system *system) {
  const diracstep_pattern p = system->lagrangian.pattern;
  return p.column_starts[system->dimension];
}

static int find(const diracstep_pattern *p, int row, int column) {
  for (int e = p->column_starts[column]; e < p->column_starts[column + 1]; ++e)
    if (p->row_indices[e] == row) return e;
  return -1;
}

static void destroy(void *self) {
  free(((struct harmonic *)self)->transposed);
  free(self);
}

static int create(const void *data, const diracstep_system *system, void **self) {
  (void)data;
  const int n = system->dimension, count = entry_count(system);
  const diracstep_pattern pattern = system->lagrangian.pattern;
  struct harmonic *made = malloc(sizeof *made + (size_t)(5 * n + 3 * count) * sizeof(double));
  int *transposed = malloc((size_t)count * sizeof *transposed);
  if (!made || !transposed) {
    free(made);
    free(transposed);
    return 1;
  }
  double **places[] = {&made->mass, &made->stiffness, &made->v, &made->lq, &made->lv};
  double *next = made->numbers;
  for (int i = 0; i < 5; ++i, next += n) *places[i] = next;
  made->lqq = next;
  made->lqv = next + count;
  made->lvv = next + 2 * count;
  made->entries = count;
  made->transposed = transposed;
  for (int j = 0; j < n; ++j)
    for (int e = pattern.column_starts[j]; e < pattern.column_starts[j + 1]; ++e)
      transposed[e] = find(&pattern, j, pattern.row_indices[e]);
  *self = made;
  for (int i = 0; i < n; ++i) made->v[i] = 0.0;
  const diracstep_function *l = &system->lagrangian;
  const int status =
      l->hessian(l->data, system->start_time, made->v, made->v, made->lqq, made->lqv, made->lvv);
  for (int i = 0; i < n; ++i) {
    const int e = find(&pattern, i, i);
    const int usable = e >= 0 && made->lvv[e] != 0.0 && isfinite(made->lqq[e] / made->lvv[e]);
    made->mass[i] = usable ? made->lvv[e] : 1.0; /* else the plain trapezoidal rule */
    made->stiffness[i] = usable ? -made->lqq[e] : 0.0;
  }
  if (status == 0) return 0;
  destroy(made);
  *self = 0;
  return 1;
}

static int value(void *self, const diracstep_system *system, diracstep_interval step, const double *y,
                 double *s) {
  struct harmonic *w = self;
  const diracstep_function *l = &system->lagrangian;
  const int n = system->dimension;
  const double h = step.size, *q0 = y, *q1 = y + n;
  double at_start, at_end;
  for (int i = 0; i < n; ++i) w->v[i] = (q1[i] - q0[i]) / h;
  if (l->value(l->data, step.start, q0, w->v, &at_start) ||
      l->value(l->data, step.start + h, q1, w->v, &at_end))
    return 1;
  *s = h / 2.0 * (at_start + at_end);
  for (int i = 0; i < n; ++i) {
    double a, b;
    if (oscillator(w->mass[i], w->stiffness[i], h, &a, &b)) return RESONANT;
    const double squares = q0[i] * q0[i] + q1[i] * q1[i], m = w->mass[i], k = w->stiffness[i];
    *s += 0.5 * a * squares - b * q0[i] * q1[i] - h * (0.5 * m * w->v[i] * w->v[i] - 0.25 * k * squares);
  }
  return 0;
}

static int gradient(void *self, const diracstep_system *system, diracstep_interval step, const double *y,
                    double *g) {
  struct harmonic *w = self;
  const diracstep_function *l = &system->lagrangian;
  const int n = system->dimension;
  const double h = step.size, *q0 = y, *q1 = y + n;
  double *g0 = g, *g1 = g + n;
  for (int i = 0; i < n; ++i) w->v[i] = (q1[i] - q0[i]) / h;
  if (l->gradient(l->data, step.start, q0, w->v, w->lq, w->lv)) return 1;
  for (int i = 0; i < n; ++i) {
    g0[i] = h / 2.0 * w->lq[i] - w->lv[i] / 2.0;
    g1[i] = w->lv[i] / 2.0;
  }
  if (l->gradient(l->data, step.start + h, q1, w->v, w->lq, w->lv)) return 1;
  for (int i = 0; i < n; ++i) {
    double a, b;
    if (oscillator(w->mass[i], w->stiffness[i], h, &a, &b)) return RESONANT;
    const double m = w->mass[i], k = w->stiffness[i];
    g0[i] += -w->lv[i] / 2.0 + a * q0[i] - b * q1[i] + m * w->v[i] + h / 2.0 * k * q0[i];
    g1[i] += h / 2.0 * w->lq[i] + w->lv[i] / 2.0 + a * q1[i] - b * q0[i] - m * w->v[i] + h / 2.0 * k * q1[i];
  }
  return 0;
}

static int hessian(void *self, const diracstep_system *system, diracstep_interval step, const double *y,
                   double *blocks) {
  struct harmonic *w = self;
  const diracstep_function *l = &system->lagrangian;
  const int n = system->dimension, count = w->entries;
  const double h = step.size, *q0 = y, *q1 = y + n;
  double *d00 = blocks, *d01 = blocks + count, *d11 = blocks + 2 * count;
  for (int i = 0; i < n; ++i) w->v[i] = (q1[i] - q0[i]) / h;
  if (l->hessian(l->data, step.start, q0, w->v, w->lqq, w->lqv, w->lvv)) return 1;
  for (int e = 0; e < count; ++e) {
    const double lvq = w->lqv[w->transposed[e]], lvv = w->lvv[e] / (2.0 * h);
    d00[e] = h / 2.0 * w->lqq[e] - (w->lqv[e] + lvq) / 2.0 + lvv;
    d01[e] = w->lqv[e] / 2.0 - lvv;
    d11[e] = lvv;
  }
  if (l->hessian(l->data, step.start + h, q1, w->v, w->lqq, w->lqv, w->lvv)) return 1;
  for (int e = 0; e < count; ++e) {
    const double lvq = w->lqv[w->transposed[e]], lvv = w->lvv[e] / (2.0 * h);
    d00[e] += lvv;
    d01[e] += -lvq / 2.0 - lvv;
    d11[e] += h / 2.0 * w->lqq[e] + (w->lqv[e] + lvq) / 2.0 + lvv;
  }
  for (int i = 0; i < n; ++i) {
    double a, b;
    const int e = find(&system->lagrangian.pattern, i, i);
    if (e < 0) continue;
    if (oscillator(w->mass[i], w->stiffness[i], h, &a, &b)) return RESONANT;
    const double m = w->mass[i], k = w->stiffness[i];
    d00[e] += a - m / h + h / 2.0 * k;
    d01[e] += -b + m / h;
    d11[e] += a - m / h + h / 2.0 * k;
  }
  return 0;
}

static const char *error_text(void *self, int status) {
  (void)self;
  return status == RESONANT ? "the step is a multiple of half a period of the harmonic part"
                            : "L failed or no memory";
}

static const diracstep_method harmonic = {
    .name = "type1/harmonic",
    .summary = "exact for the harmonic part of L, trapezoidal for the rest",
    .type = 1,
    .order = 2,
    .flags = DIRACSTEP_SELF_ADJOINT | DIRACSTEP_ALLOCATION_FREE,
    .constraint_rule = "trapezoidal",
    .create = create,
    .destroy = destroy,
    .value = value,
    .gradient = gradient,
    .hessian = hessian,
    .error_text = error_text};

/* A scene to try it on: a soft and a stiff spring, weakly coupled,
 * L = ½ (v1² + v2²) − ½ q1² − ½ 50² q2² − 0.05 q1² q2². */
static int l_value(const void *data, double t, const double *q, const double *v, double *l) {
  (void)data, (void)t;
  *l = 0.5 * (v[0] * v[0] + v[1] * v[1]) - 0.5 * q[0] * q[0] - 1250.0 * q[1] * q[1] -
       0.05 * q[0] * q[0] * q[1] * q[1];
  return 0;
}
static int l_gradient(const void *data, double t, const double *q, const double *v, double *lq, double *lv) {
  (void)data, (void)t;
  lq[0] = -q[0] - 0.1 * q[0] * q[1] * q[1];
  lq[1] = -2500.0 * q[1] - 0.1 * q[0] * q[0] * q[1];
  lv[0] = v[0];
  lv[1] = v[1];
  return 0;
}
static const char *const coordinates[] = {"soft", "stiff"};
static const double start_q[] = {1.0, 0.02}, start_v[] = {0.0, 0.5};
static const diracstep_function l = {
    .structure = DIRACSTEP_SEPARABLE | DIRACSTEP_CONSTANT_MASS | DIRACSTEP_DIAGONAL_MASS,
    .value = l_value,
    .gradient = l_gradient};
static const diracstep_scene springs = {.name = "two_springs",
                                        .description = "a soft and a stiff spring, weakly coupled",
                                        .dimension = 2,
                                        .coordinates = coordinates,
                                        .lagrangian = &l,
                                        .start_q = start_q,
                                        .start_v = start_v,
                                        .end_time = 10.0,
                                        .step = 0.05};

static const diracstep_method *const methods[] = {&harmonic};
static const diracstep_scene *const scenes[] = {&springs};
static const diracstep_plugin plugin = {.version = DIRACSTEP_PLUGIN_VERSION,
                                        .size = sizeof(diracstep_plugin),
                                        .name = "harmonic",
                                        .description = "discrete Lagrangians exact for harmonic motion",
                                        .methods = 1,
                                        .method = methods,
                                        .scenes = 1,
                                        .scene = scenes};

const diracstep_plugin *diracstep_plugin_entry(void) { return &plugin; }
