#include "canopen.h"

#include <string.h>

enum { EMERGENCY = 0x080, HEARTBEAT = 0x700, SERVICE = 0x780, ID = 0x7F, OPERATIONAL = 5, BOOT_UP = 0, TOGGLE = 0x80 };

enum { DOUBT = 10, LEAK = 12, CREDIT = -60, TWO_SENDERS = 60, MOST_DOUBT = 100, LONG = 1000 };

typedef struct {
  int64_t id;
  int actuator;
} Device;

typedef struct {
  int node;
  uint32_t identifier;
  int length, first, fields;
} Pdo;

typedef struct {
  int place, start, bits, sign;
  int64_t zero;
  double scale, low, high;
  int taken_off;
} Field;

#define DEVICE(name, id, actuator) {id, actuator},
#define PDO(node, identifier, length, first, fields) {node, identifier, length, first, fields},
#define FIELD(name, place, start, bits, sign, zero, scale, low, high, taken_off) \
  {place, start, bits, sign, zero, scale, low, high, taken_off},
static const Device devices[] = {SLR_CANOPEN_NODE_TABLE(DEVICE)};
static const Pdo heard[] = {SLR_CANOPEN_IN_PDO_TABLE(PDO)};
static const Pdo said[] = {SLR_CANOPEN_OUT_PDO_TABLE(PDO)};
static const Field heard_fields[] = {SLR_CANOPEN_IN_FIELD_TABLE(FIELD)};
static const Field said_fields[] = {SLR_CANOPEN_OUT_FIELD_TABLE(FIELD)};

#define TIMEOUT(name, vr, group, min, max, timeout, start) timeout,
#define START(name, vr, group, min, max, timeout, start) start,
static const int32_t timeouts[SLR_IN_COUNT] = {SLR_INPUT_SIGNALS(TIMEOUT)};
static const double starts[SLR_IN_COUNT] = {SLR_INPUT_SIGNALS(START)};

static uint64_t mask(const Field *f) { return (UINT64_C(1) << f->bits) - 1; }

/* ---- devices ---- */

static int node_of(uint32_t identifier) {
  for (int n = 0; n < SLR_CANOPEN_NODES; n++)
    if (devices[n].id == (int64_t)(identifier & ID)) return n;
  return -1;
}

/* What a device was set to is not what it has any more, or nobody knows: it is to be accepted anew. */
static void forget(SlrCanopen *c, int n) { c->spent[n] = c->accepted[n]; }

static int lost(const SlrCanopen *c, int n, int64_t tick) {
  return c->beat[n] < 0 || tick - c->beat[n] >= SLR_CANOPEN_LOST;
}

static int usable(const SlrCanopen *c, int n, int64_t tick) {
  const int taken = c->accepted[n] != 0 && c->accepted[n] != c->spent[n];
  return taken && !lost(c, n, tick) && c->state[n] == OPERATIONAL;
}

static void hear_heartbeat(SlrCanopen *c, int n, const SlrFrame *frame, int64_t tick) {
  if (frame->length < 1) return;
  c->state[n] = frame->data[0] & ~TOGGLE;
  if (tick > c->beat[n]) c->beat[n] = tick; /* one that waited is no news where a device was just accepted */
  if (c->state[n] != BOOT_UP) return;
  c->error[n] = 0;
  forget(c, n);
}

/* Code 0: error reset, or no error. */
static void hear_emergency(SlrCanopen *c, int n, const SlrFrame *frame) {
  if (frame->length >= 3) c->error[n] = frame->data[0] | (int64_t)frame->data[1] << 8;
}

/* ---- in ---- */

static int64_t raw_of(const Field *f, uint64_t bits) {
  const uint64_t raw = bits >> f->start & mask(f);
  const uint64_t sign = UINT64_C(1) << (f->bits - 1);
  return f->sign && raw & sign ? (int64_t)raw - (int64_t)(sign << 1) : (int64_t)raw;
}

