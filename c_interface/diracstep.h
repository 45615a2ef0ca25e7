/* DiracStep from C and from every language that can call C: scenes from files, from text or made of
 * callbacks, plans, runs into the caller's arrays, single steps, ensembles, motions between two ends, optimal
 * control, equilibria, parameters from data.  Link libdiracstep.
 *
 * Every function that can fail returns DIRACSTEP_OK or one of the codes below it; diracstep_message says what
 * happened.  Structs that are all zero are the defaults.  Columns of a point hold n numbers (coordinates), s
 * numbers (q; s = n in R^n, more where it is stored on groups and spheres: docs/manifolds.md), m numbers
 * (rows), i numbers (invariants) or o numbers (outputs): see diracstep_facts.  Units are those of the scene.
 *
 * Events of a scene (docs/events.md) are looked for by runs, searches, ensembles and single steps, and act.
 *
 * A model is not changed by anything: threads may share it.  An integrator belongs to one thread at a time;
 * different ones share nothing.
 */
#ifndef DIRACSTEP_H
#define DIRACSTEP_H

#include <diracstep/plugins/diracstep_scene.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Raised when a struct here or in diracstep_scene.h, or what a function does, changes; not for new functions.
 */
#define DIRACSTEP_VERSION_OF_C_INTERFACE 8u

#if defined(_WIN32)
#define DIRACSTEP_API __declspec(dllexport)
#else
#define DIRACSTEP_API __attribute__((visibility("default")))
#endif

/* What a function returns. */
enum {
  DIRACSTEP_OK = 0,
  DIRACSTEP_FAILED = 1,     /* a numerical failure, a search that was refused, an error of a callback */
  DIRACSTEP_MISUSE = 2,     /* a wrong name, size, value or start */
  DIRACSTEP_INTERRUPTED = 3 /* the stop flag was set */
};

/* Which representative of the momentum class [p] in T*Q/annihilator is read. */
enum { DIRACSTEP_PROJECTED = 0, DIRACSTEP_PLUS = 1, DIRACSTEP_MINUS = 2 };

/* What happened in the last call of this thread that did not return DIRACSTEP_OK; valid until its next call.
 */
DIRACSTEP_API const char *diracstep_message(void);

/* The version of the library, "0.1.0"; that of the headers is DIRACSTEP_VERSION of <diracstep/version.h>. */
DIRACSTEP_API const char *diracstep_version(void);

/* ---- Models: a scene, and the methods that are known with it ---- */

/* A parameter or size of a scene, changed; or the tolerance of a coordinate, absolute and in its unit. */
typedef struct diracstep_parameter {
  const char *name;
  double value;
} diracstep_parameter;

/* Where a scene is from: one of the first three.  With none of them a model has no scene, and serves
 * diracstep_list alone. */
typedef struct diracstep_source {
  const char *name; /* of a scene of the catalogue or of a plugin, or the path of a file NAME.toml */
  const char *text; /* of a scene file (docs/scene_format.md); `name`, or NULL, then names it in messages */
  const diracstep_scene *callbacks; /* what it points to must stay until the model and all that was made with
                                     * it are gone */
  int parameters;                   /* how many are changed; not with callbacks … */
  const diracstep_parameter *parameter; /* … and they */
  int drop_redundant;        /* 1: redundant constraints are left out also where they are refused */
  int plugins;               /* how many shared objects are loaded first … */
  const char *const *plugin; /* … and their paths */
  int linked;                /* plugins that are in memory, see diracstep_plugin.h … */
  const struct diracstep_plugin *const *linked_plugin; /* … which stay as the callbacks do */
  int tolerances; /* how many coordinates, far smaller than others, are solved in each step to a value of
                   * their own, not to 1e-15 of the largest … */
  const diracstep_parameter *tolerance; /* … and which */
} diracstep_source;

typedef struct diracstep_model diracstep_model;

