/* An FMU on networks (FMI-LS-BUS, low cut): what network.c does for it, and what the FMU itself is.
 *
 * network.c has the interface of FMI 3.0: variables, ports with what they received and are to send, their clocks,
 * event mode, states. The FMU's own file has its state (`NwState`, in app.h) and the functions below. All of a node
 * is plain values, so a copy of it is its state. Time is in ns since the start.
 *
 * The clock of what is sent is triggered: operations appended to `sent` leave at the end of the step. */
#ifndef NW_NETWORK_H
#define NW_NETWORK_H

#include <stdint.h>

#include "network_config.h" /* generated: NW_NAME, NW_TOKEN, NW_PORTS, NW_TABLE; the places of variables */
#include "operations.h"

#include "app.h"

typedef struct {
  NwBuffer received, sent;
  int32_t received_now, sent_now; /* the clocks */
} NwPort;

typedef struct {
  int64_t now;
  double start; /* s: the importer's time at 0 */
  double value[NW_VALUES];
  NwPort port[NW_PORTS];
  NwState own;
  char message[200]; /* why something failed */
} NwNode;

/* ---- what an FMU of this kind is: false where it fails, with a sentence in `message` ---- */

void nw_start(NwNode *node);                         /* at the end of initialisation; `own` is all 0 */
int nw_step(NwNode *node, int64_t until);            /* from `now`, which network.c moves on after it */
int nw_receive(NwNode *node, int port);              /* in event mode: `received` is there */

#endif