/* A device answers each SYNC once, so two that send one PDO make two a tick.  Each PDO adds to the doubt, each tick
 * takes a little more away than one adds.  A device that is well has credit: answers that are late, and come with the
 * next ones, do no harm. */
static void doubt_after(SlrCanopen *c, int i, int64_t tick) {
  const int64_t gone = tick > c->heard[i] ? tick - c->heard[i] : 0;
  const int64_t left = gone < LONG ? c->doubt[i] - LEAK * gone : CREDIT;
  c->doubt[i] = (left > CREDIT ? left : CREDIT) + DOUBT;
  if (c->doubt[i] > MOST_DOUBT) c->doubt[i] = MOST_DOUBT;
  if (tick > c->heard[i]) c->heard[i] = tick;
}

/* What is longer than its mapping has its first bytes used, what is shorter nothing (CiA 301, 7.5.2.36). */
static void hear_pdo(SlrCanopen *c, const Pdo *pdo, const SlrFrame *frame, int64_t tick) {
  if (frame->length < pdo->length) {
    c->wrong += 1;
    return;
  }
  uint64_t bits = 0;
  for (int i = 0; i < pdo->length; i++) bits |= (uint64_t)frame->data[i] << 8 * i;
  for (int k = 0; k < pdo->fields; k++) {
    const Field *f = &heard_fields[pdo->first + k];
    c->value[f->place] = (double)(raw_of(f, bits) - f->zero) * f->scale;
    c->came[f->place] = tick;
    if (f->place == SLR_CANOPEN_TIMED_BY) c->stamp = frame->stamp;
  }
}

static int only_ours(uint32_t identifier) {
  for (int i = 0; i < SLR_CANOPEN_OUT_PDOS; i++)
    if (said[i].identifier == identifier) return 1;
  return identifier == SLR_CANOPEN_SYNC;
}

static void hear(SlrCanopen *c, const SlrFrame *frame, int64_t tick) {
  const uint32_t identifier = frame->identifier & SLR_WIRE_IDENTIFIER, service = identifier & SERVICE;
  const int n = node_of(identifier);
  c->ours += only_ours(identifier);
  if (n >= 0 && service == HEARTBEAT) hear_heartbeat(c, n, frame, tick);
  if (n >= 0 && service == EMERGENCY) hear_emergency(c, n, frame);
  for (int i = 0; i < SLR_CANOPEN_IN_PDOS; i++)
    if (heard[i].identifier == identifier) {
      doubt_after(c, i, tick);
      hear_pdo(c, &heard[i], frame, tick);
    }
}

static void take(SlrCanopen *c, const SlrFrame *frame, int64_t tick, int64_t now) {
  if (frame->identifier & SLR_WIRE_ERROR) {
    slr_bus_error(&c->bus, frame);
    return;
  }
  c->bus.off = 0;
  if (frame->identifier & (SLR_WIRE_REMOTE | SLR_WIRE_EXTENDED)) return;
  const int64_t waited = now > frame->stamp ? (now - frame->stamp) / SLR_WIRE_PERIOD_NS : 0;
  hear(c, frame, tick - waited); /* what waited is as old as it is */
}

static uint8_t status_of(const SlrCanopen *c, int i, const Field *f, int64_t tick, double value) {
  const int n = heard[i].node;
  if (c->came[f->place] < 0) return SLR_STATUS_NEVER;
  if (!usable(c, n, tick) || tick - c->came[f->place] >= timeouts[f->place]) return SLR_STATUS_TIMEOUT;
  if (c->doubt[i] >= TWO_SENDERS) return SLR_STATUS_TWO_SENDERS;
  if (c->error[n]) return SLR_STATUS_ERROR;
  return value >= f->low && value <= f->high ? SLR_STATUS_OK : SLR_STATUS_RANGE;
}

