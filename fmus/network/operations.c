#include "operations.h"

#include <string.h>

/* ---- out ---- */

/* Room for an operation of `length` bytes, its head written; NULL: there is none. */
static uint8_t *begin(NwBuffer *b, uint32_t code, uint32_t length) {
  if (length > NW_ROOM - b->size) {
    b->overflowed++;
    return 0;
  }
  uint8_t *at = b->data + b->size;
  b->size += length;
  for (int i = 0; i < 4; i++) at[i] = (uint8_t)(code >> 8 * i), at[4 + i] = (uint8_t)(length >> 8 * i);
  return at + NW_HEADER;
}

static uint8_t *number(uint8_t *at, uint32_t value, int bytes) {
  for (int i = 0; i < bytes; i++) *at++ = (uint8_t)(value >> 8 * i);
  return at;
}

void nw_put_transmit(NwBuffer *b, const NwFrame *frame) {
  const uint32_t n = frame->remote ? 0 : frame->length;
  uint8_t *at = begin(b, NW_CAN_TRANSMIT, NW_HEADER + 8 + n);
  if (!at) return;
  at = number(at, frame->identifier, 4);
  *at++ = frame->extended, *at++ = frame->remote;
  at = number(at, n, 2);
  memcpy(at, frame->data, n);
}

void nw_put_identifier(NwBuffer *b, NwCode code, uint32_t identifier) {
  uint8_t *at = begin(b, code, NW_HEADER + 4);
  if (at) number(at, identifier, 4);
}

void nw_put_bus_error(NwBuffer *b, uint32_t identifier, uint8_t error, uint8_t flag, uint8_t is_sender) {
  uint8_t *at = begin(b, NW_BUS_ERROR, NW_HEADER + 7);
  if (!at) return;
  at = number(at, identifier, 4);
  *at++ = error, *at++ = flag, *at = is_sender;
}

void nw_put_baudrate(NwBuffer *b, uint32_t bits_per_s) {
  uint8_t *at = begin(b, NW_CONFIGURATION, NW_HEADER + 5);
  if (!at) return;
  *at++ = NW_CAN_BAUDRATE;
  number(at, bits_per_s, 4);
}

void nw_put_behaviour(NwBuffer *b, uint8_t behaviour) {
  uint8_t *at = begin(b, NW_CONFIGURATION, NW_HEADER + 2);
  if (!at) return;
  *at++ = NW_ARBITRATION_BEHAVIOUR, *at = behaviour;
}

void nw_put_wakeup(NwBuffer *b) { (void)begin(b, NW_WAKEUP, NW_HEADER); }

void nw_put_format_error(NwBuffer *b, const NwOperation *wrong) {
  const uint32_t n = wrong->length < 0xffff ? wrong->length : 0xffff;
  uint8_t *at = begin(b, NW_FORMAT_ERROR, NW_HEADER + 2 + n);
  if (at) memcpy(number(at, n, 2), wrong->bytes, n);
}

/* ---- in ---- */

static uint32_t read(const uint8_t *at, uint32_t bytes) {
  uint32_t value = 0;
  for (uint32_t i = 0; i < bytes; i++) value |= (uint32_t)at[i] << 8 * i;
  return value;
}

int nw_next(const uint8_t *data, uint32_t size, uint32_t *at, NwOperation *o) {
  const uint32_t left = size - *at;
  *o = (NwOperation){0, left, data + *at};
  if (left == 0) return 0;
  *at = size;
  if (left < NW_HEADER) return -1;
  o->code = read(o->bytes, 4);
  const uint32_t length = read(o->bytes + 4, 4);
  if (length < NW_HEADER || length > left) return -1;
  o->length = length;
  *at = size - left + length;
  return 1;
}

int nw_read_number(const NwOperation *o, uint32_t at, uint32_t bytes, uint32_t *value) {
  if (o->length < NW_HEADER + at + bytes) return 0;
  *value = read(o->bytes + NW_HEADER + at, bytes);
  return 1;
}

int nw_read_transmit(const NwOperation *o, NwFrame *frame) {
  uint32_t n;
  if (!nw_read_number(o, 6, 2, &n) || n > NW_FRAME_BYTES || o->length != NW_HEADER + 8 + n) return 0;
  const uint8_t *at = o->bytes + NW_HEADER;
  memset(frame, 0, sizeof *frame);
  frame->identifier = read(at, 4), frame->extended = at[4] != 0, frame->remote = at[5] != 0;
  frame->length = (uint8_t)n;
  memcpy(frame->data, at + 8, n);
  return frame->identifier <= (frame->extended ? 0x1fffffffu : 0x7ffu);
}

int nw_next_frame(const NwBuffer *received, uint32_t *at, double *bus_errors, NwFrame *frame) {
  NwOperation o;
  while (nw_next(received->data, received->size, at, &o) > 0) {
    *bus_errors += o.code == NW_BUS_ERROR;
    if (o.code == NW_CAN_TRANSMIT && nw_read_transmit(&o, frame)) return 1;
  }
  return 0;
}
