/* See channel.h. */
#include "channel.h"

#include <stdlib.h>
#include <string.h>

#ifdef __linux__
#include <linux/futex.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

/* How long a wait spins before it sleeps: it learns whether that pays. Where there are more processes than
 * processors it does not, since who spins keeps the other from running. */
#define LEAST_SPINS 16
#define MOST_SPINS 1024
static atomic_int spins = LEAST_SPINS;

#if defined(__x86_64__)
#define RELAX() __builtin_ia32_pause()
#else
#define RELAX() atomic_signal_fence(memory_order_seq_cst)
#endif

void slw_wait_word(_Atomic uint32_t *word, uint32_t seen, _Atomic uint32_t *sleeps, long wait_ns) {
  const int most = atomic_load_explicit(&spins, memory_order_relaxed);
  for (int i = 0; i < most; i++) {
    if (atomic_load_explicit(word, memory_order_acquire) != seen) {
      if (most < MOST_SPINS) atomic_store_explicit(&spins, most + most / LEAST_SPINS, memory_order_relaxed);
      return;
    }
    RELAX();
  }
  if (most > LEAST_SPINS) atomic_store_explicit(&spins, most / 2, memory_order_relaxed);
  const struct timespec limit = {wait_ns / 1000000000L, wait_ns % 1000000000L};
  atomic_store(sleeps, 1u);
  if (atomic_load(word) == seen) syscall(SYS_futex, word, FUTEX_WAIT, seen, &limit, NULL, 0);
  atomic_store(sleeps, 0u);
}

void slw_set_word(_Atomic uint32_t *word, uint32_t value, _Atomic uint32_t *sleeps) {
  atomic_store(word, value);
  if (atomic_load(sleeps)) syscall(SYS_futex, word, FUTEX_WAKE, 1, NULL, NULL, 0);
}
#endif

#define ALIGN 8u

void *slw_tape_take(slw_tape *t, size_t size) {
  const size_t padded = (size + ALIGN - 1) / ALIGN * ALIGN;
  if (t->failed || padded < size || padded > t->size - t->used) {
    t->failed = true;
    return NULL;
  }
  void *place = t->data + t->used;
  t->used += padded;
  return place;
}

void slw_tape_put(slw_tape *t, const void *data, size_t size) {
  void *place = slw_tape_take(t, size);
  if (place && size) memcpy(place, data, size);
}

void slw_tape_put_values(slw_tape *t, const slw_group *g) {
  if (!g->blobs) {
    slw_tape_put(t, g->cells, g->n * sizeof *g->cells);
    return;
  }
  for (size_t i = 0; i < g->n; i++) {
    const slw_blob *b = &g->blobs[g->cells[i].integer];
    const uint64_t size = b->size;
    slw_tape_put(t, &size, sizeof size);
    slw_tape_put(t, b->data, b->size);
  }
}

void slw_tape_put_group(slw_tape *t, const slw_group *g, bool values) {
  const uint64_t head[3] = {(uint64_t)g->type, g->n_vr, g->n};
  slw_tape_put(t, head, sizeof head);
  slw_tape_put(t, g->vr, g->n_vr * sizeof *g->vr);
  if (values) slw_tape_put_values(t, g);
}

static bool take_blob(slw_tape *t, slw_blob *b) {
  const volatile uint64_t *size = slw_tape_take(t, sizeof *size); /* read once: the other side may change it */
  const uint64_t n = size ? *size : 0;
  const char *data = size ? slw_tape_take(t, (size_t)n) : NULL;
  if (!data) return false;
  if (b->capacity < n + 1) {
    char *grown = realloc(b->data, (size_t)n + 1);
    if (!grown) return false;
    b->data = grown, b->capacity = (size_t)n + 1;
  }
  memcpy(b->data, data, (size_t)n);
  b->data[n] = 0, b->size = (size_t)n;
  return true;
}

bool slw_tape_take_values(slw_tape *t, const slw_group *g) {
  if (g->blobs) {
    for (size_t i = 0; i < g->n; i++)
      if (!take_blob(t, &g->blobs[g->cells[i].integer])) return false;
    return true;
  }
  const slw_cell *cells = slw_tape_take(t, g->n * sizeof *cells);
  if (!cells) return false;
  memcpy(g->cells, cells, g->n * sizeof *cells);
  return true;
}
