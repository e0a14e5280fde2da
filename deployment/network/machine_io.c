/* The machine's end of the controller's bus: plain signals of a simulated machine into frames, and commands out.
 *
 * Every 20 ms the machine, its IMUs, operator and planner send what is due; commands are followed as soon as they
 * are there. */
#include "ends.h"

void nw_start(NwNode *n) {
  peer_reset(n->own.peer);
  nw_put_baudrate(&n->port[0].sent, (uint32_t)n->value[NW_bit_rate]);
  nw_put_behaviour(&n->port[0].sent, NW_BUFFER_AND_RETRANSMIT);
}

int nw_step(NwNode *n, int64_t until) {
  for (; n->own.beat * ENDS_PERIOD_NS < until; n->own.beat++) {
    double value[SLR_IN_COUNT];
    NwFrame frames[PEER_FRAMES];
    peer_receive(n->own.peer, 0, 0, n->own.beat);
    ends_show(n, n->own.peer);
    ends_gather(n, n->own.beat, ends_lost(n, n->own.peer), value);
    const int count = peer_send(n->own.peer, value, n->own.beat, frames);
    for (int i = 0; i < count; i++) nw_put_transmit(&n->port[0].sent, &frames[i]);
  }
  return 1;
}

int nw_receive(NwNode *n, int port) {
  const NwBuffer *received = &n->port[port].received;
  NwFrame frame;
  uint32_t at = 0;
  while (nw_next_frame(received, &at, &n->value[NW_bus_errors], &frame)) peer_receive(n->own.peer, &frame, 1, n->own.beat - 1);
  ends_show(n, n->own.peer);
  return 1;
}
