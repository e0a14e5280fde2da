/* The producer's side of a ring, which is inline, for a test through ctypes. */
#include "fault.h"
#include "ring.h"

#include <stdlib.h>

slw_ring *probe_new(size_t width, size_t rows);
void probe_free(slw_ring *ring);
void probe_fill(slw_ring *ring, int64_t first, int64_t n);
bool probe_try(slw_ring *ring, int64_t number);
uint64_t probe_waits(const slw_ring *ring);
void probe_apply(const slw_fault *fault, int64_t first, size_t n, const double *x, double *y);
void probe_pass(slw_fault *fault, int64_t first, size_t n, int calls, const double *x, double *y);

slw_ring *probe_new(size_t width, size_t rows) {
  slw_ring *ring = calloc(1, sizeof *ring);
  if (ring && slw_ring_open(ring, width, rows)) return ring;
  free(ring);
  return NULL;
}

void probe_free(slw_ring *ring) {
  slw_ring_close(ring);
  free(ring);
}

static void write_row(slw_ring *ring, slw_cell *row, int64_t number) {
  for (size_t i = 0; i < ring->width; i++) row[i].integer = number * (int64_t)ring->width + (int64_t)i;
  slw_ring_commit(ring);
}

/* Rows first ... first + n - 1, each cell a number of its own; waits while the ring is full. */
void probe_fill(slw_ring *ring, int64_t first, int64_t n) {
  for (int64_t i = first; i < first + n; i++) {
    slw_cell *row = slw_ring_row(ring);
    write_row(ring, row ? row : slw_ring_wait_row(ring), i);
  }
}

bool probe_try(slw_ring *ring, int64_t number) {
  slw_cell *row = slw_ring_row(ring);
  if (row) write_row(ring, row, number);
  return row != NULL;
}

uint64_t probe_waits(const slw_ring *ring) { return ring->waits; }

/* n ticks of a fault, its memory untouched. */
void probe_apply(const slw_fault *fault, int64_t first, size_t n, const double *x, double *y) {
  for (size_t i = 0; i < n; i++) y[i] = slw_fault_apply(fault, first + (int64_t)i, x[i]);
}

/* n ticks as a run passes them, each step computed `calls` times, on other values but the last time. */
void probe_pass(slw_fault *fault, int64_t first, size_t n, int calls, const double *x, double *y) {
  for (size_t i = 0; i < n; i++) {
    const int64_t tick = first + (int64_t)i;
    for (int k = 1; k < calls; k++) slw_fault_apply(fault, tick, x[i] + k);
    y[i] = slw_fault_apply(fault, tick, x[i]);
    slw_fault_accept(fault, tick, x[i]);
  }
}