/* The core takes every sensor's zero off; where the device does that already, it is added here. */
static void fill(const SlrCanopen *c, int i, int64_t tick, SlrInput *in) {
  for (int k = 0; k < heard[i].fields; k++) {
    const Field *f = &heard_fields[heard[i].first + k];
    const double value = c->value[f->place] + (f->taken_off && c->came[f->place] >= 0 ? slr_zero[f->place] : 0.0);
    in->value[f->place] = value;
    in->age[f->place] = (int32_t)(c->came[f->place] < 0 ? -1 : tick - c->came[f->place]);
    in->status[f->place] = status_of(c, i, f, tick, value);
  }
}

/* A machine without one of its valves, or with one in error, is not ready, whatever it says itself. */
static void look_at_valves(const SlrCanopen *c, int64_t tick, SlrInput *in) {
  for (int n = 0; n < SLR_CANOPEN_NODES; n++)
    if (devices[n].actuator && (c->error[n] || !usable(c, n, tick))) in->value[SLR_CANOPEN_READY] = 0.0;
}

void slr_canopen_receive(SlrCanopen *c, const SlrFrame *frames, int count, int64_t tick, int64_t now, SlrInput *in) {
  c->bus.was_off = 0;
  for (int i = 0; i < count; i++) take(c, &frames[i], tick, now);
  for (int n = 0; n < SLR_CANOPEN_NODES; n++)
    if (lost(c, n, tick)) forget(c, n);
  c->flags = (c->bus.passive ? SLR_FLAG_BUS_PASSIVE : 0) | (c->bus.off || c->bus.was_off ? SLR_FLAG_BUS_OFF : 0);
  for (int i = 0; i < SLR_CANOPEN_IN_PDOS; i++) fill(c, i, tick, in);
  look_at_valves(c, tick, in);
}

/* ---- out ---- */

static int64_t nearest(double x) {
  const int64_t toward_zero = (int64_t)x;
  const double over = x - (double)toward_zero;
  return toward_zero + (over >= 0.5) - (over <= -0.5);
}

/* What is no number, or out of range, is sent as nothing: the valve's neutral, or its hold. */
static uint64_t bits_of(const Field *f, double value) {
  const double safe = value >= f->low && value <= f->high ? value : 0.0;
  return (uint64_t)(nearest(safe / f->scale) + f->zero) & mask(f);
}

static void begin(SlrFrame *frame, uint32_t identifier, int length) {
  memset(frame, 0, sizeof *frame);
  frame->identifier = identifier;
  frame->length = (uint8_t)length;
}

static void pack(const Pdo *pdo, const double *values, SlrFrame *frame) {
  uint64_t bits = 0;
  for (int k = 0; k < pdo->fields; k++) {
    const Field *f = &said_fields[pdo->first + k];
    bits |= bits_of(f, values[f->place]) << f->start;
  }
  begin(frame, pdo->identifier, pdo->length);
  for (int i = 0; i < pdo->length; i++) frame->data[i] = (uint8_t)(bits >> 8 * i);
}

int slr_canopen_send(const SlrCanopen *c, const SlrOutput *out, int64_t tick, SlrFrame *frames) {
  int found = 0;
  begin(&frames[found++], SLR_CANOPEN_SYNC, 0);
  for (int i = 0; i < SLR_CANOPEN_OUT_PDOS; i++)
    if (usable(c, said[i].node, tick)) pack(&said[i], out->value, &frames[found++]);
  return found;
}

/* ---- the rest ---- */

const char *slr_canopen_layout(void) { return SLR_CANOPEN_LAYOUT; }
size_t slr_canopen_size(void) { return sizeof(SlrCanopen); }

void slr_canopen_reset(SlrCanopen *c) {
  memset(c, 0, sizeof *c);
  memcpy(c->value, starts, sizeof c->value);
  for (int i = 0; i < SLR_IN_COUNT; i++) c->came[i] = -1;
  for (int n = 0; n < SLR_CANOPEN_NODES; n++) c->beat[n] = -1;
}
