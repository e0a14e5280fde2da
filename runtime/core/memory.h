/* Cells and queues in shared memory, as runtime/shared.py and runtime/ring.py have them: one end of each, in C.
 *
 * Nobody waits for anybody.  What is torn is seen by its CRC-32, whatever the order of the processor's stores.
 */
#ifndef SLR_MEMORY_H
#define SLR_MEMORY_H

#include <stddef.h>

#include "scan_layout.h"

typedef struct {
  const void *at;
  size_t bytes;
} SlrPart;

/* CRC-32 as zlib has it, going on from `value`. */
uint32_t slr_crc32(uint32_t value, const void *data, size_t bytes);
/* Makes the tables that slr_crc32 works with; once, before the first call. */
void slr_memory_prepare(void);

/* How many states were written; 0: none. */
int64_t slr_cell_number(const SlrCellEnd *cell);
/* Makes parts that together have the cell's size its current state; a cell has one writer. */
void slr_cell_write(const SlrCellEnd *cell, const SlrPart *parts, int count);
/* The number of the current state, which is then in `into`; 0: there is none, or none was had in a few tries. */
int64_t slr_cell_read(const SlrCellEnd *cell, void *into);

/* The current state where it lies: for a look that is taken back if the number has changed meanwhile. */
const void *slr_cell_peek(const SlrCellEnd *cell);

/* Appends an entry made of parts; 0, and counted, if there is no room. */
int slr_ring_put(const SlrRingEnd *ring, uint32_t kind, const SlrPart *parts, int count);
int64_t slr_ring_lost(const SlrRingEnd *ring);
int64_t slr_ring_beat(const SlrRingEnd *ring);
int64_t slr_ring_note(const SlrRingEnd *ring);

#endif