/* Makes a model; *model is NULL where that fails.  `version` is DIRACSTEP_VERSION_OF_C_INTERFACE. */
DIRACSTEP_API int diracstep_open(unsigned version, const diracstep_source *source, diracstep_model **model);
/* Ends a model, NULL as well.  Integrators made with it stay usable. */
DIRACSTEP_API void diracstep_close(diracstep_model *model);

/* Sizes and times of a scene.  What it points to is there as long as the model. */
typedef struct diracstep_facts {
  int dimension;  /* n */
  int storage;    /* s */
  int rows;       /* m, those that are off at the start included */
  int invariants; /* i */
  int outputs;    /* o */
  double start_time;
  const double *start_q, *start_v; /* s and n numbers */
  double end_time;                 /* where a run ends that is given no other end */
  double step;                     /* a coarse but sensible step */
} diracstep_facts;

DIRACSTEP_API int diracstep_read_facts(const diracstep_model *model, diracstep_facts *facts);

/* A table of texts, row after row; valid until the next call of this thread. */
typedef struct diracstep_table {
  int rows, columns;
  const char *const *cells; /* rows * columns */
} diracstep_table;

/* What can be listed, and the columns. */
enum {
  DIRACSTEP_ABOUT = 0, /* what, text: name, kind, description, source, formulas, …; changes to what was given
                        */
  DIRACSTEP_COORDINATES, /* name, unit, meaning */
  DIRACSTEP_ROWS,        /* name */
  DIRACSTEP_INVARIANTS,  /* name, value that the scene states or "" */
  DIRACSTEP_PARAMETERS,  /* name, value, unit, meaning */
  DIRACSTEP_METHODS,     /* name, order, "self-adjoint" or "", formula */
  DIRACSTEP_RULES,       /* name: rules for nonholonomic rows */
  DIRACSTEP_SCENES,      /* name: of the catalogue and of the plugins */
  DIRACSTEP_PLUGINS,     /* name, path, description */
  DIRACSTEP_OUTPUTS,     /* name */
  DIRACSTEP_INPUTS,      /* name, times between which the table has values; none outside */
  DIRACSTEP_EVENTS,      /* name, "record", "stop" or "act" */
  DIRACSTEP_POSITIONS    /* name of each number of q: the coordinates in R^n */
};
DIRACSTEP_API int diracstep_list(const diracstep_model *model, int what, diracstep_table *table);

/* One point of the motion.  Columns that are NULL are not written. */
typedef struct diracstep_state {
  double time;
  double energy;
  double *q;      /* s numbers */
  double *v;      /* n numbers, in the distribution */
  double *p;      /* the representative asked for */
  double *lambda; /* forces of the rows, 0 of those that are off */
  double *invariants;
  double *outputs; /* of the scene's file */
} diracstep_state;

/* Solves the start as the first step takes it: places and velocities that the file leaves open, momenta
 * projected, forces of rows, and the acceleration, n numbers or NULL, NaN where L is linear in v.  `origins`,
 * or NULL: name, "given", "guess", "rate" or "left out", value in the file, for q and then for v or p; of
 * scenes that are not from files no rows. */
DIRACSTEP_API int diracstep_solve_start(const diracstep_model *model, diracstep_state *state,
                                        double *acceleration, diracstep_table *origins);

/* ---- Equilibria (docs/equilibria.md) ---- */

/* What is looked for. */
typedef struct diracstep_rest {
  int along;  /* 1: a steady motion, in which coordinates with a velocity at the start keep moving */
  int modes;  /* so many modes, by sparse matrices; 0: all by full ones, or of a large scene ten … */
  int nearby; /* 1: by sparse matrices those nearest to `near`, else the slowest */
  double near;
  const int *stop; /* NULL, or an int that ends the search soon after it is no longer 0 */
} diracstep_rest;

/* What was found.  Texts and numbers are valid until the next call of this thread; matrices stand row by row,
 * NULL where they are sparse. */
