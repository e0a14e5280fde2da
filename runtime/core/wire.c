#include "wire.h"

#include <string.h>

typedef struct {
  uint32_t identifier;
  int length;
  uint8_t begun; /* checksum over the data ID */
  int64_t every, phase; /* ticks */
  int first, fields;
} Message;

typedef struct {
  int place, start, bits;
  double scale, offset, low, high;
  uint32_t largest, error, absent;
} Field;

#define MESSAGE(name, identifier, length, begun, every, phase, first, fields) \
  {identifier, length, begun, every, phase, first, fields},
#define FIELD(name, place, start, bits, scale, offset, low, high, largest, error, absent) \
  {place, start, bits, scale, offset, low, high, largest, error, absent},
static const Message heard[] = {SLR_WIRE_IN_MESSAGE_TABLE(MESSAGE)};
static const Message said[] = {SLR_WIRE_OUT_MESSAGE_TABLE(MESSAGE)};
static const Field heard_fields[] = {SLR_WIRE_IN_FIELD_TABLE(FIELD)};
static const Field said_fields[] = {SLR_WIRE_OUT_FIELD_TABLE(FIELD)};
static const uint8_t crc[256] = SLR_WIRE_CRC;

#define TIMEOUT(name, vr, group, min, max, timeout, start) timeout,
#define START(name, vr, group, min, max, timeout, start) start,
static const int32_t timeouts[SLR_IN_COUNT] = {SLR_INPUT_SIGNALS(TIMEOUT)};
static const double starts[SLR_IN_COUNT] = {SLR_INPUT_SIGNALS(START)};

static uint8_t checksum(const Message *m, const uint8_t *data) {
  uint8_t value = m->begun;
  for (int i = 1; i < m->length; i++) value = crc[value ^ data[i]];
  return value;
}

static uint64_t mask(const Field *f) { return (UINT64_C(1) << f->bits) - 1; }

/* ---- in ---- */

static uint64_t bits_of(const Message *m, const uint8_t *data) {
  uint64_t bits = 0;
  for (int i = 0; i < m->length; i++) bits |= (uint64_t)data[i] << 8 * i;
  return bits;
}

static uint8_t decode(const Field *f, uint64_t raw, double *value) {
  *value = 0.0;
  if (raw >= f->absent && raw > f->largest) return SLR_STATUS_NOT_AVAILABLE;
  if (raw > f->largest) return raw >= f->error ? SLR_STATUS_ERROR : SLR_STATUS_RANGE;
  *value = (double)raw * f->scale + f->offset;
  return *value >= f->low && *value <= f->high ? SLR_STATUS_OK : SLR_STATUS_RANGE;
}

/* The counter of a frame; -1 if its length, checksum or counter are wrong. */
static int64_t count_of(const Message *m, const SlrFrame *frame) {
  if (frame->length != m->length || frame->data[0] != checksum(m, frame->data)) return -1;
  const int64_t count = frame->data[1] & 0x0F;
  return count <= SLR_WIRE_LAST_COUNT ? count : -1;
}

static int follows(const SlrWire *w, int i, int64_t count, int64_t tick) {
  if (w->count[i] < 0) return 1;
  const int64_t gone = (count - w->count[i] + SLR_WIRE_COUNTS) % SLR_WIRE_COUNTS;
  const int64_t missed = (tick > w->tick[i] ? tick - w->tick[i] : 0) / heard[i].every;
  return (gone >= 1 && gone <= 1 + SLR_WIRE_SPARE + missed) || missed >= SLR_WIRE_LAST_COUNT;
}

/* Two nodes send one message: their counters refuse each other again and again, with right frames between them or
 * with numbers that jump.  A node that starts anew, or a frame that came twice, makes one such refusal; a counter
 * that stands still makes one, too, and no right frame after it. */
