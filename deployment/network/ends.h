/* What both ends of the bus make of their FMU's plain signals: values around the controller, and commands followed. */
#ifndef ENDS_H
#define ENDS_H

#include "network.h"

#include "ends_config.h" /* generated: signals and their places, everybody's calm values and heartbeats */
#include "image_layout.h"
#include "peer.h"

/* Every input of the controller at `beat` (of 20 ms, from 0 on): sensors and targets as the FMU has them, kept in
 * their ranges; operator, machine and planner ready, and asking for automatic operation after ENDS_REQUEST_BEAT. */
void ends_gather(const NwNode *node, int64_t beat, int lost, double value[SLR_IN_COUNT]);
/* The FMU's outputs from what the peer heard: commands are followed while they are right and enabled, else neutral. */
void ends_show(NwNode *node, const void *peer);
/* The FMU's outputs are the controller's own. */
void ends_tell(NwNode *node, const double value[SLR_OUT_COUNT]);
/* Whether commands that were followed once have stopped. */
int ends_lost(const NwNode *node, const void *peer);

#endif
