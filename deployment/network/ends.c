#include "ends.h"

enum { COUNTS = 251 };

typedef struct {
  int variable, signal;
} Place;

#define ENTRY(name, vr, group, min, max, timeout, start) {min, max, start},
static const double signals[SLR_IN_COUNT][3] = {SLR_INPUT_SIGNALS(ENTRY)};
static const Place inputs[] = ENDS_INPUTS, outputs[] = ENDS_OUTPUTS;
static const int commands[] = ENDS_COMMANDS;

#define COUNT(list) (int)(sizeof list / sizeof list[0])
#define CALM(name, x) value[SLR_IN_##name] = x;
#define BEAT(name, every) value[SLR_IN_##name] = (double)(beat / every % COUNTS);

/* A sensor's field ends where its range does; what is no number stays so. */
static double within(double x, const double range[3]) {
  if (x < range[0]) return range[0];
  return x > range[1] ? range[1] : x;
}

void ends_gather(const NwNode *node, int64_t beat, int lost, double value[SLR_IN_COUNT]) {
  for (int i = 0; i < SLR_IN_COUNT; i++) value[i] = signals[i][2];
  ENDS_CALM(CALM)
  ENDS_BEATS(BEAT)
  value[SLR_IN_machine_fault] = lost ? ENDS_COMMAND_TIMEOUT : 0.0;
  value[SLR_IN_operator_enable] = beat >= ENDS_ENABLE_BEAT;
  value[SLR_IN_automatic_request] = beat >= ENDS_REQUEST_BEAT;
  for (int i = 0; i < COUNT(inputs); i++)
    value[inputs[i].signal] = within(node->value[inputs[i].variable], signals[inputs[i].signal]);
}

static int followed(const void *peer) {
  for (int i = 0; i < COUNT(commands); i++)
    if (!peer_right(peer, commands[i])) return 0;
  return peer_right(peer, SLR_OUT_control_enable) && peer_value(peer, SLR_OUT_control_enable) == 1.0;
}

void ends_show(NwNode *node, const void *peer) {
  const int follow = followed(peer);
  for (int i = 0; i < COUNT(outputs); i++) node->value[outputs[i].variable] = peer_value(peer, outputs[i].signal);
  for (int i = 0; i < COUNT(outputs); i++)
    for (int k = 0; k < COUNT(commands) && !follow; k++)
      if (outputs[i].signal == commands[k]) node->value[outputs[i].variable] = 0.0;
  if (follow) node->own.followed = 1;
}

void ends_tell(NwNode *node, const double value[SLR_OUT_COUNT]) {
  for (int i = 0; i < COUNT(outputs); i++) node->value[outputs[i].variable] = value[outputs[i].signal];
}

int ends_lost(const NwNode *node, const void *peer) {
  return node->own.followed && !peer_right(peer, SLR_OUT_control_enable);
}
