/* Bringing the inputs of a block up to date: moves, tables, strings, faults. */
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

static bool run_copy(slw_core *core, const slw_copy *c) {
  const slw_blob *from = &core->blobs[core->cells[c->source].integer];
  slw_blob *to = &core->blobs[core->cells[c->target].integer];
  if (to->capacity < from->size + 1) { /* the one place where a step may allocate: a string grew */
    char *data = realloc(to->data, 2 * from->size + 1);
    if (!data) return slw_fail(core, SLW_DOING_SET, SLW_ERROR, NULL, c->target);
    to->data = data, to->capacity = 2 * from->size + 1;
  }
  if (from->size) memcpy(to->data, from->data, from->size);
  to->data[from->size] = 0;
  to->size = from->size;
  return true;
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
