/* The interface of a DiracStep plugin: a shared object that brings generating functions, discrete constraint
 * rules and scenes.  Plain C, so any language that can export a C function can write one; docs/plugins.md
 * leads through it.  A plugin needs no library of DiracStep, only this header and diracstep_scene.h.
 *
 * The object exports one function, diracstep_plugin_entry, which returns a description that stays valid as
 * long as the object is loaded.  The host reads nothing beyond `version` and `size` until both agree with its
 * own.
 */
#ifndef DIRACSTEP_PLUGIN_H
#define DIRACSTEP_PLUGIN_H

#include <diracstep/plugins/diracstep_scene.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Raised with every change of a struct or a rule of this header and of diracstep_scene.h. */
#define DIRACSTEP_PLUGIN_VERSION 1u

/* One step: from `start` to `start + size`; the size may be negative. */
typedef struct diracstep_interval {
  double start;
  double size;
} diracstep_interval;

/* What a method sees of the scene it is used on: functions of the host, to be called like those of a plugin.
 * The host gives all three callbacks of each.  A status other than 0 must be handed on to the host. */
typedef struct diracstep_system {
  const char *name;
  int dimension; /* n */
  diracstep_function lagrangian;
  diracstep_function hamiltonian; /* all zero unless the method asks with DIRACSTEP_NEEDS_HAMILTONIAN */
  double start_time;
  const double *start_q;
  const double *start_v;
} diracstep_system;

/* Bits of diracstep_method.flags. */
enum {
  DIRACSTEP_SELF_ADJOINT = 1,      /* claims Φ_{−h} = Φ_h⁻¹ */
  DIRACSTEP_ALLOCATION_FREE = 2,   /* claims that its callbacks allocate no memory, create excepted */
  DIRACSTEP_NEEDS_HAMILTONIAN = 4, /* refuses scenes whose Hamiltonian does not exist */
  DIRACSTEP_FULL_PATTERN = 8 /* second derivatives fill n×n; without it they lie on the pattern of L, or
                                of H and its diagonal where H is asked for */
};

/* A generating function S over one step, action (energy·time).  Its type fixes its arguments and its graph:
 *
 *   1  S(q0,q1)   p0 = −∂S/∂q0   p1 =  ∂S/∂q1        a discrete Lagrangian
 *   2  S(q0,p1)   p0 =  ∂S/∂q0   q1 =  ∂S/∂p1        a discrete Hamiltonian
 *   3  S(p0,q1)   q0 = −∂S/∂p0   p1 = −∂S/∂q1        a discrete Hamiltonian
 *   4  S(p0,p1)   q0 =  ∂S/∂p0   q1 = −∂S/∂p1
 *
 * S is a function of 2 + r columns of n numbers, y, column after column: its two arguments, and r inner
 * columns (stages) at which S is stationary; the step solves for them.
 *
 * The least to give is name, type, order and value, or gradient in place of value: what is NULL is taken by
 * differences.  Differences of value cost accuracy (about 1e-12 of S over a step in the momentum) and time;
 * differences of gradient cost a few evaluations for each Jacobian, and nothing in accuracy.
 *
 * Each callback gets `self`, what create made (NULL without create), and the system.  They return 0, or
 * another number for an error. */
typedef struct diracstep_method {
  const char *name;            /* "type1/simpson": typeN/, then letters, digits and _ : . - */
  const char *summary;         /* a line, or NULL */
  int type;                    /* 1 to 4 */
  int order;                   /* claimed, in q and in projected p */
  int constrained_order;       /* claimed on scenes with rows or a force; 0: the same */
  int flags;                   /* bits from above */
  const char *constraint_rule; /* a rule by name; NULL: "midpoint" */
  const char *adjoint;         /* the method that is the adjoint, by name; or NULL: one is made */
  int inner_columns;           /* r */
  const void *data;            /* for create: one create may serve several methods */

  /* Once for each integrator, which belongs to one thread at a time; destroy ends it.  Both or none. */
  int (*create)(const void *data, const diracstep_system *system, void **self);
  void (*destroy)(void *self);

  int (*value)(void *self, const diracstep_system *system, diracstep_interval step, const double *y,
               double *s);
  /* ∂S/∂y: 2 + r columns of n numbers; or NULL */
  int (*gradient)(void *self, const diracstep_system *system, diracstep_interval step, const double *y,
                  double *g);
  /* ∂²S/∂y_i∂y_j for the columns i ≤ j in the order (0,0) (0,1) … (0,r+1) (1,1) …: each block on the pattern,
     rows for y_i; or NULL */
  int (*hessian)(void *self, const diracstep_system *system, diracstep_interval step, const double *y,
                 double *blocks);
  /* Starting values of the inner columns; or NULL: points on the line from q0 along v0 */
  int (*guess_inner)(void *self, const diracstep_system *system, diracstep_interval step, const double *q0,
                     const double *p0, const double *v0, double *inner);
  /* What an error number means; or NULL.  `self` is NULL where create failed. */
  const char *(*error_text)(void *self, int status);
} diracstep_method;

/* A rule for Δ^d: Σ w_i [A(t_i,q_i)(q1 − q0) + h b(t_i,q_i)] = 0 with q_i = (1 − c_i) q0 + c_i q1. */
typedef struct diracstep_rule {
  const char *name;
  int nodes;             /* 1 to 8 */
  const double *c;       /* in [0,1] */
  const double *weights; /* they add up to 1 */
} diracstep_rule;

/* What a shared object brings. */
typedef struct diracstep_plugin {
  unsigned version; /* DIRACSTEP_PLUGIN_VERSION */
  unsigned size;    /* sizeof(diracstep_plugin) */
  const char *name;
  const char *description; /* or NULL */
  int methods;
  const diracstep_method *const *method;
  int rules;
  const diracstep_rule *const *rule;
  int scenes;
  const diracstep_scene *const *scene;
} diracstep_plugin;

#if defined(_WIN32)
#define DIRACSTEP_EXPORT __declspec(dllexport)
#else
#define DIRACSTEP_EXPORT __attribute__((visibility("default")))
#endif

/* What the plugin exports. */
DIRACSTEP_EXPORT const diracstep_plugin *diracstep_plugin_entry(void);

#ifdef __cplusplus
}
#endif

#endif