typedef struct diracstep_equilibrium {
  double time;
  int iterations;
  const double *q, *v, *lambda; /* s, n and m numbers */
  int modes;
  const double
      *eigenvalue;       /* modes × 2, real and imaginary part, of a pair that with imaginary part above 0 */
  const double *shape;   /* modes × n × 2, the largest component 1 */
  int zeros;             /* further eigenvalues, which are 0 */
  double zeros_below;    /* the fastest rate that may be behind one of them, 1/time; 0: none is */
  int free_directions;   /* in which the equilibrium goes on as a family, by full matrices */
  const double *free;    /* free_directions × n, the largest component 1 and 0 in the others */
  const char *stability; /* in words */
  double near;           /* the number that the modes are nearest to; NaN where they are all */
  double variation;      /* of the linear equations on the way to the end of the scene, of their size */
  int redundant_rows;
  int positions, velocities; /* P and U, the degrees of freedom: δq = N y, δv = S u + D y … */
  const double *of_positions, *of_velocities, *drift; /* N, n × P; S, n × U; D, n × P … */
  const double *mass, *damping, *stiffness;           /* … U × U, U × U, U × P */
  const char *doubt;                                  /* "", or why eigenvalues are not to be believed */
} diracstep_equilibrium;

/* Finds where the scene rests, its start as the guess, and its small motions there; events are not looked
 * for.  DIRACSTEP_FAILED where none is found: q, v and lambda are then where the search has ended.
 * DIRACSTEP_INTERRUPTED by `stop`. */
DIRACSTEP_API int diracstep_find_equilibrium(const diracstep_model *model, const diracstep_rest *rest,
                                             diracstep_equilibrium *found);

/* ---- Integrators ---- */

/* How a scene is stepped.  Where all is zero, method, steps and their control are those of the command
 * `diracstep run`: where no method is named and the motion is damped strongly, damped/radau:3, whose steps
 * then vary by their local error unless `fixed`, `step` or `substeps` is given. */
typedef struct diracstep_options {
  const char *method;   /* NULL and no order: what the scene's file recommends, its step too, where steps do
                         * not vary; else "auto" */
  int order;            /* composed to this order; 0: the method's own */
  double step;          /* may be negative; 0: that of the scene, in the direction of `end` */
  int ends;             /* 1: the motion is to end at `end`, and a fixed step is made so much smaller … */
  double end;           /* … that whole steps lead there; 0: no such adjustment */
  const char *rule;     /* rule for nonholonomic rows; NULL: the method's own */
  const char *solver;   /* "newton", "fixed-point", "automatic", "direct"; NULL: the first */
  const char *jacobian; /* "automatic", "fresh", "per-step", "kept"; NULL: the first */
  int project_start;    /* 1: an inconsistent start is moved onto the rows instead of refused */
  int substeps;         /* a step that cannot be solved is taken in 2, 4, … up to so many; 0: 1 */
  int compensated_sums; /* 1: sums of a step in extended precision */
  int pushed;           /* 1: diracstep_push will be used; damping is not looked for then */
  int fixed;            /* 1: steps of one size */
  double eps; /* above 0: steps vary, so many radians each, 0.2 is usual; with damped/radau:S by their
                 local error, 1e-6 is usual.  NaN: steps vary, by what is usual for the method */
  const char *control;  /* "integrating", "in-step", "irreversible"; NULL: the first */
  double smallest_step; /* of steps that vary, without sign; 0: 1e-9 of the time to the end */
  long max_steps;       /* of steps that vary: the next one fails; 0: ten million */
} diracstep_options;

typedef struct diracstep_integrator diracstep_integrator;

/* Makes an integrator at the scene's start; *integrator is NULL where that fails.  `options` may be NULL. */
DIRACSTEP_API int diracstep_create(const diracstep_model *model, const diracstep_options *options,
                                   diracstep_integrator **integrator);
/* Ends an integrator, NULL as well. */
DIRACSTEP_API void diracstep_destroy(diracstep_integrator *integrator);

/* What is assembled, and what is left out and why: item, decision, reason.  Whether variable steps pay is
   told by a coarse run, of some hundred steps. */
