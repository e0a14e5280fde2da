/* The block in a controller's place when a policy is evaluated outside the core: it holds what was offered.
 *
 * Each of its steps needs an offer of its own.  A step without one keeps the last commands, the second in a row
 * fails: whoever evaluates the policy has gone.
 */
#include <string.h>

#include "core_config.h"
#include "slr.h"

enum { ACTIONS = 3, MISSES = 2 };

typedef struct {
  double action[ACTIONS];
  int64_t fresh;  /* offered since the last step */
  int64_t missed; /* steps in a row without an offer */
} Held;

static const int outputs[ACTIONS] = SLR_EXTERNAL_OUTPUTS;

static void write_board(const Held *held, double *board) {
  for (int i = 0; i < ACTIONS; i++) board[SLR_OWN(outputs[i])] = held->action[i];
}

static void initialise(void *state, double *board) {
  Held *held = state;
  const int64_t fresh = held->fresh; /* the first answer is offered before the first step */
  double first[ACTIONS];
  memcpy(first, held->action, sizeof first);
  memset(held, 0, sizeof *held);
  write_board(held, board);
  if (fresh) memcpy(held->action, first, sizeof first);
  held->fresh = fresh;
}

static int step(void *state, double *board) {
  Held *held = state;
  held->missed = held->fresh ? 0 : held->missed + 1;
  held->fresh = 0;
  write_board(held, board);
  return held->missed < MISSES ? 0 : -1;
}

const SlrBlock external_block = {"external", SLR_EXTERNAL_PERIOD, 0, NULL, sizeof(Held), initialise, step};

void slr_offer(SlrState *s, const double *action) {
  Held *held = (Held *)(void *)slr_state_of(s, slr_controller);
  memcpy(held->action, action, sizeof held->action);
  held->fresh = 1;
}
