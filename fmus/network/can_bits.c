#include "can_bits.h"

enum { CRC_BITS = 15, CRC_POLYNOMIAL = 0x4599, SAME_BITS = 5, AFTER_CRC = 1 + 2 + 7 /* delimiter, ack, end */ };

/* Bits as they come: their number with stuff bits, and the CRC over them without. */
typedef struct {
  int64_t count;
  int last, run;
  uint32_t crc;
} Line;

static void bit(Line *line, int value) {
  line->run = value == line->last ? line->run + 1 : 1;
  line->last = value;
  line->count++;
  if (line->run == SAME_BITS) { /* a bit of the other value follows, which counts as the first of its run */
    line->last = !value, line->run = 1;
    line->count++;
  }
}

static void bits(Line *line, uint32_t value, int n) {
  for (int i = n - 1; i >= 0; i--) {
    const int one = value >> i & 1;
    const uint32_t feedback = (line->crc >> (CRC_BITS - 1) ^ (uint32_t)one) & 1;
    line->crc = (line->crc << 1 & 0x7fff) ^ (feedback ? CRC_POLYNOMIAL : 0);
    bit(line, one);
  }
}

int64_t nw_frame_bits(const NwFrame *f) {
  Line line = {0, -1, 0, 0};
  bits(&line, 0, 1); /* start of frame */
  if (f->extended) {
    bits(&line, f->identifier >> 18, 11);
    bits(&line, 3, 2); /* SRR, IDE */
    bits(&line, f->identifier & 0x3ffff, 18);
    bits(&line, f->remote, 1);
    bits(&line, 0, 2); /* r1, r0 */
  } else {
    bits(&line, f->identifier, 11);
    bits(&line, f->remote, 1);
    bits(&line, 0, 2); /* IDE, r0 */
  }
  bits(&line, f->length, 4);
  for (int i = 0; i < f->length && !f->remote; i++) bits(&line, f->data[i], 8);
  const uint32_t crc = line.crc;
  for (int i = CRC_BITS - 1; i >= 0; i--) bit(&line, (int)(crc >> i & 1));
  return line.count + AFTER_CRC;
}

uint64_t nw_arbitration(const NwFrame *f) {
  if (!f->extended) return (uint64_t)f->identifier << 21 | (uint64_t)f->remote << 20;
  return (uint64_t)(f->identifier >> 18) << 21 | (uint64_t)3 << 19 | (uint64_t)(f->identifier & 0x3ffff) << 1 | f->remote;
}