DIRACSTEP_API int diracstep_plan(const diracstep_integrator *integrator, diracstep_table *table);

/* Takes steps until `steps` are done, an event ends the motion (see diracstep_statistics) or one fails; the
 * state is then that before the failed step.  The checks of a run go along, see diracstep_doubt; with
 * `pushed` that of the step size alone. */
DIRACSTEP_API int diracstep_step(diracstep_integrator *integrator, long steps);

/* One step of size h, which may change from step to step and be negative; not where steps vary. */
DIRACSTEP_API int diracstep_step_by(diracstep_integrator *integrator, double h);

/* Sets a further generalised force, n numbers, which acts from here on; zero at first.  Needs `pushed`. */
DIRACSTEP_API int diracstep_push(diracstep_integrator *integrator, const double *force);

/* Reads the current point; where an event has ended the motion that of the event, its p as read last. */
DIRACSTEP_API int diracstep_read(diracstep_integrator *integrator, int momentum, diracstep_state *state);

/* The time of the current point. */
DIRACSTEP_API double diracstep_time(const diracstep_integrator *integrator);

/* Starts anew from a consistent point; q and v NULL: from the scene's start, the only one where steps vary.
 */
DIRACSTEP_API int diracstep_reset(diracstep_integrator *integrator, double time, const double *q,
                                  const double *v);

/* All that the next steps depend on, as bytes: *size becomes how many, and where there is room for so many
 * they are written, the push among them.  An integrator of the same scene, parameters, method and step goes
 * on from them with the same bits; any other refuses them.  Not where steps vary. */
DIRACSTEP_API int diracstep_save(const diracstep_integrator *integrator, char *bytes, size_t room,
                                 size_t *size);
DIRACSTEP_API int diracstep_restore(diracstep_integrator *integrator, const char *bytes, size_t size);

/* "", or why what was read so far is not to be believed: what the checks of the last run found, or those of
 * diracstep_step since the start, and derivatives taken by differences that two step sizes do not agree on.
 * Valid until the next call of this thread. */
DIRACSTEP_API const char *diracstep_doubt(const diracstep_integrator *integrator);

/* What was done since the start. */
typedef struct diracstep_statistics {
  long steps, solves, iterations, residuals, jacobians;
  long retries;             /* steps that needed more than Newton's method from its first guess */
  double step;              /* its size; 0 where steps vary */
  double smallest, largest; /* size of a step that varies, without sign; else 0 */
  long resets; /* of the controller of steps that vary: more than one in 1000 ask for a smaller eps */
  int stopped; /* 1: an event has ended the motion, the last one that diracstep_read_event knows */
  int order;
  const char *method; /* valid as long as the integrator */
} diracstep_statistics;
DIRACSTEP_API int diracstep_read_statistics(const diracstep_integrator *integrator,
                                            diracstep_statistics *statistics);

/* ---- Events ---- */

/* Where an event was met.  What it points to is there until the next step, run, reset or restore. */
typedef struct diracstep_event {
  const char *name;
  double time;
  const double *q, *v;             /* s and n numbers: the point just before … */
  const double *after_q, *after_v; /* … and what the event made of it; NULL where it does not act */
  double impulse; /* Λ_c of a contact, momentum over the unit of its row; NaN where there is none */
} diracstep_event;

/* How many events were met since the start, in runs and in single steps. */
DIRACSTEP_API long diracstep_count_events(const diracstep_integrator *integrator);

/* The k-th of them, from 0, in the order of time. */
DIRACSTEP_API int diracstep_read_event(const diracstep_integrator *integrator, long k,
                                       diracstep_event *event);

/* ---- Runs ---- */

