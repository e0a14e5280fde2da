/* The block in a controller's place when a policy outside commands: it hands on what the input image says.
 *
 * The commands are inputs like all others: check.c judges their age, mode.c stops when they are lost, a recording has
 * them.  Guard and gate come after it, as after every controller.
 */
#include "core_config.h"
#include "slr.h"

static const int inputs[] = SLR_OUTSIDE_INPUTS;
static const int outputs[] = SLR_OUTSIDE_OUTPUTS;

static void initialise(void *state, double *board) {
  (void)state;
  for (int i = 0; i < SLR_OUTSIDE_COMMANDS; i++) board[SLR_OWN(outputs[i])] = 0.0;
}

static int step(void *state, double *board) {
  (void)state;
  for (int i = 0; i < SLR_OUTSIDE_COMMANDS; i++) board[SLR_OWN(outputs[i])] = board[inputs[i]];
  return 0;
}

const SlrBlock outside_block = {"outside", 1, SLR_OUTSIDE_COMMANDS, inputs, 0, initialise, step};
