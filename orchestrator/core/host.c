/* The host program: runs one FMU for the process that started it, and ends with it. See channel.h. */
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "channel.h"

#define LOOK_NS 200000000L /* how often it looks whether its parent still lives */
#define MANY_FILES 1024
#define MAX_VALUES (SLW_DATA_SIZE / sizeof(slw_cell))

/* Buffers of one group, kept between calls. */
typedef struct {
  slw_group group;
  slw_cell *cells;
  slw_blob *blobs;
  void *native;
  size_t room, blob_room, native_room;
} slw_slot;

typedef struct {
  slw_channel *channel;
  slw_fmu *fmu;
  slw_tape tape;
  void **states; /* by number - 1; NULL: free */
  size_t n_states;
  slw_slot *slots; /* one for each group of a call */
  size_t n_slots;
} slw_host;

/* ---- groups ---- */

static bool enlarge(void *buffer, size_t *room, size_t size) {
  void *old;
  memcpy(&old, buffer, sizeof old);
  if (size <= *room) return true;
  void *grown = realloc(old, size);
  if (!grown) return false;
  memset((char *)grown + *room, 0, size - *room);
  memcpy(buffer, &grown, sizeof grown);
  *room = size;
  return true;
}

static slw_slot *slot_at(slw_host *h, size_t k) {
  size_t room = h->n_slots * sizeof *h->slots;
  if (k >= h->n_slots) {
    if (!enlarge(&h->slots, &room, (k + 1) * sizeof *h->slots)) return NULL;
    h->n_slots = k + 1;
  }
  return &h->slots[k];
}

/* The next group of the tape, in slot k; NULL when it does not fit. */
static slw_group *take_group(slw_host *h, size_t k, bool values) {
  slw_slot *s = slot_at(h, k);
  const uint64_t *head = slw_tape_take(&h->tape, 3 * sizeof *head);
  if (!s || !head || head[0] >= SLW_N_TYPES || head[1] > MAX_VALUES || head[2] > MAX_VALUES) return NULL;
  slw_group *g = &s->group;
  g->type = (slw_type)head[0], g->n_vr = (size_t)head[1], g->n = (size_t)head[2];
  g->vr = slw_tape_take(&h->tape, g->n_vr * sizeof *g->vr);
  const size_t native = slw_native_size(h->fmu->fmi_version, g->type) * g->n;
  const bool blobs = g->type == SLW_STRING || g->type == SLW_BINARY;
  if (!g->vr || !enlarge(&s->cells, &s->room, g->n * sizeof *s->cells) ||
      !enlarge(&s->native, &s->native_room, native) ||
      (blobs && !enlarge(&s->blobs, &s->blob_room, g->n * sizeof *s->blobs)))
    return NULL;
  g->cells = s->cells, g->native = native ? s->native : NULL, g->blobs = blobs ? s->blobs : NULL;
  for (size_t i = 0; blobs && i < g->n; i++) g->cells[i].integer = (int64_t)i;
  return !values || slw_tape_take_values(&h->tape, g) ? g : NULL;
}

static slw_status no_room(slw_host *h) {
  slw_fmu_log(h->fmu, "no memory for its values");
  return SLW_ERROR;
}

static slw_status put_answer(slw_host *h, size_t first, size_t n, slw_status status) {
  h->tape.used = 0;
  for (size_t i = 0; i < n; i++) slw_tape_put_values(&h->tape, &h->slots[first + i].group);
  return h->tape.failed ? no_room(h) : status;
}

static slw_status call_set(slw_host *h) {
  const slw_group *g = take_group(h, 0, true);
  return g ? h->fmu->call->set(h->fmu, g) : no_room(h);
}

static slw_status call_get(slw_host *h) {
  const slw_group *g = take_group(h, 0, false);
  if (!g) return no_room(h);
  const slw_status status = h->fmu->call->get(h->fmu, g);
  return status > SLW_WARNING ? status : put_answer(h, 0, 1, status);
}

/* ---- steps ---- */

static void put_result(slw_channel *c, const slw_step_result *result) {
  c->step.reached = result->reached, c->step.event = result->event;
  c->step.terminate = result->terminate, c->step.early = result->early;
}

static slw_status call_step(slw_host *h) {
  slw_step_result result = {h->channel->time, false, false, false};
  const slw_status status = h->fmu->call->step(h->fmu, h->channel->time, h->channel->h, &result);
  put_result(h->channel, &result);
  return status;
}