/* The caller's arrays: point k has row k.  Those that are NULL are not written. */
typedef struct diracstep_points {
  long room;                                         /* points for which there is room */
  long count;                                        /* points written */
  double *t;                                         /* room numbers */
  double *q, *v, *p, *lambda, *invariants, *outputs; /* room × s, n, n, m, i, o */
  double *energy;
  /* Called when there is no room for the next point: enlarges the arrays and `room`, and returns 0.  Where it
   * is NULL or returns anything else the run fails there. */
  int (*enlarge)(void *data, struct diracstep_points *points);
  void *data;
} diracstep_points;

/* How far a run goes, and what it keeps: the start, each `every`-th point, and the end. */
typedef struct diracstep_course {
  long steps; /* above 0: so many steps */
  int times;  /* above 0: at so many times instead, reached by shorter steps; at the time of an event as
               * it has left the motion … */
  const double *time; /* … which run from the current point on; those behind an event that ends the motion are
                       * not shown */
  int ends;           /* 1: to the time `end`; 0: to that of the options or else of the scene */
  double end;
  long every;      /* 0: 1 */
  int momentum;    /* DIRACSTEP_PROJECTED, … */
  const int *stop; /* or NULL.  Looked at before each step: where it is not 0 the run ends, and the point it
                    * has reached is kept */
} diracstep_course;

/* Runs from the current point, or to an event that ends the motion: its point is then the last one, but where
 * times are given.  What was kept before a failure is valid. */
DIRACSTEP_API int diracstep_run(diracstep_integrator *integrator, const diracstep_course *course,
                                diracstep_points *points);

/* How many points a run with a fixed step will keep at most, or 0 where that is not known. */
DIRACSTEP_API long diracstep_expect(const diracstep_integrator *integrator, const diracstep_course *course);

/* An error asked for, and how far its search may go. */
typedef struct diracstep_error {
  double error;    /* relative, at the end */
  int steps;       /* 0: the library chooses, 1: fixed, 2: they vary */
  long max_solves; /* 0: a million */
  double max_time; /* seconds; 0: 30 */
} diracstep_error;

/* What the search found.  Texts, table and events are valid until the next call of this thread. */
typedef struct diracstep_found {
  double estimate;       /* of the error at the end */
  double observed_order; /* NaN where it is not known */
  double step;           /* eps where steps vary */
  int order, varies;
  long solves; /* of all runs */
  const char *method, *reason;
  const char *warning;  /* "", or why the estimate deserves less trust or the run is not to be believed */
  diracstep_table runs; /* step, steps, solves, difference, estimate, observed order, why it does not count */
  int stopped;          /* 1: an event has ended the motion, the last one of … */
  long events;          /* … so many events of the scene that the run met … */
  const diracstep_event *event; /* … and they, in the order of time */
} diracstep_found;

/* A run with method and steps that the library finds, repeated until the estimated error at the end is below
 * the one asked for.  Of the course, `steps` does not count; times lie before the end, where the error
 * is.  Steps are of one size where the scene has events: DIRACSTEP_MISUSE where they are to vary.
 * DIRACSTEP_FAILED where the search is refused: `found` and one point are then the best answer so far. */
DIRACSTEP_API int diracstep_solve(const diracstep_model *model, const diracstep_options *options,
                                  const diracstep_course *course, const diracstep_error *error,
                                  diracstep_points *points, diracstep_found *found);

/* ---- Derivatives of a motion (docs/sensitivities.md) ---- */

/* Of the end of a motion from where the integrator stands, by q0, by v0 with p0 = dL/dv, and by P parameters
 * of the scene, which move its start as its file says.  Arrays that are NULL are not written. */
typedef struct diracstep_derivatives {
  long steps;                   /* that are taken */
  int parameters;               /* P … */
  const char *const *parameter; /* … and their names */
  /* Without a cotangent: n x (2n + P), column by column: those of the end's q, v and projected p by q0, by v0
   * and by the parameters. */
  /* With one, for a function of the end: n numbers by q0 in `q`, n by v0 in `v`, and P in `by_parameters`. */
  double *q, *v, *p, *by_parameters;
  /* Writes the derivatives of the function by q, v and p at the end, zeros at first; 0, or else it fails. */
  int (*cotangent)(void *data, const diracstep_state *end, double *q, double *v, double *p);
  void *data;
  const int *stop; /* or NULL, looked at before each step, there and back: where it is not 0 nothing is
                    * written, and the integrator stands where it has come to */
} diracstep_derivatives;

