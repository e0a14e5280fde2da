/* The model-independent part of a co-simulation FMU.
 *
 * Everything an FMU state must hold is in SlwState, which contains values only: copying it saves and
 * restores the future, also half-way through a delay and in another process.  Nothing here allocates.
 * Time is `tick`, a count of internal steps; no function reads a clock.
 *
 * The generated model_config.h gives the sizes (SLW_NX ...) and the generated model.c the equations
 * (slw_f, slw_h ...) and the tables declared below.
 */
#ifndef SLW_CORE_H
#define SLW_CORE_H

#include <stddef.h>
#include <stdint.h>

#include "model_config.h"

#define SLW_LEN(n) ((n) > 0 ? (n) : 1) /* C has no arrays of length 0 */

/* ---- generated tables ---- */

typedef enum { SLW_STATE, SLW_DERIVATIVE, SLW_INPUT, SLW_OUTPUT, SLW_PARAMETER, SLW_SEED, SLW_TIME } SlwGroup;

typedef struct {
  uint32_t vr; /* value reference; the table is sorted by it */
  SlwGroup group;
  int index; /* within the group */
  double min, max;
} SlwVariable;

typedef struct {
  int output;                     /* which output is measured */
  int delay, bias, noise, quantum; /* parameter indices, -1: none */
} SlwSensor;

typedef struct {
  int on_delay, off_delay; /* parameter indices, -1: at once */
  double start;
} SlwModeTable;

extern const SlwVariable slw_variables[SLW_NV];
extern const SlwSensor slw_sensors[SLW_LEN(SLW_NSENSORS)];
extern const SlwModeTable slw_modes[SLW_LEN(SLW_NM)];
extern const int slw_delay_input[SLW_LEN(SLW_NDELAYS)];     /* which input is delayed ... */
extern const int slw_delay_parameter[SLW_LEN(SLW_NDELAYS)]; /* ... and the parameter that says by how much */
extern const double slw_start_u[SLW_LEN(SLW_NU)];
extern const double slw_start_p[SLW_LEN(SLW_NP)];
extern const char *const slw_state_names[SLW_LEN(SLW_NX)];

/* Generated equations, in CasADi's calling convention; 0 on success. */
typedef int SlwFunction(const double **arg, double **res, long long *iw, double *w, int mem);
SlwFunction slw_constants; /* p -> q: what is computed once for many steps (continuous models) */
SlwFunction slw_f;      /* (x, u, m, q) -> dx/dt, or (x, u, m, p) -> the next state of a discrete model */
SlwFunction slw_h;      /* (x, u, m, p) -> outputs */
SlwFunction slw_factors; /* (x, u, m, q) -> dx/dt, factors of I - gamma h df/dx (continuous models) */
SlwFunction slw_solve;  /* (factors, b) -> (I - gamma h df/dx)^-1 b */
SlwFunction slw_guards; /* (x, u, m, p) -> on guards, off guards */
SlwFunction slw_x0;     /* p -> initial x */
SlwFunction slw_dir;    /* (x, u, m, p, dx, du, dp) -> df, dh */

/* ---- the instance ---- */

typedef struct {
  int64_t tick;    /* internal steps since the start */
  int64_t sample;  /* sensor samples taken so far */
  int64_t seed;    /* of the sensor noise; 0: no noise */
  double start_time;
  double x[SLW_LEN(SLW_NX)];
  double u[SLW_LEN(SLW_NU)]; /* as set from outside */
  double m[SLW_LEN(SLW_NM)];
  double p[SLW_LEN(SLW_NP)];
  double y[SLW_LEN(SLW_NY)]; /* outputs as the outside sees them */
  int64_t held[SLW_LEN(SLW_NM)]; /* ticks for which a mode's guard has held */
  int64_t serves;                /* internal steps that the factors still serve; 0: new ones are made */
  double factors[SLW_LEN(SLW_NF)], served_u[SLW_LEN(SLW_NU)], served_m[SLW_LEN(SLW_NM)]; /* and made for these */
  double line[SLW_LEN(SLW_NDELAYS)][SLW_LEN(SLW_LINE)]; /* input delay lines, one entry a tick */
  double echo[SLW_LEN(SLW_NSENSORS)][SLW_LEN(SLW_ECHO)]; /* sensor delay lines, one entry a sample */
} SlwState;

typedef enum { SLW_INSTANTIATED, SLW_INITIALISING, SLW_STEPPING, SLW_TERMINATED, SLW_FAILED } SlwPhase;

typedef struct {
  SlwState s;
  SlwPhase phase;
  int stale; /* initial values must be computed again before they are read */
  char message[256]; /* what went wrong, for the importer's log */
  double ud[SLW_LEN(SLW_NU)]; /* inputs as the equations see them: delayed */
  double f[SLW_LEN(SLW_NX)], k1[SLW_LEN(SLW_NX)], k2[SLW_LEN(SLW_NX)];
  double x1[SLW_LEN(SLW_NX)];
  double q[SLW_LEN(SLW_NQ)]; /* constants of the present parameters */
  double dx[SLW_LEN(SLW_NX)], du[SLW_LEN(SLW_NU)], dp[SLW_LEN(SLW_NP)];
  double w[SLW_LEN(SLW_SZ_W)]; /* work space of the generated functions */
  long long iw[SLW_LEN(SLW_SZ_IW)];
  double df[SLW_LEN(SLW_NX)], dh[SLW_LEN(SLW_NY)], h[SLW_LEN(SLW_NY)];
} SlwCore;

/* Start values, tick 0. */
void slw_reset(SlwCore *c);
/* Initial states, delay lines, modes, outputs from the present parameters and inputs. */
void slw_initialise(SlwCore *c);
/* `h` seconds on: 0 done, -1 failed (c->message says why). */
int slw_step(SlwCore *c, double h);

/* integrator.c: one internal step of the states, 0 on success. */
int slw_advance(SlwCore *c);
/* `function` of (x, u, m, p) at x and the delayed inputs; dx/dt there, once the constants are prepared. */
int slw_evaluate(SlwCore *c, SlwFunction *function, const double *x, double *result);
int slw_rates(SlwCore *c, const double *x, double *result);
void slw_prepare(SlwCore *c);

/* Float64 variables; NULL or -1 for an unknown or wrong value reference (c->message names it). */
int slw_get(SlwCore *c, uint32_t vr, double *value);
int slw_set(SlwCore *c, uint32_t vr, double value);
int slw_get_seed(SlwCore *c, uint32_t vr, int64_t *value);
int slw_set_seed(SlwCore *c, uint32_t vr, int64_t value);

/* sensitivity = d unknown / d known * seed, at the present point, modes and delay lines held fixed. */
int slw_directional(SlwCore *c, const uint32_t *unknown, size_t n_unknown, const uint32_t *known, size_t n_known,
                    const double *seed, double *sensitivity);

/* Serialised state: a header that names model and layout, then SlwState. */
size_t slw_serialised_size(void);
void slw_serialise(const SlwState *s, unsigned char *bytes);
int slw_deserialise(const unsigned char *bytes, size_t size, SlwState *s);

#endif
