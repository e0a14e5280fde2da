/* Rows of cells from one producing thread to one consuming thread, without a lock.
 *
 * The producer's side costs a step two additions and one atomic store: it never signals.  The consumer
 * looks by itself, asleep in between.  A full ring makes the producer wait, which is counted: nothing is
 * ever dropped. */
#ifndef SLW_RING_H
#define SLW_RING_H

#include <stdatomic.h>

#include "fmu.h"

#define SLW_LINE_OF_CACHE 64

typedef struct {
  slw_cell *cells;
  size_t width, rows;        /* cells a row; rows: a power of two */
  char apart_0[SLW_LINE_OF_CACHE];
  atomic_size_t written;     /* rows ever committed: the producer's */
  size_t room_until;         /* the producer may write rows below this one; looks again when it gets there */
  uint64_t waits;            /* times that it found the ring full */
  atomic_bool finished;      /* no row follows */
  char apart_1[SLW_LINE_OF_CACHE];
  atomic_size_t taken;       /* rows ever taken: the consumer's */
} slw_ring;

/* Room for at least `rows` rows of `width` cells; false without memory or for a size of 0. */
bool slw_ring_open(slw_ring *ring, size_t width, size_t rows);
void slw_ring_close(slw_ring *ring);

/* Producer: the place of the next row, or NULL while the ring is full. */
static inline slw_cell *slw_ring_row(slw_ring *ring) {
  const size_t row = atomic_load_explicit(&ring->written, memory_order_relaxed);
  if (row == ring->room_until) {
    ring->room_until = atomic_load_explicit(&ring->taken, memory_order_acquire) + ring->rows;
    if (row == ring->room_until) return NULL;
  }
  return ring->cells + (row & (ring->rows - 1)) * ring->width;
}

/* Producer: how many rows from the next one on may be written one behind the other without looking again. */
static inline size_t slw_ring_straight(const slw_ring *ring) {
  const size_t row = atomic_load_explicit(&ring->written, memory_order_relaxed);
  const size_t room = ring->room_until - row, straight = ring->rows - (row & (ring->rows - 1));
  return room < straight ? room : straight;
}

/* Producer: the row is filled; from now on it is the consumer's. */
static inline void slw_ring_commit(slw_ring *ring) {
  const size_t row = atomic_load_explicit(&ring->written, memory_order_relaxed);
  atomic_store_explicit(&ring->written, row + 1, memory_order_release);
}

/* Producer: slw_ring_row that waits for room. */
slw_cell *slw_ring_wait_row(slw_ring *ring);

/* Producer: no row follows, so that the consumer need not wait for more; false: that was not the end. */
void slw_ring_finish(slw_ring *ring, bool finished);

/* Consumer: at most `max` rows into `rows`, oldest first; waits up to about `wait_ms` for `at_least` (or half
 * a ring), less if the producer has finished.  Returns how many. */
size_t slw_ring_take(slw_ring *ring, slw_cell *rows, size_t at_least, size_t max, int wait_ms);

#endif