/* Takes the steps and differentiates them.  Of steps of fixed size, without a pushed force, and of an
 * integrator that was made with this model. */
DIRACSTEP_API int diracstep_differentiate(const diracstep_model *model, diracstep_integrator *integrator,
                                          const diracstep_derivatives *derivatives);

/* ---- Parameters from data ---- */

/* Measured numbers, and which parameters of the scene are fitted to them. */
typedef struct diracstep_data {
  const char *file;          /* CSV: t, then columns; an empty field was not measured.  Or NULL: */
  int columns;               /* how many … */
  const char *const *column; /* … coordinates, "v_" before one for its velocity, outputs … */
  long rows;
  const double *time;  /* … at these times, which ascend … */
  const double *value; /* … rows × columns, NaN where nothing was measured */
  int sigmas;          /* columns whose standard deviation, or that in relation to others, is not 1 … */
  const diracstep_parameter *sigma; /* … and they */
  int parameters;                   /* P … */
  const char *const *parameter;     /* … which begin with the values of the model, or with … */
  int starts;
  const diracstep_parameter *start;
  double confidence; /* of the intervals; 0: 0.95 */
  int max_motions;   /* that the search may take; 0: 200 */
  const int *stop;   /* or NULL, looked at in each step */
} diracstep_data;

/* What was found.  Texts and numbers are valid until the next call of this thread. */
typedef struct diracstep_fitted {
  int motions;              /* that were taken */
  long measured;            /* numbers that were */
  double residual;          /* standard deviation of what is left, in units of sigma */
  const double *value;      /* P numbers … */
  const double *interval;   /* … what their confidence interval is to both sides, infinite where the data do
                             * not determine one … */
  const double *covariance; /* … P × P */
  const char *ending;       /* of the search, in words */
  const char *doubt;        /* "", or why the parameters are not to be believed */
} diracstep_fitted;

/* Fits parameters of a scene from a file or text by least squares.  Of the options method, order, step (the
 * largest; between two times so many equal ones are taken), rule, solver and jacobian count.
 * DIRACSTEP_FAILED where the search does not converge: `found` is then the best so far. */
DIRACSTEP_API int diracstep_fit(const diracstep_model *model, const diracstep_options *options,
                                const diracstep_data *data, diracstep_fitted *found);

/* ---- Ensembles ---- */

/* Many starts of one scene, each of them consistent. */
typedef struct diracstep_ensemble {
  int members;
  const double *time;  /* or NULL: all at the scene's; equal ones where steps is 0 */
  const double *q, *v; /* members × s, n; v may be NULL: the scene's */
  long steps;          /* 0: to the end that the options give */
  int momentum;
  int threads;     /* 0: one for each processor.  Results are the same bits for every number */
  const int *stop; /* or NULL, looked at before each member */
} diracstep_ensemble;

/* Steps each member and writes its end, in the order of the starts: the last point that could be read where
 * it failed, that of the event where one ended its motion.  Steps of fixed size only.  `told`, or NULL,
 * becomes the number of a member, "failed" or "doubted", and why; members spread evenly over the starts, at
 * most twenty, are run with the checks of a run. */
DIRACSTEP_API int diracstep_run_ensemble(const diracstep_model *model, const diracstep_options *options,
                                         const diracstep_ensemble *ensemble, diracstep_points *ends,
                                         diracstep_table *told);

/* ---- Motions between two ends (docs/boundary_values.md) ---- */

/* What is asked of the ends of a motion by equal steps from the scene's start time to `end` of the options.
 * Names are those of coordinates, or "v_" or "p_" before one for its velocity or momentum. */
