/* See ring.h. */
#if !defined(_WIN32) && !defined(_GNU_SOURCE)
#define _POSIX_C_SOURCE 200809L
#endif
#include "ring.h"

#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <windows.h>
#else
#include <time.h>
#endif

#define SHORTEST_US 50
#define LONGEST_US 2000

static void sleep_us(long us) {
#ifdef _WIN32
  Sleep((DWORD)((us + 999) / 1000));
#else
  const struct timespec pause = {.tv_sec = 0, .tv_nsec = us * 1000};
  nanosleep(&pause, NULL);
#endif
}

/* Sleeps twice as long each time: a short wait is noticed soon, a long one costs nothing. */
static long sleep_and_double(long us) {
  sleep_us(us);
  return us * 2 < LONGEST_US ? us * 2 : LONGEST_US;
}

static size_t power_of_two(size_t least) {
  size_t power = 1;
  while (power < least && power <= SIZE_MAX / 2) power *= 2;
  return power;
}

bool slw_ring_open(slw_ring *ring, size_t width, size_t rows) {
  const size_t room = power_of_two(rows);
  memset(ring, 0, sizeof *ring);
  if (!width || !rows || room > SIZE_MAX / sizeof(slw_cell) / width) return false;
  ring->cells = malloc(room * width * sizeof *ring->cells);
  if (!ring->cells) return false;
  memset(ring->cells, 0, room * width * sizeof *ring->cells); /* so that no step meets a missing page */
  ring->width = width;
  ring->rows = ring->room_until = room;
  return true;
}

void slw_ring_close(slw_ring *ring) {
  free(ring->cells);
  memset(ring, 0, sizeof *ring);
}

slw_cell *slw_ring_wait_row(slw_ring *ring) {
  slw_cell *row = slw_ring_row(ring);
  if (row) return row;
  ring->waits++;
  for (long us = SHORTEST_US; !row; row = slw_ring_row(ring)) us = sleep_and_double(us);
  return row;
}

void slw_ring_finish(slw_ring *ring, bool finished) {
  atomic_store_explicit(&ring->finished, finished, memory_order_release);
}

/* Rows that can be taken.  `finished` is read first: whoever sees it sees the last row, too. */
static size_t ready(slw_ring *ring, bool *finished) {
  *finished = atomic_load_explicit(&ring->finished, memory_order_acquire);
  return atomic_load_explicit(&ring->written, memory_order_acquire) -
         atomic_load_explicit(&ring->taken, memory_order_relaxed);
}

static size_t wait_for(slw_ring *ring, size_t at_least, long wait_us) {
  bool finished;
  size_t n = ready(ring, &finished);
  for (long us = SHORTEST_US; n < at_least && !finished && wait_us > 0; n = ready(ring, &finished)) {
    if (us > wait_us) us = wait_us;
    wait_us -= us;
    us = sleep_and_double(us);
  }
  return n;
}

/* Rows first ... first + n - 1 of those ever written, which may go around the end of the ring. */
static void copy_rows(const slw_ring *ring, size_t first, size_t n, slw_cell *rows) {
  const size_t start = first & (ring->rows - 1);
  const size_t straight = n < ring->rows - start ? n : ring->rows - start;
  memcpy(rows, ring->cells + start * ring->width, straight * ring->width * sizeof *rows);
  memcpy(rows + straight * ring->width, ring->cells, (n - straight) * ring->width * sizeof *rows);
}

size_t slw_ring_take(slw_ring *ring, slw_cell *rows, size_t at_least, size_t max, int wait_ms) {
  const size_t first = atomic_load_explicit(&ring->taken, memory_order_relaxed);
  const size_t half = ring->rows / 2, least = at_least < half ? at_least : half; /* or the producer waits */
  size_t n = wait_for(ring, least < max ? least : max, wait_ms * 1000L);
  if (n > max) n = max;
  copy_rows(ring, first, n, rows);
  atomic_store_explicit(&ring->taken, first + n, memory_order_release);
  return n;
}
