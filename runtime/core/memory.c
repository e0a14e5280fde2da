#include "memory.h"

#include <string.h>

/* ---- CRC-32: eight bytes at a time (Kounavis and Berry, ISCC 2005), for every tick sums up some 2 KiB ---- */

enum { AT_ONCE = 8 };
static uint32_t sums[AT_ONCE][256];

void slr_memory_prepare(void) {
  for (uint32_t i = 0; i < 256; i++) {
    uint32_t value = i;
    for (int bit = 0; bit < 8; bit++) value = value & 1 ? value >> 1 ^ UINT32_C(0xEDB88320) : value >> 1;
    sums[0][i] = value;
  }
  for (int k = 1; k < AT_ONCE; k++)
    for (int i = 0; i < 256; i++) sums[k][i] = sums[k - 1][i] >> 8 ^ sums[0][sums[k - 1][i] & 0xFF];
}

static uint32_t word(const uint8_t *at) {
  return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

uint32_t slr_crc32(uint32_t value, const void *data, size_t bytes) {
  const uint8_t *at = data;
  value = ~value;
  for (; bytes >= AT_ONCE; bytes -= AT_ONCE, at += AT_ONCE) {
    const uint32_t low = value ^ word(at), high = word(at + 4);
    value = sums[7][low & 0xFF] ^ sums[6][low >> 8 & 0xFF] ^ sums[5][low >> 16 & 0xFF] ^ sums[4][low >> 24] ^
            sums[3][high & 0xFF] ^ sums[2][high >> 8 & 0xFF] ^ sums[1][high >> 16 & 0xFF] ^ sums[0][high >> 24];
  }
  for (; bytes; bytes--) value = value >> 8 ^ sums[0][(value ^ *at++) & 0xFF];
  return ~value;
}

/* Words that another process sees.  What was written before them is written when they are. */
static uint64_t seen(const void *at) { return __atomic_load_n((const uint64_t *)at, __ATOMIC_ACQUIRE); }
static void show(void *at, uint64_t value) { __atomic_store_n((uint64_t *)at, value, __ATOMIC_RELEASE); }

/* ---- cells (runtime/shared.py) ---- */

enum { CELL_HEAD = 48, CURRENT = 40, SLOT_HEAD = 16, SLOTS = 4, TRIES = 4 };

static uint8_t *slot_of(const SlrCellEnd *cell, uint64_t number) {
  return (uint8_t *)cell->memory + CELL_HEAD + (int64_t)(number % SLOTS) * cell->stride;
}

int64_t slr_cell_number(const SlrCellEnd *cell) { return (int64_t)seen((uint8_t *)cell->memory + CURRENT); }

void slr_cell_write(const SlrCellEnd *cell, const SlrPart *parts, int count) {
  const uint64_t number = (uint64_t)slr_cell_number(cell) + 1;
  uint8_t *slot = slot_of(cell, number), *end = slot + SLOT_HEAD;
  uint32_t crc = (uint32_t)number;
  show(slot, 0); /* nobody takes the slot while it is filled */
  for (int i = 0; i < count; i++) {
    memcpy(end, parts[i].at, parts[i].bytes);
    crc = slr_crc32(crc, parts[i].at, parts[i].bytes);
    end += parts[i].bytes;
  }
  show(slot + 8, crc);
  show(slot, number);
  show((uint8_t *)cell->memory + CURRENT, number);
}

int64_t slr_cell_read(const SlrCellEnd *cell, void *into) {
  const size_t size = (size_t)cell->size;
  for (int i = 0; i < TRIES; i++) {
    const uint64_t number = (uint64_t)slr_cell_number(cell);
    if (!number) return 0;
    const uint8_t *slot = slot_of(cell, number);
    const uint64_t found = seen(slot), crc = seen(slot + 8);
    memcpy(into, slot + SLOT_HEAD, size);
    if (found == number && crc == slr_crc32((uint32_t)number, into, size)) return (int64_t)number;
  }
  return 0;
}

const void *slr_cell_peek(const SlrCellEnd *cell) {
  return slot_of(cell, (uint64_t)slr_cell_number(cell)) + SLOT_HEAD;
}

/* ---- queues (runtime/ring.py) ---- */

enum { LOST_AT = 2, HEAD_AT = 8, TAIL_AT = 16, BEAT_AT = 17, NOTE_AT = 18, ENTRY_HEAD = 16 };

static uint64_t *word_of(const SlrRingEnd *ring, int at) { return (uint64_t *)ring->words + at; }

static void fill(uint8_t *at, uint64_t bytes) {
  static const uint32_t filler[4] = {UINT32_MAX, UINT32_MAX, UINT32_MAX, 0};
  memcpy(at, filler, bytes < ENTRY_HEAD ? bytes : ENTRY_HEAD);
}

static void put_at(uint8_t *at, uint32_t length, uint32_t kind, const SlrPart *parts, int count) {
  uint8_t *end = at + ENTRY_HEAD;
  uint32_t crc = 0;
  for (int i = 0; i < count; i++) {
    memcpy(end, parts[i].at, parts[i].bytes);
    crc = slr_crc32(crc, parts[i].at, parts[i].bytes);
    end += parts[i].bytes;
  }
  const uint32_t head[4] = {length, crc, kind, 0};
  memcpy(at, head, sizeof head);
}

int slr_ring_put(const SlrRingEnd *ring, uint32_t kind, const SlrPart *parts, int count) {
  const uint64_t capacity = (uint64_t)ring->capacity, head = *word_of(ring, HEAD_AT), at = head % capacity;
  size_t length = 0;
  for (int i = 0; i < count; i++) length += parts[i].bytes;
  const uint64_t whole = ENTRY_HEAD + ((length + 7) & ~(size_t)7);
  const uint64_t skip = at + whole > capacity ? capacity - at : 0; /* an entry is not split: it begins anew */
  if (head - seen(word_of(ring, TAIL_AT)) + skip + whole > capacity) {
    *word_of(ring, LOST_AT) += 1;
    return 0;
  }
  uint8_t *data = ring->data;
  if (skip) fill(data + at, skip);
  put_at(data + (skip ? 0 : at), (uint32_t)length, kind, parts, count);
  show(word_of(ring, HEAD_AT), head + skip + whole);
  return 1;
}

int64_t slr_ring_lost(const SlrRingEnd *ring) { return (int64_t)*word_of(ring, LOST_AT); }
int64_t slr_ring_beat(const SlrRingEnd *ring) { return (int64_t)seen(word_of(ring, BEAT_AT)); }
int64_t slr_ring_note(const SlrRingEnd *ring) { return (int64_t)seen(word_of(ring, NOTE_AT)); }