typedef struct diracstep_ends {
  int of_start; /* how many numbers are asked of the start; 0: its coordinates, and where controls are
                 * searched its velocities, are those of the scene's start … */
  const diracstep_parameter *at_start; /* … and which */
  int of_end;                          /* the same of the end */
  const diracstep_parameter *at_end;
  int periodic; /* 1, and nothing asked: q and v at the end as at the start; not for controls */
  int guesses;  /* points of a motion that the search begins with; 0: a straight line between two places,
                 * else the motion from the scene's start … */
  const double *guess_time;        /* … at these times … */
  const double *guess_q, *guess_v; /* … guesses × n */
  int max_iterations;              /* 0: 60, for controls 500 */
  const int *stop;                 /* or NULL, looked at in each iteration */
} diracstep_ends;

/* What was found, beside the points.  Texts and numbers are valid until the next call of this thread. */
typedef struct diracstep_boundary {
  int iterations;
  double correction; /* the last one, in parts of the largest number of its kind */
  double residual;   /* of the conditions */
  const char *method;
  const char *doubt;        /* "", or why the motion is not to be believed */
  const char *other;        /* "", or that another motion fulfils the conditions */
  const char *no_action;    /* "", or why there is no action; then `action` is NaN and the next are NULL */
  double action;            /* S(q0, qN), the sum of the discrete Lagrangians */
  const double *gradient;   /* 2n numbers, by q0 and by qN: -p0 and pN */
  const double *hessian;    /* 2n × 2n, row by row, symmetric to round-off; NULL with rows too */
  int free_directions;      /* that periodic conditions leave … */
  int multipliers;          /* … and Floquet's multipliers … */
  const double *multiplier; /* … real and imaginary part of each */
} diracstep_boundary;

/* Finds a motion and writes the ends of its steps: t, q, v, p projected, energy, invariants and outputs;
 * forces of rows are not known there, so that `lambda` and outputs that read it become NaN.  DIRACSTEP_FAILED
 * where the search does not converge: the points are then its last iterate.  DIRACSTEP_MISUSE for conditions
 * that are too many or too few, and with events. */
DIRACSTEP_API int diracstep_solve_boundary(const diracstep_model *model, const diracstep_options *options,
                                           const diracstep_ends *ends, diracstep_points *points,
                                           diracstep_boundary *found);

/* How controls, the parameters that `[control]` of a scene file names, are searched
 * (docs/optimal_control.md).
 */
typedef struct diracstep_control {
  int of_least; /* how many bounds there are of coordinates at the ends of steps and of controls … */
  const diracstep_parameter *least; /* … and they */
  int of_greatest;                  /* the same from above */
  const diracstep_parameter *greatest;
  int degree;       /* of the polynomials in t that controls are in each step */
  double tolerance; /* of the optimality conditions; 0: 1e-9 */
} diracstep_control;

/* What was found, beside the points.  Texts and numbers are valid until the next call of this thread. */
typedef struct diracstep_controlled {
  int iterations;
  double cost;
  double residual;   /* of the steps, the rows and the conditions */
  double end_of_run; /* how far from the end a run with these controls ends; NaN where it fails */
  const char *method;
  const char *doubt;           /* "", or why the controls are not to be believed */
  int controls;                /* P … */
  const char *const *name;     /* … and their names */
  long control_points;         /* K */
  const double *control_time;  /* K numbers: the middles of the steps, or where polynomials have values */
  const double *control_value; /* K × P */
} diracstep_controlled;

/* Finds the controls of least cost, and writes points as diracstep_solve_boundary() does; errors as there.
 * DIRACSTEP_MISUSE where the library was built without Ipopt: see diracstep_can_control(). */
DIRACSTEP_API int diracstep_solve_control(const diracstep_model *model, const diracstep_options *options,
                                          const diracstep_ends *ends, const diracstep_control *control,
                                          diracstep_points *points, diracstep_controlled *found);

/* 1 where the library was built with Ipopt, else 0. */
DIRACSTEP_API int diracstep_can_control(void);

#ifdef __cplusplus
}
#endif

#endif
