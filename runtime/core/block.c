/* One block: compiled once for each model, with the FMU shim's core.c, integrator.c and the generated model.c.
 *
 * names.h (generated) gives all their symbols the block's prefix, for a core holds several; block_map.h
 * (generated) says which signals are the inputs and outputs.  `work` keeps nothing from call to call: what a
 * block remembers is in the caller's state.
 */
#include "block.h"

#include <string.h>

#include "block_map.h"
#include "core.h"

static SlwCore work;
static const int inputs[] = SLR_BLOCK_INPUTS;
static const int outputs[] = SLR_BLOCK_OUTPUTS;

static void read_board(const double *board) {
  for (int i = 0; i < SLW_NU; i++) work.s.u[i] = board[inputs[i]];
}

static void write_board(double *board) {
  for (int i = 0; i < SLW_NY; i++) board[outputs[i]] = work.s.y[i];
}

static void initialise(void *state, double *board) {
  slw_reset(&work);
  read_board(board);
  slw_initialise(&work);
  write_board(board);
  memcpy(state, &work.s, sizeof work.s);
}

static int step(void *state, double *board) {
  memcpy(&work.s, state, sizeof work.s);
  read_board(board);
  const int failed = slw_step(&work, SLW_STEP);
  write_board(board);
  memcpy(state, &work.s, sizeof work.s);
  return failed;
}

const SlrBlock SLR_BLOCK = {SLR_BLOCK_NAME,   SLR_BLOCK_PERIOD, SLW_NU, inputs,
                            sizeof(SlwState), initialise,       step};
