#include "peer.h"

/* wire.c, with names of its own: the controller's stands beside it. */
#define slr_wire_layout peer_wire_layout
#define slr_wire_size peer_wire_size
#define slr_wire_reset peer_wire_reset
#define slr_wire_receive peer_wire_receive
#define slr_wire_send peer_wire_send
#define slr_bus_error peer_bus_error
#include "peer/wire.c"

typedef struct {
  SlrWire wire;
  SlrInput heard;
} Peer;

_Static_assert(sizeof(Peer) <= 8 * PEER_WORDS, "PEER_WORDS is too small");
_Static_assert(SLR_WIRE_OUT_MESSAGES <= PEER_FRAMES, "PEER_FRAMES is too small");

void peer_reset(void *peer) {
  slr_wire_reset(&((Peer *)peer)->wire);
  peer_receive(peer, 0, 0, 0);
}

int peer_send(void *peer, const double *values, int64_t tick, NwFrame *frames) {
  SlrOutput out;
  SlrFrame found[SLR_WIRE_OUT_MESSAGES];
  memset(&out, 0, sizeof out);
  memcpy(out.value, values, sizeof out.value);
  const int count = slr_wire_send(&((Peer *)peer)->wire, &out, tick, found);
  for (int i = 0; i < count; i++) {
    frames[i] = (NwFrame){.identifier = found[i].identifier & SLR_WIRE_IDENTIFIER, .extended = 1,
                          .length = found[i].length};
    memcpy(frames[i].data, found[i].data, sizeof frames[i].data);
  }
  return count;
}

void peer_receive(void *peer, const NwFrame *frames, int count, int64_t tick) {
  Peer *p = peer;
  for (int i = 0; i < count; i++) {
    SlrFrame frame = {.identifier = frames[i].identifier | (frames[i].extended ? SLR_WIRE_EXTENDED : 0) |
                                    (frames[i].remote ? SLR_WIRE_REMOTE : 0),
                      .length = frames[i].length};
    memcpy(frame.data, frames[i].data, sizeof frame.data);
    slr_wire_receive(&p->wire, &frame, 1, tick, 0, &p->heard);
  }
  slr_wire_receive(&p->wire, 0, 0, tick, 0, &p->heard);
}

double peer_value(const void *peer, int output) { return ((const Peer *)peer)->heard.value[output]; }

int peer_right(const void *peer, int output) {
  const uint8_t status = ((const Peer *)peer)->heard.status[output];
  return status == SLR_STATUS_OK || status == SLR_STATUS_CHECKSUM;
}
