/* A CAN bus between nodes: bit rate, arbitration by identifier, delay, and faults.
 *
 * A frame is on the wire for as many bits as it has, stuff bits included; then the others have it and the sender is
 * told (confirm). Of frames that wait when the wire is free the one with the smallest identifier goes, also of one
 * node's; equal ones as they came. Those of other nodes wait, or are given back (arbitration lost), as the node asks.
 * Faults in a window of time, of one identifier or of all: a frame is spoiled (bus error; it is sent again, or given
 * up by a node that discards), or nobody receives it although the sender is told that it was sent. */
#include "network.h"

#include <stdio.h>
#include <string.h>

#include "can_bits.h"

static double parameter(const NwNode *n, int place) { return n->value[place]; }

static int fail(NwNode *n, const char *what, int port, long long a, long long b) {
  snprintf(n->message, sizeof n->message, what, port + 1, a, b);
  return 0;
}

static int64_t duration(const NwNode *n, int64_t bits) { return bits * 1000000000 / n->own.rate; }

/* splitmix64: a number from 0 to below 1. */
static double uniform(NwState *s) {
  uint64_t z = s->random += 0x9e3779b97f4a7c15u;
  z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
  z = (z ^ z >> 27) * 0x94d049bb133111ebu;
  return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

void nw_start(NwNode *n) {
  n->own.sender = -1;
  n->own.rate = (int64_t)parameter(n, NW_bit_rate);
  n->own.random = (uint64_t)parameter(n, NW_seed);
}

/* ---- what nodes say ---- */

static int configure(NwNode *n, int port, const NwOperation *o) {
  uint32_t kind, value;
  BusNode *node = &n->own.node[port];
  if (!nw_read_number(o, 0, 1, &kind)) return nw_put_format_error(&n->port[port].sent, o), 1;
  if (kind == NW_CAN_BAUDRATE && nw_read_number(o, 1, 4, &value)) {
    node->baudrate = value;
    if ((int64_t)value == n->own.rate) return 1;
    return fail(n, "node %d is set to %lld bit/s, the bus to %lld bit/s", port, (long long)value, n->own.rate);
  }
  if (kind == NW_ARBITRATION_BEHAVIOUR && nw_read_number(o, 1, 1, &value))
    node->discards = value == NW_DISCARD_AND_NOTIFY;
  return 1;
}

static int enqueue(NwNode *n, int port, const NwOperation *o) {
  BusNode *node = &n->own.node[port];
  BusQueued entry = {.since = n->now};
  if (!nw_read_transmit(o, &entry.frame)) return nw_put_format_error(&n->port[port].sent, o), 1;
  if (node->off) return 1;
  if (node->queued == BUS_QUEUE) n->value[NW_overflows] += 1.0; /* as of a node whose queue is full */
  else node->queue[node->queued++] = entry;
  return 1;
}

static int take(NwNode *n, int port, const NwOperation *o) {
  uint32_t status;
  switch (o->code) {
    case NW_CAN_TRANSMIT: return enqueue(n, port, o);
    case NW_CONFIGURATION: return configure(n, port, o);
    case NW_STATUS:
      if (nw_read_number(o, 0, 1, &status)) n->own.node[port].off = status == NW_BUS_OFF;
      return 1;
    case NW_WAKEUP:
      for (int k = 0; k < NW_PORTS; k++)
        if (k != port) nw_put_wakeup(&n->port[k].sent);
      return 1;
    case NW_FORMAT_ERROR: return 1;
    default: nw_put_format_error(&n->port[port].sent, o); return 1;
  }
}

int nw_receive(NwNode *n, int port) {
  const NwBuffer *received = &n->port[port].received;
  NwOperation o;
  uint32_t at = 0;
  for (int found; (found = nw_next(received->data, received->size, &at, &o)) != 0;) {
    if (found < 0) nw_put_format_error(&n->port[port].sent, &o);
    else if (!take(n, port, &o)) return 0;
  }
  return 1;
}

/* ---- the wire ---- */

static void drop_from_queue(BusNode *node, int place) {
  node->queued--;
  memmove(&node->queue[place], &node->queue[place + 1], (size_t)(node->queued - place) * sizeof node->queue[0]);
}

/* The first in `node`'s queue of those that came until `t` with the smallest identifier; -1: none. */
static int foremost(const BusNode *node, int64_t t) {
  int found = -1;
  for (int i = 0; i < node->queued; i++)
    if (node->queue[i].since <= t &&
        (found < 0 || nw_arbitration(&node->queue[i].frame) < nw_arbitration(&node->queue[found].frame)))
      found = i;
  return found;
}

static int64_t first_waiting(const NwState *s) {
  int64_t first = INT64_MAX;
  for (int k = 0; k < NW_PORTS; k++)
    for (int i = 0; i < s->node[k].queued; i++)
      if (s->node[k].queue[i].since < first) first = s->node[k].queue[i].since;
  return first;
}

/* Everything that waits for one of the other nodes, and is not to be kept. */
static void give_back(NwNode *n, int winner, int64_t t) {
  for (int k = 0; k < NW_PORTS; k++) {
    BusNode *node = &n->own.node[k];
    for (int i; k != winner && node->discards && (i = foremost(node, t)) >= 0;) {
      nw_put_identifier(&n->port[k].sent, NW_ARBITRATION_LOST, node->queue[i].frame.identifier);
      drop_from_queue(node, i);
      n->value[NW_arbitrations_lost] += 1.0;
    }
  }
}

static void send_at(NwNode *n, int64_t t) {
  NwState *s = &n->own;
  uint64_t least = UINT64_MAX;
  for (int k = 0; k < NW_PORTS; k++) {
    const int i = foremost(&s->node[k], t);
    const uint64_t key = i < 0 ? UINT64_MAX : nw_arbitration(&s->node[k].queue[i].frame);
    if (key < least) least = key, s->sender = k, s->place = i;
  }
  s->begun = t;
  s->ends = t + duration(n, nw_frame_bits(&s->node[s->sender].queue[s->place].frame));
  give_back(n, s->sender, t);
}

static int chosen(NwNode *n, const NwFrame *frame, double probability) {
  const double drawn = uniform(&n->own), t = 1e-9 * (double)n->own.ends;
  const uint32_t identifier = (uint32_t)parameter(n, NW_fault_identifier);
  return drawn < probability && t >= parameter(n, NW_fault_from) && t < parameter(n, NW_fault_until) &&
         (identifier == 0 || identifier == frame->identifier);
}

static void spoil(NwNode *n, const NwFrame *frame) {
  NwState *s = &n->own;
  for (int k = 0; k < NW_PORTS; k++) {
    const int sender = k == s->sender;
    nw_put_bus_error(&n->port[k].sent, frame->identifier, NW_CRC_ERROR, sender ? NW_SECONDARY : NW_PRIMARY,
                     (uint8_t)sender);
  }
  if (s->node[s->sender].discards) drop_from_queue(&s->node[s->sender], s->place);
  n->value[NW_errors] += 1.0;
  s->idle = s->ends + duration(n, NW_ERROR_FRAME + NW_INTERMISSION);
}

static int alone(const NwState *s) {
  for (int k = 0; k < NW_PORTS; k++)
    if (k != s->sender && !s->node[k].off) return 0;
  return 1;
}

static int deliver(NwNode *n, const NwFrame *frame, int64_t since) {
  NwState *s = &n->own;
  const double took = 1e-9 * (double)(s->ends - since);
  if (s->n_flying == BUS_FLYING) return fail(n, "%d: more than %lld frames are on their way", -1, BUS_FLYING, 0);
  s->flying[s->n_flying++] =
      (BusFlying){.frame = *frame, .from = s->sender, .at = s->ends + (int64_t)(1e9 * parameter(n, NW_delay) + 0.5)};
  n->value[NW_frames] += 1.0;
  if (took > n->value[NW_longest_wait]) n->value[NW_longest_wait] = took;
  return 1;
}

/* The end of the frame on the wire. */
static int finish(NwNode *n) {
  NwState *s = &n->own;
  BusNode *node = &s->node[s->sender];
  const BusQueued entry = node->queue[s->place];
  const int spoiled = chosen(n, &entry.frame, parameter(n, NW_error_probability));
  const int dropped = chosen(n, &entry.frame, parameter(n, NW_drop_probability));
  s->idle = s->ends + duration(n, NW_INTERMISSION);
  s->busy += s->ends - s->begun;
  if (spoiled) {
    spoil(n, &entry.frame);
  } else {
    drop_from_queue(node, s->place);
    if (!alone(s)) nw_put_identifier(&n->port[s->sender].sent, NW_CONFIRM, entry.frame.identifier);
    if (dropped) n->value[NW_dropped] += 1.0;
    else if (!deliver(n, &entry.frame, entry.since)) return 0;
  }
  s->sender = -1;
  return 1;
}

/* Frames that have arrived by `until`, in the order in which they were sent. */
static void land(NwNode *n, int64_t until) {
  NwState *s = &n->own;
  int kept = 0;
  for (int i = 0; i < s->n_flying; i++) {
    const BusFlying one = s->flying[i];
    if (one.at > until) {
      s->flying[kept++] = one;
      continue;
    }
    for (int k = 0; k < NW_PORTS; k++)
      if (k != one.from && !s->node[k].off) nw_put_transmit(&n->port[k].sent, &one.frame);
  }
  s->n_flying = kept;
}

int nw_step(NwNode *n, int64_t until) {
  NwState *s = &n->own;
  for (;;) {
    if (s->sender >= 0) {
      if (s->ends > until) break;
      if (!finish(n)) return 0;
    }
    const int64_t first = first_waiting(s), t = s->idle > first ? s->idle : first;
    if (first == INT64_MAX || t >= until) break; /* others may still come at the end of the step */
    send_at(n, t);
  }
  land(n, until);
  n->value[NW_load] = (double)s->busy / (double)until;
  return 1;
}
