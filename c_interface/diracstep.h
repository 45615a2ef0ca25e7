/* DiracStep from C and from every language that can call C: a scene made of callbacks, steps, and what can be
 * read.  Link libdiracstep.
 *
 * Every function that can fail returns DIRACSTEP_OK, DIRACSTEP_FAILED (a numerical failure or an error of a
 * callback) or DIRACSTEP_MISUSE (a wrong name, size, value or start); diracstep_message says what happened.
 * An integrator belongs to one thread at a time; different ones share nothing.
 */
#ifndef DIRACSTEP_H
#define DIRACSTEP_H

#include <diracstep/plugins/diracstep_scene.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Raised when a struct here or in diracstep_scene.h, or what a function does, changes; not for new functions.
 */
#define DIRACSTEP_VERSION_OF_C_INTERFACE 1u

#if defined(_WIN32)
#define DIRACSTEP_API __declspec(dllexport)
#else
#define DIRACSTEP_API __attribute__((visibility("default")))
#endif

/* What a function returns. */
enum { DIRACSTEP_OK = 0, DIRACSTEP_FAILED = 1, DIRACSTEP_MISUSE = 2 };

/* Which representative of the momentum class [p] in T*Q/annihilator is read. */
enum { DIRACSTEP_PLUS = 0, DIRACSTEP_MINUS = 1, DIRACSTEP_PROJECTED = 2 };

/* How a scene is stepped; all zero is the default. */
typedef struct diracstep_options {
  const char *method;        /* NULL: "type1/midpoint" */
  int order;                 /* composed to this order; 0: the method's own */
  double step;               /* step size, may be negative; 0: that of the scene */
  const char *rule;          /* rule for nonholonomic rows; NULL: the method's own */
  int project_start;         /* 1: an inconsistent start is moved onto the rows instead of refused */
  int plugins;               /* how many shared objects are loaded first … */
  const char *const *plugin; /* … and their paths */
} diracstep_options;

/* One point of the motion.  Columns of n numbers, lambda of as many as there are rows; those that are NULL
 * are not written. */
typedef struct diracstep_state {
  double time;
  double energy;
  double *q;
  double *v;      /* in the distribution */
  double *p;      /* the representative asked for */
  double *lambda; /* forces of the rows */
} diracstep_state;

typedef struct diracstep_integrator diracstep_integrator;

/* The version of the library, "0.1.0"; that of the headers is DIRACSTEP_VERSION of <diracstep/version.h>. */
DIRACSTEP_API const char *diracstep_version(void);

/* Makes an integrator at the scene's start.  `options` may be NULL.  *integrator is set in any case, for
 * diracstep_message, and to be given to diracstep_destroy; only after DIRACSTEP_OK can it be used.  What the
 * scene points to must stay where it is until then.  `version` is DIRACSTEP_VERSION_OF_C_INTERFACE. */
DIRACSTEP_API int diracstep_create(unsigned version, const diracstep_scene *scene,
                                   const diracstep_options *options, diracstep_integrator **integrator);
/* Ends an integrator, NULL as well. */
DIRACSTEP_API void diracstep_destroy(diracstep_integrator *integrator);

/* Takes steps until `steps` are done or one fails; the state is then that before the failed step. */
DIRACSTEP_API int diracstep_step(diracstep_integrator *integrator, long steps);

/* Reads the current point. */
DIRACSTEP_API int diracstep_read(diracstep_integrator *integrator, int momentum, diracstep_state *state);

/* Starts anew from a consistent point; q and v NULL: from the scene's start. */
DIRACSTEP_API int diracstep_reset(diracstep_integrator *integrator, double time, const double *q,
                                  const double *v);

/* What happened in the last call that did not return DIRACSTEP_OK; valid until the next call. */
DIRACSTEP_API const char *diracstep_message(const diracstep_integrator *integrator);

/* "", or why what was read so far is not to be believed: derivatives taken by differences that two step sizes
 * do not agree on.  Valid until the next call. */
DIRACSTEP_API const char *diracstep_doubt(diracstep_integrator *integrator);

#ifdef __cplusplus
}
#endif

#endif
