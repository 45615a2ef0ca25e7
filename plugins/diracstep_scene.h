/* Mechanical scenes through plain C callbacks: what a plugin and the C interface share.
 *
 *   q̇ = v,  A(t,q) v + b(t,q) = 0,  p = ∂L/∂v,  ṗ − ∂L/∂q − f = A(t,q)ᵀλ
 *
 * Every callback gets the `data` pointer of its struct first and returns 0, or any other number for an error:
 * the step then stops with a message that names the callback and the number.  What is marked "or NULL" may be
 * left out; derivatives are then taken by central differences of sixth order, on the pattern that is given.
 * Callbacks must not change shared data: several threads may call them at once.
 */
#ifndef DIRACSTEP_SCENE_H
#define DIRACSTEP_SCENE_H

#ifdef __cplusplus
extern "C" {
#endif

/* Where a matrix may be non-zero, in compressed columns with ascending rows; values come in the same order.
 * column_starts NULL means every entry: values are then the full matrix, column by column. */
typedef struct diracstep_pattern {
  const int *column_starts; /* columns + 1 numbers, the first 0, the last the number of entries */
  const int *row_indices;
} diracstep_pattern;

/* What is known beforehand of a function f(t,x,y); bits of diracstep_function.structure. */
enum {
  DIRACSTEP_SEPARABLE = 1,     /* no second derivative mixes x and y */
  DIRACSTEP_CONSTANT_MASS = 2, /* second derivatives in y depend on nothing */
  DIRACSTEP_DIAGONAL_MASS = 4, /* … and those off the diagonal are zero */
  DIRACSTEP_QUADRATIC = 8,     /* every second derivative is constant */
  DIRACSTEP_LINEAR_IN_Y = 16,  /* a phase-space Lagrangian θ(q)·v − H(q) */
  DIRACSTEP_AUTONOMOUS = 32    /* t does not enter; without it no run says that the energy is kept */
};

/* f(t,x,y) of two columns of n numbers: a Lagrangian L(t,q,v) or a Hamiltonian H(t,q,p), energy. */
typedef struct diracstep_function {
  const void *data;
  diracstep_pattern pattern; /* n×n, symmetric: of all three blocks of second derivatives */
  int structure;             /* bits from above, 0 where nothing is known */
  int (*value)(const void *data, double t, const double *x, const double *y, double *f);
  /* ∂f/∂x and ∂f/∂y, n numbers each; or NULL */
  int (*gradient)(const void *data, double t, const double *x, const double *y, double *fx, double *fy);
  /* fxx(i,j) = ∂²f/∂x_i∂x_j, fxy(i,j) = ∂²f/∂x_i∂y_j, fyy(i,j) = ∂²f/∂y_i∂y_j on the pattern; or NULL */
  int (*hessian)(const void *data, double t, const double *x, const double *y, double *fxx, double *fxy,
                 double *fyy);
} diracstep_function;

/* m rows A(t,q) v + b(t,q) = 0; holonomic rows are the time derivative of φ(t,q) = 0. */
typedef struct diracstep_rows {
  const void *data;
  int rows;
  int holonomic;             /* 1: position is needed; 0: coefficients is needed */
  const char *const *names;  /* m names; or NULL: they are numbered */
  diracstep_pattern pattern; /* m×n: of A and of its derivatives row by row */
  int (*position)(const void *data, double t, const double *q, double *phi);
  /* A on the pattern and b = ∂φ/∂t or the affine part, m numbers; or NULL for holonomic rows */
  int (*coefficients)(const void *data, double t, const double *q, double *a, double *b);
} diracstep_rows;

/* A generalised force f(t,q,v), n numbers. */
typedef struct diracstep_force {
  const void *data;
  diracstep_pattern pattern; /* n×n, symmetric: of ∂f/∂q and ∂f/∂v */
  int (*value)(const void *data, double t, const double *q, const double *v, double *f);
} diracstep_force;

/* A scene: L, rows, force and start.  Everything it points to must stay where it is while it is in use. */
typedef struct diracstep_scene {
  const char *name;
  const char *description;        /* or NULL */
  int dimension;                  /* n */
  const char *const *coordinates; /* n names; or NULL: q1, q2, … */
  const diracstep_function *lagrangian;
  int row_blocks;
  const diracstep_rows *const *rows; /* row_blocks of them; or NULL */
  const diracstep_force *force;      /* or NULL */
  double start_time;
  const double *start_q; /* n numbers */
  const double *start_v; /* n numbers, with A v + b = 0 */
  double end_time;       /* where a run ends that is given no other end */
  double step;           /* a coarse but sensible step */
} diracstep_scene;

#ifdef __cplusplus
}
#endif

#endif
