/* The memory that an FMU's host process shares with us, and how calls travel through it.
 *
 * One call at a time: the caller writes arguments, raises `asked` and wakes the host; the host writes results
 * and sets `answered` to the same number. Both spin a little before they sleep, so that a call costs no more
 * than two cache misses when both are awake. The host runs foreign code that may write anything here: the
 * caller checks every length it reads. Linux only. */
#ifndef SLW_CHANNEL_H
#define SLW_CHANNEL_H

#include <stdatomic.h>

#include "fmu.h"

#define SLW_HOST_FD 3                       /* where the host finds the shared memory */
#define SLW_DATA_SIZE ((size_t)256 << 20)   /* reserved; only what is touched takes memory */

typedef enum {
  SLW_CALL_LOAD, SLW_CALL_ENTER_CONFIGURATION, SLW_CALL_EXIT_CONFIGURATION, SLW_CALL_ENTER_INITIALISATION,
  SLW_CALL_EXIT_INITIALISATION, SLW_CALL_SET, SLW_CALL_GET, SLW_CALL_STEP, SLW_CALL_AFTER_DISCARD,
  SLW_CALL_ENTER_EVENT, SLW_CALL_UPDATE_DISCRETE, SLW_CALL_ENTER_STEP, SLW_CALL_INTERVAL, SLW_CALL_SHIFT,
  SLW_CALL_GET_STATE, SLW_CALL_SET_STATE,
  SLW_CALL_FREE_STATE, SLW_CALL_SERIALIZED_SIZE, SLW_CALL_SERIALIZE, SLW_CALL_DESERIALIZE, SLW_CALL_DIRECTIONAL,
  SLW_CALL_TERMINATE, SLW_CALL_RESET, SLW_CALL_EXCHANGE /* set, step, get */, SLW_CALL_QUIT,
  SLW_N_CALLS
} slw_call;

typedef struct {
  _Atomic uint32_t asked, answered;           /* futex words */
  _Atomic uint32_t host_sleeps, caller_sleeps;
  uint32_t call;                              /* slw_call */
  int32_t status;                             /* slw_status */
  uint32_t n_sets, n_gets;                    /* groups in the data */
  double time, h, stop, tolerance;
  uint64_t number;                            /* of a state; a size; a clock */
  int32_t qualifier;                          /* of an interval, which is in `time` */
  uint32_t flag;
  uint32_t phase, warnings;                   /* of an exchange: slw_phase, and how many of its calls warned */
  struct { double reached; uint32_t event, terminate, early; } step;
  struct { double next_event; uint32_t more, terminate, next_event_defined; } event;
  uint64_t n_messages;
  char messages[SLW_MESSAGES][SLW_MESSAGE_SIZE];
  _Alignas(64) char data[];
} slw_channel;

/* Writing and reading the data one after the other; `failed` once something did not fit. */
typedef struct {
  char *data;
  size_t used, size;
  bool failed;
} slw_tape;

void *slw_tape_take(slw_tape *tape, size_t size); /* `size` bytes, aligned to 8; NULL when they do not fit */
void slw_tape_put(slw_tape *tape, const void *data, size_t size);

/* A group's head and, with `values`, its values; strings and binaries with their sizes. */
void slw_tape_put_group(slw_tape *tape, const slw_group *group, bool values);
/* The values only, as the answer to a get, into the caller's group; sizes are checked. */
bool slw_tape_take_values(slw_tape *tape, const slw_group *group);
void slw_tape_put_values(slw_tape *tape, const slw_group *group);

/* Sleep until *word differs from `seen`, at most `wait_ns`; spins first. */
void slw_wait_word(_Atomic uint32_t *word, uint32_t seen, _Atomic uint32_t *sleeps, long wait_ns);
void slw_set_word(_Atomic uint32_t *word, uint32_t value, _Atomic uint32_t *sleeps);

#endif
