/* From tick to tick: changes, pace, the logged row, the step. */
#include "plan.h"

static bool apply(slw_core *core, const slw_change *c, bool parameters) {
  if (c->block == SLW_SINK) {
    core->cells[c->target] = c->value;
    return true;
  }
  if (!parameters) return true;
  slw_block *b = &core->blocks[c->block];
  slw_cell value = c->value;
  uint64_t native; /* as large as any native form of a number */
  const slw_group group = {c->type, 1, 1, &c->target, &value,
                           slw_native_size(b->fmu->fmi_version, c->type) ? &native : NULL, NULL, NULL};
  return slw_block_parameter(core, b, &group);
}

/* Changes of ticks up to `tick`; without `parameters` stimuli only, and all stay due. */
bool slw_apply_changes(slw_core *core, int64_t tick, bool parameters) {
  size_t i = core->next_change;
  for (; i < core->n_changes && core->changes[i].tick <= tick; i++)
    if (!apply(core, &core->changes[i], parameters)) return false;
  if (!parameters) return true;
  core->next_change = i;
  core->next_change_tick = i < core->n_changes ? core->changes[i].tick : SLW_NEVER;
  return true;
}

bool slw_run_sink(slw_core *core) {
  if (!slw_exchange_run(core, SLW_SINK, &core->sink)) return false;
  slw_exchange_accept(core, &core->sink);
  return true;
}

slw_outcome slw_core_run(slw_core *core, int64_t until) {
  if (core->plain) return slw_run_plain(core, until);
  while (core->tick < until) {
    if (!slw_begin_tick(core)) return SLW_FAILED;
    if (!core->advance(core)) return SLW_FAILED;
    if (core->n_targets && !core->ended && !slw_clocks_run(core, core->tick + 1, slw_time_of(core, core->tick + 1)))
      return SLW_FAILED;
    core->tick++;
    if (core->ended) return SLW_ENDED;
  }
  return SLW_DONE;
}

bool slw_core_log_last(slw_core *core) {
  return slw_begin_tick(core);
}

void slw_core_log_finish(slw_core *core) {
  if (core->logs) slw_ring_finish(&core->ring, true);
}

size_t slw_core_take(slw_core *core, slw_cell *rows, size_t at_least, size_t max, int wait_ms) {
  return core->logs ? slw_ring_take(&core->ring, rows, at_least, max, wait_ms) : 0;
}

void slw_core_block_statistics(const slw_core *core, uint32_t block, slw_block_statistics *statistics) {
  memset(statistics, 0, sizeof *statistics);
  if (block >= core->n_blocks) return;
  const slw_block *b = &core->blocks[block];
  *statistics = b->count;
  /* The fast path does not count: every step it took is one of the system's. */
  if (b->path != SLW_GENERAL) statistics->steps += (uint64_t)core->tick;
}