/* A call of the exchange: its status, after which nothing more is called if it is worse than a warning. */
static slw_status called(slw_channel *c, slw_phase phase, slw_status status) {
  c->phase = phase;
  c->warnings += status == SLW_WARNING;
  return status;
}

static slw_status exchange_set(slw_host *h, size_t n_sets) {
  for (size_t i = 0; i < n_sets; i++) {
    const slw_group *g = take_group(h, i, true);
    const slw_status status = called(h->channel, SLW_AT_SET, g ? h->fmu->call->set(h->fmu, g) : no_room(h));
    if (status > SLW_WARNING) return status;
  }
  return SLW_OK;
}

static slw_status exchange_get(slw_host *h, size_t first, size_t n_gets) {
  for (size_t i = 0; i < n_gets; i++) {
    const slw_status got = h->fmu->call->get(h->fmu, &h->slots[first + i].group);
    const slw_status status = called(h->channel, SLW_AT_GET, got);
    if (status > SLW_WARNING) return status;
  }
  return put_answer(h, first, n_gets, SLW_OK);
}

/* The channel's flag says whether all was done as asked; `phase` is what the status is of. */
static slw_status call_exchange(slw_host *h) {
  slw_channel *c = h->channel;
  const size_t n_sets = c->n_sets, n_gets = c->n_gets;
  c->flag = 0, c->warnings = 0;
  slw_status status = exchange_set(h, n_sets);
  if (status > SLW_WARNING) return status;
  for (size_t i = 0; i < n_gets; i++)
    if (!take_group(h, n_sets + i, false)) return no_room(h);
  status = called(c, SLW_AT_STEP, call_step(h));
  if (status > SLW_WARNING || c->step.early || c->step.terminate || c->step.event) return status;
  status = exchange_get(h, n_sets, n_gets);
  c->flag = status <= SLW_WARNING;
  return status;
}

static slw_status call_after_discard(slw_host *h) {
  slw_step_result result = {h->channel->step.reached, false, false, false};
  const slw_status status = h->fmu->call->after_discard(h->fmu, &result);
  put_result(h->channel, &result);
  return status;
}

static slw_status call_update_discrete(slw_host *h) {
  slw_event_result result = {false, false, false, 0.0};
  const slw_status status = h->fmu->call->update_discrete(h->fmu, &result);
  h->channel->event.more = result.more, h->channel->event.terminate = result.terminate;
  h->channel->event.next_event_defined = result.next_event_defined;
  h->channel->event.next_event = result.next_event;
  return status;
}

static slw_status call_interval(slw_host *h) {
  slw_interval result = {SLW_NOT_YET_KNOWN, 0.0};
  slw_channel *c = h->channel;
  const slw_status status = h->fmu->call->interval(h->fmu, (uint32_t)c->number, c->flag != 0, &result);
  c->qualifier = result.qualifier, c->time = result.seconds;
  return status;
}

static slw_status call_shift(slw_host *h) {
  double seconds = 0.0;
  const slw_status status = h->fmu->call->shift(h->fmu, (uint32_t)h->channel->number, h->channel->flag != 0, &seconds);
  h->channel->time = seconds;
  return status;
}

/* ---- states ---- */

static void **state_of(slw_host *h) {
  const uint64_t number = h->channel->number;
  return number >= 1 && number <= h->n_states ? &h->states[number - 1] : NULL;
}

static slw_status unknown_state(slw_host *h) {
  slw_fmu_log(h->fmu, "no such state");
  return SLW_ERROR;
}

/* A free place of the list; its number goes to the channel. */
static void **new_state(slw_host *h) {
  size_t k = 0;
  while (k < h->n_states && h->states[k]) k++;
  size_t room = h->n_states * sizeof *h->states;
  if (k == h->n_states) {
    if (!enlarge(&h->states, &room, (k + 1) * sizeof *h->states)) return NULL;
    h->n_states = k + 1;
  }
  h->channel->number = k + 1;
  return &h->states[k];
}

static slw_status call_get_state(slw_host *h) {
  void **state = h->channel->number ? state_of(h) : new_state(h);
  return state ? h->fmu->call->get_state(h->fmu, state) : unknown_state(h);
}