static void doubt_after(SlrWire *w, int i, int64_t count) {
  if (w->fresh[i] || count != w->count[i])
    w->doubt[i] = w->doubt[i] + SLR_WIRE_DOUBT > SLR_WIRE_MOST_DOUBT ? SLR_WIRE_MOST_DOUBT
                                                                     : w->doubt[i] + SLR_WIRE_DOUBT;
  w->fresh[i] = 0;
}

static void refuse(SlrWire *w, int i, int64_t count) {
  w->wrong += 1;
  w->refused[i] += 1;
  if (count >= 0) {
    w->repeated[i] += count == w->count[i];
    doubt_after(w, i, count);
  }
  if (count >= 0) w->count[i] = count; /* a sender that started anew is believed from its second frame on */
  for (int k = 0; k < heard[i].fields; k++) {
    const int place = heard_fields[heard[i].first + k].place;
    if (w->came[place] >= 0) w->status[place] = SLR_STATUS_CHECKSUM;
  }
}

static void accept(SlrWire *w, int i, const SlrFrame *frame, int64_t tick) {
  const uint64_t bits = bits_of(&heard[i], frame->data);
  for (int k = 0; k < heard[i].fields; k++) {
    const Field *f = &heard_fields[heard[i].first + k];
    double value;
    const uint8_t status = decode(f, bits >> f->start & mask(f), &value);
    w->status[f->place] = status;
    w->came[f->place] = tick;
    if (status == SLR_STATUS_OK || status == SLR_STATUS_RANGE) w->value[f->place] = value;
  }
  w->tick[i] = tick;
  w->doubt[i] -= w->doubt[i] > 0;
  if (i == SLR_WIRE_TIMED_BY) w->stamp = frame->stamp;
}

static void hear(SlrWire *w, const SlrFrame *frame, int64_t tick) {
  for (int i = 0; i < SLR_WIRE_IN_MESSAGES; i++) {
    if (heard[i].identifier != (frame->identifier & SLR_WIRE_IDENTIFIER) || w->ignored[i]) continue;
    const int64_t count = count_of(&heard[i], frame);
    if (count < 0 || !follows(w, i, count, tick)) {
      refuse(w, i, count);
    } else {
      w->fresh[i] = count != w->count[i];
      w->count[i] = count;
      accept(w, i, frame, tick);
    }
    return;
  }
  for (int i = 0; i < SLR_WIRE_OUT_MESSAGES; i++)
    w->ours += said[i].identifier == (frame->identifier & SLR_WIRE_IDENTIFIER);
}

void slr_bus_error(SlrBus *bus, const SlrFrame *frame) {
  const uint8_t state = frame->length > 1 ? frame->data[1] : 0;
  if (frame->identifier & SLR_WIRE_BUS_OFF) {
    bus->off = bus->was_off = 1;
  } else if (frame->identifier & SLR_WIRE_RESTARTED) {
    bus->off = bus->passive = 0;
  } else if (frame->identifier & SLR_WIRE_CONTROLLER) {
    bus->lost += (state & SLR_WIRE_RX_OVERFLOW) != 0;
    if (state & (SLR_WIRE_PASSIVE | SLR_WIRE_ACTIVE)) bus->passive = (state & SLR_WIRE_ACTIVE) == 0;
  }
}

static void take(SlrWire *w, const SlrFrame *frame, int64_t tick, int64_t now) {
  if (frame->identifier & SLR_WIRE_ERROR) {
    slr_bus_error(&w->bus, frame);
    return;
  }
  w->bus.off = 0;
  if (frame->identifier & SLR_WIRE_REMOTE) {
    w->remote += 1;
    return;
  }
  const int64_t waited = now > frame->stamp ? (now - frame->stamp) / SLR_WIRE_PERIOD_NS : 0;
  if (frame->identifier & SLR_WIRE_EXTENDED) hear(w, frame, tick - waited); /* what waited is as old as it is */
}

