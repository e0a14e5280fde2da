/* How long a frame of classical CAN is on the wire, stuff bits of its very content included (ISO 11898-1). */
#ifndef NW_CAN_BITS_H
#define NW_CAN_BITS_H

#include "operations.h"

/* From the start of frame to the end of frame. */
int64_t nw_frame_bits(const NwFrame *frame);
/* Between frames; and what an error costs after the frame that it spoils: flags of two nodes, delimiter. */
enum { NW_INTERMISSION = 3, NW_ERROR_FRAME = 6 + 6 + 8 };
/* Who wins: the smaller key has the first dominant bit. */
uint64_t nw_arbitration(const NwFrame *frame);

#endif
