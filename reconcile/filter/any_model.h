/* Sizes and equations of a model that come with each run: filter.c is compiled once, with this, for all models. */
#include "most.h" /* generated: MOST_... */

/* Operations, four numbers each: which one (CasADi's), where its result goes, from where.  Played up to the end's. */
typedef struct {
  const int *operations;
  const double *constants;
} Tape;

typedef struct {
  int nx, nu, nm, nw, ny, ni, nh, axes, posts, w0, dt, early, discrete;
  double step;
  const int *axis_v, *axis_q;
  const Tape *tapes; /* kf_in, kf_f, kf_dry, kf_post, kf_fj, kf_hj, kf_first */
} Model;

extern const Model *model; /* of the run that goes on */

#define SZ_W 0
#define SZ_IW 0
#define NX model->nx
#define NU model->nu
#define NM model->nm
#define NW model->nw
#define NY model->ny
#define NI model->ni
#define NH model->nh
#define AXES model->axes
#define POSTS model->posts
#define W0 model->w0
#define DT model->dt
#define EARLY model->early
#define DISCRETE model->discrete
#define STEP model->step
#define axis_v model->axis_v
#define axis_q model->axis_q
