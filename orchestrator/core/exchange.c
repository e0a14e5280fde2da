/* Bringing the inputs of a block up to date: moves, tables, strings, faults. */
#include "binding.h"
#include "plan.h"

static bool run_table(slw_core *core, uint32_t block, const slw_table *t) {
  const int64_t value = core->cells[t->source].integer;
  for (size_t i = 0; i < t->n; i++)
    if (t->from[i] == value) {
      core->cells[t->target].integer = t->to[i];
      return true;
    }
  core->cells[t->target].integer = value;
  if (!t->strict) return true;
  return slw_fail(core, SLW_NOT_IN_TABLE, SLW_OK, block == SLW_SINK ? NULL : &core->blocks[block], t->source);
}

/* The one place where a step may allocate: a string that grew. */
static bool run_copy(slw_core *core, const slw_copy *c) {
  const slw_blob *from = &core->blobs[core->cells[c->source].integer];
  slw_blob *to = &core->blobs[core->cells[c->target].integer];
  return slw_blob_write(to, from->data, from->size) || slw_fail(core, SLW_DOING_SET, SLW_ERROR, NULL, c->target);
}

bool slw_core_write_blob(slw_core *core, uint32_t cell, const char *data, size_t size) {
  if (cell >= core->n_cells || (uint64_t)core->cells[cell].integer >= core->n_blobs) return false;
  return slw_blob_write(&core->blobs[core->cells[cell].integer], data, size);
}

bool slw_exchange_run(slw_core *core, uint32_t block, slw_exchange *e) {
  for (uint32_t i = 0; i < e->n_moves; i++) slw_move_run(core->cells, &e->moves[i]);
  for (uint32_t i = 0; i < e->n_tables; i++)
    if (!run_table(core, block, &e->tables[i])) return false;
  for (uint32_t i = 0; i < e->n_copies; i++)
    if (!run_copy(core, &e->copies[i])) return false;
  for (uint32_t i = 0; i < e->n_injections; i++) {
    slw_injection *in = &e->injections[i];
    const double x = core->cells[in->cell].real;
    if (in->tick != core->tick) in->tick = core->tick, in->raw = x;
    core->cells[in->cell].real = slw_fault_apply(in->fault, core->tick, x);
  }
  return true;
}

void slw_exchange_accept(slw_core *core, slw_exchange *e) {
  for (uint32_t i = 0; i < e->n_injections; i++)
    slw_fault_accept(e->injections[i].fault, core->tick, e->injections[i].raw);
}

void slw_exchange_forget(slw_core *core) {
  for (uint32_t i = 0; i <= core->n_blocks; i++) {
    slw_exchange *e = i < core->n_blocks ? &core->blocks[i].in : &core->sink;
    for (uint32_t k = 0; k < e->n_injections; k++) e->injections[k].tick = -1;
  }
}
