/* The control core as a node of the bus: what the runtime does every 20 ms, with frames as operations.
 *
 * With `plain` nothing goes over the bus: the FMU's signals pass the same frames inside of it, to and fro, as over a
 * bus that takes no time (`late`: those to the controller come a cycle later). */
#include <string.h>

#include "ends.h"
#include "slr.h"

static SlrState *core(NwNode *n) { return (SlrState *)(void *)n->own.core; }

void nw_start(NwNode *n) {
  slr_wire_reset(&n->own.wire);
  slr_reset(core(n));
  peer_reset(n->own.peer);
  if (n->value[NW_plain] != 0.0) return;
  nw_put_baudrate(&n->port[0].sent, (uint32_t)n->value[NW_bit_rate]);
  nw_put_behaviour(&n->port[0].sent, NW_BUFFER_AND_RETRANSMIT);
}

static void keep(NwNode *n, const NwFrame *frame, int64_t stamp) {
  NwState *s = &n->own;
  if (s->count == INBOX) return; /* as a controller whose queue is full: the frame is lost */
  SlrFrame *to = &s->inbox[s->count++];
  memset(to, 0, sizeof *to);
  to->identifier = frame->identifier | (frame->extended ? SLR_WIRE_EXTENDED : 0) | (frame->remote ? SLR_WIRE_REMOTE : 0);
  to->length = frame->length;
  to->stamp = stamp;
  memcpy(to->data, frame->data, sizeof to->data);
}

/* From what came to what goes. */
static int cycle(NwNode *n, int64_t now, NwFrame *frames) {
  NwState *s = &n->own;
  SlrInput in;
  SlrOutput out;
  SlrFrame sent[SLR_WIRE_OUT_MESSAGES];
  memset(&in, 0, sizeof in);
  slr_wire_receive(&s->wire, s->inbox, (int)s->count, s->cycle, now, &in);
  s->count = 0;
  in.tick = s->cycle, in.flags = (uint32_t)s->wire.flags;
  slr_step(&in, core(n), s->cycle, &out);
  ends_tell(n, out.value);
  const int count = slr_wire_send(&s->wire, &out, s->cycle, sent);
  for (int i = 0; i < count; i++) {
    frames[i] = (NwFrame){.identifier = sent[i].identifier & SLR_WIRE_IDENTIFIER, .extended = 1,
                          .length = sent[i].length};
    memcpy(frames[i].data, sent[i].data, sizeof frames[i].data);
  }
  return count;
}

static void gather(NwNode *n, int64_t now) {
  double value[SLR_IN_COUNT];
  NwFrame frames[PEER_FRAMES];
  ends_gather(n, n->own.cycle, ends_lost(n, n->own.peer), value);
  const int count = peer_send(n->own.peer, value, n->own.cycle, frames);
  for (int i = 0; i < count; i++) keep(n, &frames[i], now);
}

static void plain_cycle(NwNode *n, int64_t now) {
  NwFrame frames[PEER_FRAMES];
  const int late = n->value[NW_late] != 0.0;
  peer_receive(n->own.peer, 0, 0, n->own.cycle);
  if (!late) gather(n, now);
  const int count = cycle(n, now, frames);
  if (late) gather(n, now + ENDS_PERIOD_NS);
  peer_receive(n->own.peer, frames, count, n->own.cycle);
  ends_show(n, n->own.peer);
}

int nw_step(NwNode *n, int64_t until) {
  const int64_t phase = (int64_t)(1e9 * n->value[NW_cycle_phase] + 0.5);
  for (int64_t now; (now = n->own.cycle * ENDS_PERIOD_NS + phase) < until; n->own.cycle++) {
    NwFrame frames[PEER_FRAMES];
    if (n->value[NW_plain] != 0.0) {
      plain_cycle(n, now);
      continue;
    }
    const int count = cycle(n, now, frames);
    for (int i = 0; i < count; i++) nw_put_transmit(&n->port[0].sent, &frames[i]);
  }
  return 1;
}

int nw_receive(NwNode *n, int port) {
  const NwBuffer *received = &n->port[port].received;
  NwFrame frame;
  uint32_t at = 0;
  while (nw_next_frame(received, &at, &n->value[NW_bus_errors], &frame)) keep(n, &frame, n->now);
  return 1;
}