static slw_status call_set_state(slw_host *h) {
  void **state = state_of(h);
  return state && *state ? h->fmu->call->set_state(h->fmu, *state) : unknown_state(h);
}

static slw_status call_free_state(slw_host *h) {
  void **state = state_of(h);
  return state && *state ? h->fmu->call->free_state(h->fmu, state) : unknown_state(h);
}

static slw_status call_serialized_size(slw_host *h) {
  void **state = state_of(h);
  size_t size = 0;
  if (!state || !*state) return unknown_state(h);
  const slw_status status = h->fmu->call->serialized_size(h->fmu, *state, &size);
  h->channel->number = size;
  return status;
}

static slw_status call_serialize(slw_host *h) {
  void **state = state_of(h);
  const uint64_t *length = slw_tape_take(&h->tape, sizeof *length);
  if (!state || !*state || !length) return unknown_state(h);
  const size_t size = (size_t)*length;
  h->tape.used = 0;
  char *bytes = slw_tape_take(&h->tape, size);
  return bytes ? h->fmu->call->serialize(h->fmu, *state, bytes, size) : no_room(h);
}

static slw_status call_deserialize(slw_host *h) {
  const uint64_t *length = slw_tape_take(&h->tape, sizeof *length);
  const char *bytes = length ? slw_tape_take(&h->tape, (size_t)*length) : NULL;
  void **state = bytes ? new_state(h) : NULL;
  return state ? h->fmu->call->deserialize(h->fmu, bytes, (size_t)*length, state) : no_room(h);
}

static slw_status call_directional(slw_host *h) {
  const uint64_t *n = slw_tape_take(&h->tape, 4 * sizeof *n);
  if (!n) return no_room(h);
  const uint64_t sizes[4] = {n[0], n[1], n[2], n[3]};
  for (int i = 0; i < 4; i++)
    if (sizes[i] > MAX_VALUES) return no_room(h);
  const uint32_t *unknowns = slw_tape_take(&h->tape, (size_t)sizes[0] * sizeof *unknowns);
  const uint32_t *knowns = slw_tape_take(&h->tape, (size_t)sizes[1] * sizeof *knowns);
  const double *seed = slw_tape_take(&h->tape, (size_t)sizes[2] * sizeof *seed);
  double *result = seed ? calloc((size_t)sizes[3] + 1, sizeof *result) : NULL;
  if (!unknowns || !knowns || !result) return free(result), no_room(h);
  const slw_status status =
      h->fmu->call->directional(h->fmu, unknowns, (size_t)sizes[0], knowns, (size_t)sizes[1], seed,
                                (size_t)sizes[2], result, (size_t)sizes[3]);
  h->tape.used = 0;
  slw_tape_put(&h->tape, result, (size_t)sizes[3] * sizeof *result);
  free(result);
  return status;
}

/* ---- life ---- */

static void say_refusal(slw_channel *c, const char *error) {
  snprintf(c->messages[0], SLW_MESSAGE_SIZE, "%s", error);
  c->n_messages = 1;
}

static slw_status call_load(slw_host *h) {
  char error[SLW_MESSAGE_SIZE] = "it gave no reason";
  const uint64_t *head = slw_tape_take(&h->tape, 7 * sizeof *head);
  const uint64_t *parent = slw_tape_take(&h->tape, sizeof *parent);
  const char *strings[7] = {NULL, NULL, NULL, NULL, NULL, NULL, NULL};
  for (int i = 0; i < 7; i++) {
    const uint64_t *size = slw_tape_take(&h->tape, sizeof *size);
    strings[i] = size ? slw_tape_take(&h->tape, (size_t)*size) : NULL;
  }
  if (!strings[6]) return SLW_ERROR;
  if ((uint64_t)getppid() != *parent) exit(0); /* it ended before the signal of its end was asked for */
  const slw_fmu_options options = {(int)head[0], strings[0], strings[1], strings[2], head[3] ? strings[3] : NULL,
                                   head[1] != 0, head[2] != 0, head[4] ? strings[4] : NULL,
                                   head[6] ? strings[6] : NULL, head[5] ? strings[5] : NULL};
  h->fmu = slw_fmu_load(&options, error, sizeof error);
  if (h->fmu) return SLW_OK;
  say_refusal(h->channel, error);
  return SLW_ERROR;
}

