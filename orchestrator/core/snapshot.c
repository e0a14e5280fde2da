/* The whole system's state as bytes: header, cells, strings, faults, then the FMUs' own serialised states. */
#include "plan.h"

#include <stdio.h>

typedef struct {
  char magic[8];
  uint32_t n_cells, n_blobs, n_blocks, reserved;
  int64_t tick;
  uint64_t size;  /* of the adaptive step */
  uint64_t check; /* over plan and bytes, this number being 0 */
} slw_header;

static const char magic[8] = "SLWSNAP";

/* Writing, or with `bytes` NULL just counting; reading checks what is left. */
typedef struct {
  char *out;
  const char *in;
  size_t used, size;
} slw_stream;

static void put(slw_stream *s, const void *data, size_t size) {
  if (s->out && s->used + size <= s->size) memcpy(s->out + s->used, data, size);
  s->used += size;
}

static bool take(slw_stream *s, void *data, size_t size) {
  if (size > s->size - s->used) return false;
  memcpy(data, s->in + s->used, size);
  s->used += size;
  return true;
}

/* FNV-1a: tells damage and mistakes, not intent. */
uint64_t slw_hashed(uint64_t hash, const void *data, size_t size) {
  const unsigned char *bytes = data;
  for (size_t i = 0; i < size; i++) hash = (hash ^ bytes[i]) * UINT64_C(0x100000001b3);
  return hash;
}

static uint64_t hashed_groups(uint64_t hash, const slw_group *groups, uint32_t n) {
  for (uint32_t i = 0; i < n; i++) {
    const uint64_t head[3] = {(uint64_t)groups[i].type, groups[i].n_vr, groups[i].n};
    hash = slw_hashed(slw_hashed(hash, head, sizeof head), groups[i].vr, groups[i].n_vr * sizeof *groups[i].vr);
  }
  return hash;
}

/* What the bytes, `size` of them and at least a header, must have as `check` to be of this plan. */
static uint64_t check_of(const slw_core *core, const char *bytes, size_t size) {
  slw_header header;
  uint64_t hash = slw_hashed(UINT64_C(0xcbf29ce484222325), &core->step_s, sizeof core->step_s);
  for (const slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) {
    hash = slw_hashed(hash, &b->multiple, sizeof b->multiple);
    for (uint32_t i = 0; b->timed && i < b->n_clocks; i++)
      hash = slw_hashed(hash, &b->clocks[i].vr, sizeof b->clocks[i].vr);
    hash = hashed_groups(hashed_groups(hash, b->sets, b->n_sets), b->gets, b->n_gets);
  }
  hash = slw_hashed(hash, &core->max_halvings, sizeof core->max_halvings);
  memcpy(&header, bytes, sizeof header);
  header.check = 0;
  return slw_hashed(slw_hashed(hash, &header, sizeof header), bytes + sizeof header, size - sizeof header);
}

static slw_exchange *exchange_at(slw_core *core, uint32_t i) {
  return i < core->n_blocks ? &core->blocks[i].in : &core->sink;
}

static void put_faults(slw_core *core, slw_stream *s) {
  for (uint32_t i = 0; i <= core->n_blocks; i++) {
    const slw_exchange *e = exchange_at(core, i);
    for (uint32_t k = 0; k < e->n_injections; k++) {
      const size_t size = slw_fault_state_size(e->injections[k].fault);
      if (s->out && s->used + size <= s->size) slw_fault_save(e->injections[k].fault, s->out + s->used);
      s->used += size;
    }
  }
}

static bool take_faults(slw_core *core, slw_stream *s) {
  for (uint32_t i = 0; i <= core->n_blocks; i++) {
    slw_exchange *e = exchange_at(core, i);
    for (uint32_t k = 0; k < e->n_injections; k++) {
      const size_t size = slw_fault_state_size(e->injections[k].fault);
      if (size > s->size - s->used) return false;
      slw_fault_restore(e->injections[k].fault, s->in + s->used);
      s->used += size;
    }
  }
  return true;
}

static bool put_fmu(slw_block *b, slw_stream *s) {
  for (uint32_t i = 0; b->timed && i < b->n_clocks; i++) put(s, &b->clocks[i].next, sizeof b->clocks[i].next);
  for (const slw_group *g = b->sets; g < b->sets + b->n_sets; g++)
    if (g->told) put(s, g->told, g->n * sizeof *g->told);
  void *state = NULL;
  size_t size = 0;
  bool done = b->fmu->call->get_state(b->fmu, &state) <= SLW_WARNING;
  done = done && b->fmu->call->serialized_size(b->fmu, state, &size) <= SLW_WARNING;
  const uint64_t length = size;
  put(s, &length, sizeof length);
  if (done && s->out && s->used + size <= s->size)
    done = b->fmu->call->serialize(b->fmu, state, s->out + s->used, size) <= SLW_WARNING;
  s->used += size;
  if (state) b->fmu->call->free_state(b->fmu, &state);
  return done;
}

