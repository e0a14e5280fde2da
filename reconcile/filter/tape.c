/* The equations of any model, played operation by operation: what compiled ones compute, bit for bit, without a compiler. */
#include <math.h>

#include "any_model.h"
#include "slw_math.h"

const Model *model;

static int play(const Tape *tape, const double **arg, double **res) {
  static double w[MOST_W];
  static const void *const places[] = {
#include "places.h" /* generated: where each operation is done */
  };
  const double *constant = tape->constants;
  const int *o = tape->operations;
#define a w[o[2]]
#define b w[o[3]]
#define NEXT \
  o += 4; \
  goto *places[o[0]];
  goto *places[o[0]]; /* each goes on to the next: what follows what is foreseen better than from one place */
#include "operations.h" /* generated */
}
#undef a
#undef b

#define PLAYED(name, which) \
  int name(const double **arg, double **res, long long *iw, double *w, int mem) { \
    (void)iw, (void)w, (void)mem; \
    return play(model->tapes + which, arg, res); \
  }
PLAYED(kf_in, 0)
PLAYED(kf_f, 1)
PLAYED(kf_dry, 2)
PLAYED(kf_post, 3)
PLAYED(kf_fj, 4)
PLAYED(kf_hj, 5)
PLAYED(kf_first, 6)

int run_filter(const void *run);

__attribute__((visibility("default"))) int run_model(const Model *its, const void *run) {
  model = its;
  return run_filter(run);
}