static slw_status answer(slw_host *h, slw_call call) {
  const slw_fmu_functions *f = h->fmu ? h->fmu->call : NULL;
  if (call == SLW_CALL_LOAD) return call_load(h);
  if (!f) return SLW_ERROR;
  switch (call) {
    case SLW_CALL_ENTER_CONFIGURATION: return f->enter_configuration(h->fmu);
    case SLW_CALL_EXIT_CONFIGURATION: return f->exit_configuration(h->fmu);
    case SLW_CALL_ENTER_INITIALISATION:
      return f->enter_initialisation(h->fmu, h->channel->time, h->channel->flag != 0, h->channel->stop,
                                     h->channel->tolerance);
    case SLW_CALL_EXIT_INITIALISATION: return f->exit_initialisation(h->fmu);
    case SLW_CALL_SET: return call_set(h);
    case SLW_CALL_GET: return call_get(h);
    case SLW_CALL_STEP: return call_step(h);
    case SLW_CALL_AFTER_DISCARD: return call_after_discard(h);
    case SLW_CALL_ENTER_EVENT: return f->enter_event(h->fmu);
    case SLW_CALL_UPDATE_DISCRETE: return call_update_discrete(h);
    case SLW_CALL_ENTER_STEP: return f->enter_step(h->fmu);
    case SLW_CALL_INTERVAL: return call_interval(h);
    case SLW_CALL_SHIFT: return call_shift(h);
    case SLW_CALL_GET_STATE: return call_get_state(h);
    case SLW_CALL_SET_STATE: return call_set_state(h);
    case SLW_CALL_FREE_STATE: return call_free_state(h);
    case SLW_CALL_SERIALIZED_SIZE: return call_serialized_size(h);
    case SLW_CALL_SERIALIZE: return call_serialize(h);
    case SLW_CALL_DESERIALIZE: return call_deserialize(h);
    case SLW_CALL_DIRECTIONAL: return call_directional(h);
    case SLW_CALL_TERMINATE: return f->terminate(h->fmu);
    case SLW_CALL_RESET: return f->reset(h->fmu);
    case SLW_CALL_EXCHANGE: return call_exchange(h);
    default: return SLW_ERROR;
  }
}

static void pass_messages(const slw_host *h) {
  if (!h->fmu || h->channel->n_messages == h->fmu->n_messages) return;
  memcpy(h->channel->messages, h->fmu->messages, sizeof h->channel->messages);
  h->channel->n_messages = h->fmu->n_messages;
}

static void serve(slw_host *h) {
  slw_channel *c = h->channel;
  const pid_t parent = getppid();
  for (uint32_t done = 0;;) {
    while (atomic_load(&c->asked) == done) {
      slw_wait_word(&c->asked, done, &c->host_sleeps, LOOK_NS);
      if (getppid() != parent) return;
    }
    h->tape = (slw_tape){c->data, 0, SLW_DATA_SIZE, false};
    const slw_call call = (slw_call)c->call;
    if (call == SLW_CALL_QUIT && h->fmu) h->fmu->call->free(h->fmu), h->fmu = NULL;
    const slw_status status = call == SLW_CALL_QUIT ? SLW_OK : answer(h, call);
    pass_messages(h);
    c->status = (int32_t)status;
    slw_set_word(&c->answered, ++done, &c->caller_sleeps);
    if (call == SLW_CALL_QUIT) return;
  }
}

/* Where memory runs short, this process is to end before those it works for. */
static void be_first_to_go(void) {
  const int fd = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
  if (fd < 0) return;
  if (write(fd, "1000", 4) < 0) { /* then it is not */
  }
  close(fd);
}

/* Our parent's files that were not to be inherited but are: no business of a foreign FMU. */
static void close_inherited(void) {
#ifdef SYS_close_range
  if (syscall(SYS_close_range, SLW_HOST_FD, ~0u, 0u) == 0) return;
#endif
  for (int fd = SLW_HOST_FD; fd < MANY_FILES; fd++) close(fd);
}

int main(void) {
  slw_host host = {0};
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  be_first_to_go();
  void *memory = mmap(NULL, sizeof(slw_channel) + SLW_DATA_SIZE, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE,
                      SLW_HOST_FD, 0);
  close(SLW_HOST_FD);
  if (memory == MAP_FAILED) return 1;
  host.channel = memory;
  close_inherited();
  serve(&host);
  _exit(0); /* without the clean-up of foreign libraries */
}