static bool take_fmu(slw_block *b, slw_stream *s) {
  for (uint32_t i = 0; b->timed && i < b->n_clocks; i++)
    if (!take(s, &b->clocks[i].next, sizeof b->clocks[i].next)) return false;
  for (const slw_group *g = b->sets; g < b->sets + b->n_sets; g++)
    if (g->told && !take(s, g->told, g->n * sizeof *g->told)) return false;
  uint64_t size = 0;
  void *state = NULL;
  if (!take(s, &size, sizeof size) || size > s->size - s->used) return false;
  bool done = b->fmu->call->deserialize(b->fmu, s->in + s->used, (size_t)size, &state) <= SLW_WARNING;
  done = done && b->fmu->call->set_state(b->fmu, state) <= SLW_WARNING;
  s->used += (size_t)size;
  if (state) b->fmu->call->free_state(b->fmu, &state);
  return done;
}

static bool write_all(slw_core *core, slw_stream *s) {
  slw_header header = {.n_cells = core->n_cells, .n_blobs = core->n_blobs, .n_blocks = core->n_blocks,
                       .tick = core->tick, .size = core->size};
  memcpy(header.magic, magic, sizeof magic);
  put(s, &header, sizeof header);
  put(s, core->cells, core->n_cells * sizeof *core->cells);
  for (uint32_t i = 0; i < core->n_blobs; i++) {
    const uint64_t size = core->blobs[i].size;
    put(s, &size, sizeof size);
    put(s, core->blobs[i].data, core->blobs[i].size);
  }
  put_faults(core, s);
  for (uint32_t i = 0; i < core->n_blocks; i++)
    if (!put_fmu(&core->blocks[i], s)) {
      snprintf(core->error, sizeof core->error, "block %u cannot serialise its state", i);
      return false;
    }
  return true;
}

size_t slw_core_snapshot_size(slw_core *core) {
  slw_stream s = {NULL, NULL, 0, 0};
  return write_all(core, &s) ? s.used : 0;
}

bool slw_core_snapshot(slw_core *core, char *bytes, size_t size) {
  slw_stream s = {bytes, NULL, 0, size};
  if (!write_all(core, &s) || s.used != size) return false;
  const uint64_t check = check_of(core, bytes, size);
  memcpy(bytes + offsetof(slw_header, check), &check, sizeof check);
  return true;
}

static bool take_blobs(slw_core *core, slw_stream *s) {
  for (uint32_t i = 0; i < core->n_blobs; i++) {
    slw_blob *b = &core->blobs[i];
    uint64_t size = 0;
    if (!take(s, &size, sizeof size) || size > s->size - s->used) return false;
    if (b->capacity < size + 1) {
      char *data = realloc(b->data, (size_t)size + 1);
      if (!data) return false;
      b->data = data, b->capacity = (size_t)size + 1;
    }
    if (!take(s, b->data, (size_t)size)) return false;
    b->data[size] = 0, b->size = (size_t)size;
  }
  return true;
}

static bool read_all(slw_core *core, slw_stream *s) {
  slw_header h;
  if (!take(s, &h, sizeof h) || memcmp(h.magic, magic, sizeof magic) != 0) return false;
  if (h.n_cells != core->n_cells || h.n_blobs != core->n_blobs || h.n_blocks != core->n_blocks) return false;
  if (h.check != check_of(core, s->in, s->size)) return false;
  if (!take(s, core->cells, core->n_cells * sizeof *core->cells) || !take_blobs(core, s)) return false;
  if (!take_faults(core, s)) return false;
  for (uint32_t i = 0; i < core->n_blocks; i++)
    if (!take_fmu(&core->blocks[i], s)) return false;
  slw_exchange_forget(core);
  core->tick = h.tick, core->size = h.size, core->next_change = 0;
  while (core->next_change < core->n_changes && core->changes[core->next_change].tick < h.tick) core->next_change++;
  core->next_change_tick =
      core->next_change < core->n_changes ? core->changes[core->next_change].tick : SLW_NEVER;
  return s->used == s->size;
}

bool slw_core_restore(slw_core *core, const char *bytes, size_t size) {
  slw_stream s = {NULL, bytes, 0, size};
  if (read_all(core, &s)) return true;
  snprintf(core->error, sizeof core->error, "the bytes are no snapshot of this system");
  return false;
}
