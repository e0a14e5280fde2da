/* The whole system's state as bytes: header, cells, strings, faults, then the FMUs' own serialised states. */
#include "plan.h"

#include <stdio.h>

typedef struct {
  char magic[8];
  uint32_t n_cells, n_blobs, n_blocks, reserved;
  int64_t tick;
  uint64_t size; /* of the adaptive step */
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
  return write_all(core, &s) && s.used == size;
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