/* What two nodes send is nobody's word: its values say so until one of them has been alone for a while. */
static void mark_doubted(const SlrWire *w, SlrInput *in) {
  for (int i = 0; i < SLR_WIRE_IN_MESSAGES; i++) {
    if (w->doubt[i] < SLR_WIRE_TWO_SENDERS || w->ignored[i]) continue;
    for (int k = 0; k < heard[i].fields; k++) {
      uint8_t *status = &in->status[heard_fields[heard[i].first + k].place];
      if (*status != SLR_STATUS_TIMEOUT) *status = SLR_STATUS_TWO_SENDERS;
    }
  }
}

static void fill(const SlrWire *w, int64_t tick, SlrInput *in) {
  memcpy(in->value, w->value, sizeof in->value);
  for (int i = 0; i < SLR_IN_COUNT; i++) {
    const int64_t age = w->came[i] < 0 ? -1 : tick - w->came[i];
    in->age[i] = (int32_t)age;
    in->status[i] = (uint8_t)(age >= timeouts[i] && w->came[i] >= 0 ? SLR_STATUS_TIMEOUT : w->status[i]);
  }
  mark_doubted(w, in);
}

void slr_wire_receive(SlrWire *w, const SlrFrame *frames, int count, int64_t tick, int64_t now, SlrInput *in) {
  w->bus.was_off = 0;
  for (int i = 0; i < count; i++) take(w, &frames[i], tick, now);
  w->flags = (w->bus.passive ? SLR_FLAG_BUS_PASSIVE : 0) | (w->bus.off || w->bus.was_off ? SLR_FLAG_BUS_OFF : 0);
  fill(w, tick, in);
}

/* ---- out ---- */

/* The nearest whole number to x >= -0.5, of two the even one. */
static uint64_t nearest(double x) {
  const uint64_t below = x > 0.0 ? (uint64_t)x : 0;
  const double over = x - (double)below;
  return below + (over > 0.5 || (over == 0.5 && (below & 1)));
}

static uint64_t raw_of(const Field *f, double value) {
  if (!(value >= f->low && value <= f->high)) return f->error; /* no number, or out of range */
  return nearest((value - f->offset) / f->scale);
}

static void pack(const Message *m, const double *values, int64_t count, SlrFrame *frame) {
  uint64_t bits = ~UINT64_C(0); /* what no field has is 1 */
  for (int k = 0; k < m->fields; k++) {
    const Field *f = &said_fields[m->first + k];
    bits ^= (mask(f) ^ raw_of(f, values[f->place])) << f->start;
  }
  memset(frame, 0, sizeof *frame);
  for (int i = 0; i < m->length; i++) frame->data[i] = (uint8_t)(bits >> 8 * i);
  frame->data[1] = (uint8_t)((frame->data[1] & 0xF0) | count);
  frame->data[0] = checksum(m, frame->data);
  frame->identifier = m->identifier | SLR_WIRE_EXTENDED;
  frame->length = (uint8_t)m->length;
}

int slr_wire_send(SlrWire *w, const SlrOutput *out, int64_t tick, SlrFrame *frames) {
  int found = 0;
  for (int i = 0; i < SLR_WIRE_OUT_MESSAGES; i++) {
    if (tick % said[i].every != said[i].phase) continue;
    pack(&said[i], out->value, w->next[i], &frames[found++]);
    w->next[i] = w->next[i] == SLR_WIRE_LAST_COUNT ? 0 : w->next[i] + 1;
  }
  return found;
}

/* ---- the rest ---- */

const char *slr_wire_layout(void) { return SLR_WIRE_LAYOUT; }
size_t slr_wire_size(void) { return sizeof(SlrWire); }

void slr_wire_reset(SlrWire *w) {
  memset(w, 0, sizeof *w);
  memcpy(w->value, starts, sizeof w->value);
  for (int i = 0; i < SLR_WIRE_IN_MESSAGES; i++) w->count[i] = w->tick[i] = -1;
  for (int i = 0; i < SLR_IN_COUNT; i++) w->came[i] = -1, w->status[i] = SLR_STATUS_NEVER;
}
