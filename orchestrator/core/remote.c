/* The caller's side of an FMU in a process of its own. See channel.h. */
#include "remote.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef __linux__
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "channel.h"

#define LOOK_NS 20000000L /* how often a wait looks whether the host still lives */
#define QUIT_S 2.0
#ifndef F_ADD_SEALS /* older C libraries name none of this */
#define F_ADD_SEALS 1033
#define F_SEAL_SEAL 1
#define F_SEAL_SHRINK 2
#define F_SEAL_GROW 4
#endif
#define MEMFD_FLAGS 3u /* MFD_CLOEXEC | MFD_ALLOW_SEALING */
#define FREE_FD 64 /* the memory's descriptor is kept clear of the few that the host's must not be */

static const char *const call_names[SLW_N_CALLS] = {
    "instantiate", "enterConfigurationMode", "exitConfigurationMode", "enterInitializationMode",
    "exitInitializationMode", "set", "get", "doStep", "getStatus", "enterEventMode", "updateDiscreteStates",
    "enterStepMode", "getInterval", "getShift", "getFMUState", "setFMUState", "freeFMUState",
    "serializedFMUStateSize", "serializeFMUState",
    "deserializeFMUState", "getDirectionalDerivative", "terminate", "reset", "doStep", "freeInstance"};

typedef struct {
  slw_fmu fmu; /* first */
  slw_channel *channel;
  pid_t host;
  double limit_s, asked_s;
  slw_status dead; /* SLW_CRASHED or SLW_HUNG once it is */
  slw_call call;
  slw_tape tape;
} slw_remote;

static slw_remote *self(slw_fmu *fmu) { return (slw_remote *)fmu; }

static double clock_s(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* ---- the end of a host ---- */

static void say(slw_remote *r, const char *text) { slw_fmu_log(&r->fmu, text); }

/* How a process ended that nobody can ask any more, since somebody ignores or takes the ends of our children. */
#define LOST (-1)

/* Whether the host has ended, and how. What it may have started ends before its number is free for others. */
static bool ended(const slw_remote *r, int *status) {
  siginfo_t info = {0};
  *status = LOST;
  if (waitid(P_PID, (id_t)r->host, &info, WEXITED | WNOHANG | WNOWAIT) != 0) return errno == ECHILD;
  if (info.si_pid == 0) return false;
  kill(-r->host, SIGKILL);
  if (waitpid(r->host, status, WNOHANG) != r->host) *status = LOST;
  return true;
}

static slw_status has_ended(slw_remote *r, int status) {
  char text[160];
  if (status == LOST) {
    snprintf(text, sizeof text, "its process ended in %s", call_names[r->call]);
  } else if (WIFSIGNALED(status)) {
    snprintf(text, sizeof text, "its process ended with signal %d (%s) in %s", WTERMSIG(status),
             strsignal(WTERMSIG(status)), call_names[r->call]);
  } else {
    snprintf(text, sizeof text, "its process ended by itself with status %d in %s", WEXITSTATUS(status),
             call_names[r->call]);
  }
  say(r, text);
  return r->dead = SLW_CRASHED;
}

static slw_status end_host(slw_remote *r) {
  char text[160];
  kill(-r->host, SIGKILL); /* with what it may have started */
  kill(r->host, SIGKILL);  /* it may have gone to another group */
  while (waitpid(r->host, NULL, 0) < 0 && errno == EINTR) {}
  snprintf(text, sizeof text, "no answer from %s within %g s; its process was ended", call_names[r->call], r->limit_s);
  say(r, text);
  return r->dead = SLW_HUNG;
}

/* ---- calls ---- */

static void begin(slw_remote *r, slw_call call) {
  r->call = call;
  r->tape = (slw_tape){r->channel->data, 0, SLW_DATA_SIZE, false};
}

static void ask(slw_remote *r) {
  r->channel->call = (uint32_t)r->call;
  r->asked_s = clock_s();
  slw_set_word(&r->channel->asked, atomic_load(&r->channel->asked) + 1, &r->channel->host_sleeps);
}

/* New messages of the FMU; the host may have written anything. */
static void take_messages(slw_remote *r) {
  const uint64_t there = *(volatile uint64_t *)&r->channel->n_messages;
  if (there <= r->fmu.n_messages || there > UINT64_MAX / 2) return; /* no count, and ours must not wrap */
  const uint64_t first = there - r->fmu.n_messages > SLW_MESSAGES ? there - SLW_MESSAGES : r->fmu.n_messages;
  for (uint64_t k = first; k < there; k++) {
    char *place = r->fmu.messages[k % SLW_MESSAGES];
    memcpy(place, r->channel->messages[k % SLW_MESSAGES], SLW_MESSAGE_SIZE);
    place[SLW_MESSAGE_SIZE - 1] = 0;
  }
  r->fmu.n_messages = there;
}

/* Wait for the answer; its status. */
static slw_status await(slw_remote *r) {
  slw_channel *c = r->channel;
  const uint32_t asked = atomic_load(&c->asked);
  for (uint32_t seen = atomic_load(&c->answered); seen != asked; seen = atomic_load(&c->answered)) {
    slw_wait_word(&c->answered, seen, &c->caller_sleeps, LOOK_NS);
    if (atomic_load(&c->answered) == asked) break;
    int status = 0;
    if (ended(r, &status)) return take_messages(r), has_ended(r, status);
    if (clock_s() - r->asked_s > r->limit_s) return take_messages(r), end_host(r);
  }
  take_messages(r);
  r->tape.used = 0;
  const int32_t status = *(volatile int32_t *)&c->status;
  return status >= SLW_OK && status <= SLW_FATAL ? (slw_status)status : SLW_ERROR;
}

static slw_status too_large(slw_remote *r) {
  say(r, "values too large to pass to another process");
  return SLW_ERROR;
}

static slw_status finish(slw_remote *r) {
  if (r->tape.failed) return too_large(r);
  ask(r);
  return await(r);
}

#define START(fmu, which)             \
  slw_remote *r = self(fmu);          \
  if (r->dead) return r->dead;        \
  begin(r, which)

static slw_status plain(slw_fmu *fmu, slw_call call) {
  START(fmu, call);
  return finish(r);
}

#define PLAIN(name, which) \
  static slw_status name(slw_fmu *fmu) { return plain(fmu, which); }
PLAIN(enter_configuration, SLW_CALL_ENTER_CONFIGURATION)
PLAIN(exit_configuration, SLW_CALL_EXIT_CONFIGURATION)
PLAIN(exit_initialisation, SLW_CALL_EXIT_INITIALISATION)
PLAIN(enter_event, SLW_CALL_ENTER_EVENT)
PLAIN(enter_step, SLW_CALL_ENTER_STEP)
PLAIN(terminate, SLW_CALL_TERMINATE)
PLAIN(reset, SLW_CALL_RESET)

static slw_status enter_initialisation(slw_fmu *fmu, double start, bool stop_defined, double stop, double tolerance) {
  START(fmu, SLW_CALL_ENTER_INITIALISATION);
  r->channel->time = start, r->channel->flag = stop_defined;
  r->channel->stop = stop, r->channel->tolerance = tolerance;
  return finish(r);
}

static slw_status set(slw_fmu *fmu, const slw_group *group) {
  START(fmu, SLW_CALL_SET);
  slw_tape_put_group(&r->tape, group, true);
  return finish(r);
}

static slw_status take_group(slw_remote *r, const slw_group *group) {
  if (slw_tape_take_values(&r->tape, group)) return SLW_OK;
  say(r, "its process answered with values that do not fit");
  return SLW_ERROR;
}

static slw_status get(slw_fmu *fmu, const slw_group *group) {
  START(fmu, SLW_CALL_GET);
  slw_tape_put_group(&r->tape, group, false);
  const slw_status status = finish(r);
  return status > SLW_WARNING || take_group(r, group) == SLW_OK ? status : SLW_ERROR;
}

static void take_result(const slw_remote *r, slw_step_result *result) {
  result->reached = r->channel->step.reached;
  result->event = r->channel->step.event != 0;
  result->terminate = r->channel->step.terminate != 0;
  result->early = r->channel->step.early != 0;
}

static slw_status step(slw_fmu *fmu, double time, double h, slw_step_result *result) {
  START(fmu, SLW_CALL_STEP);
  r->channel->time = time, r->channel->h = h;
  const slw_status status = finish(r);
  if (!r->dead) take_result(r, result);
  return status;
}

static slw_status after_discard(slw_fmu *fmu, slw_step_result *result) {
  START(fmu, SLW_CALL_AFTER_DISCARD);
  r->channel->step.reached = result->reached;
  const slw_status status = finish(r);
  if (!r->dead) take_result(r, result);
  return status;
}

slw_status slw_remote_begin(slw_fmu *fmu, const slw_group *sets, size_t n_sets, double time, double h,
                            const slw_group *gets, size_t n_gets) {
  START(fmu, SLW_CALL_EXCHANGE);
  r->channel->time = time, r->channel->h = h;
  r->channel->n_sets = (uint32_t)n_sets, r->channel->n_gets = (uint32_t)n_gets;
  for (size_t i = 0; i < n_sets; i++) slw_tape_put_group(&r->tape, &sets[i], true);
  for (size_t i = 0; i < n_gets; i++) slw_tape_put_group(&r->tape, &gets[i], false);
  if (r->tape.failed) return too_large(r);
  ask(r);
  return SLW_OK;
}

/* How far the exchange got; the host may have written anything. */
static void take_exchanged(const slw_remote *r, size_t calls, slw_exchanged *result) {
  const uint32_t phase = r->channel->phase, warnings = r->channel->warnings;
  result->phase = phase <= SLW_AT_GET ? (slw_phase)phase : SLW_AT_SET;
  result->warnings = warnings <= calls ? warnings : (uint32_t)calls;
  result->complete = r->channel->flag != 0;
  take_result(r, &result->step);
}

slw_status slw_remote_finish(slw_fmu *fmu, const slw_group *gets, size_t n_gets, slw_exchanged *result) {
  slw_remote *r = self(fmu);
  memset(result, 0, sizeof *result);
  result->phase = SLW_AT_STEP;
  if (r->dead) return r->dead;
  const slw_status status = await(r);
  if (r->dead) return status;
  take_exchanged(r, r->channel->n_sets + n_gets + 1, result);
  for (size_t i = 0; result->complete && i < n_gets; i++)
    if (take_group(r, &gets[i]) != SLW_OK) return SLW_ERROR;
  return status;
}

static slw_status update_discrete(slw_fmu *fmu, slw_event_result *result) {
  START(fmu, SLW_CALL_UPDATE_DISCRETE);
  const slw_status status = finish(r);
  if (r->dead) return status;
  result->more = r->channel->event.more != 0;
  result->terminate = r->channel->event.terminate != 0;
  result->next_event_defined = r->channel->event.next_event_defined != 0;
  result->next_event = r->channel->event.next_event;
  return status;
}

static slw_status ask_clock(slw_fmu *fmu, slw_call call, uint32_t vr, bool fraction) {
  START(fmu, call);
  r->channel->number = vr, r->channel->flag = fraction;
  return finish(r);
}

static slw_status interval(slw_fmu *fmu, uint32_t vr, bool fraction, slw_interval *result) {
  const slw_status status = ask_clock(fmu, SLW_CALL_INTERVAL, vr, fraction);
  if (!self(fmu)->dead) *result = (slw_interval){self(fmu)->channel->qualifier, self(fmu)->channel->time};
  return status;
}

static slw_status shift(slw_fmu *fmu, uint32_t vr, bool fraction, double *seconds) {
  const slw_status status = ask_clock(fmu, SLW_CALL_SHIFT, vr, fraction);
  if (!self(fmu)->dead) *seconds = self(fmu)->channel->time;
  return status;
}

/* ---- states: numbers of the host's own list, from 1 on ---- */

static uint64_t number_of(const void *state) { return (uint64_t)(uintptr_t)state; }

static slw_status get_state(slw_fmu *fmu, void **state) {
  START(fmu, SLW_CALL_GET_STATE);
  r->channel->number = number_of(*state);
  const slw_status status = finish(r);
  if (status <= SLW_WARNING) *state = (void *)(uintptr_t)r->channel->number;
  return status;
}

static slw_status set_state(slw_fmu *fmu, void *state) {
  START(fmu, SLW_CALL_SET_STATE);
  r->channel->number = number_of(state);
  return finish(r);
}

static slw_status free_state(slw_fmu *fmu, void **state) {
  const uint64_t number = number_of(*state);
  *state = NULL;
  START(fmu, SLW_CALL_FREE_STATE);
  r->channel->number = number;
  return finish(r);
}

static slw_status serialized_size(slw_fmu *fmu, void *state, size_t *size) {
  START(fmu, SLW_CALL_SERIALIZED_SIZE);
  r->channel->number = number_of(state);
  const slw_status status = finish(r);
  const uint64_t found = *(volatile uint64_t *)&r->channel->number;
  if (r->dead) return status;
  if (found > SLW_DATA_SIZE) return too_large(r);
  *size = (size_t)found;
  return status;
}

static slw_status serialize(slw_fmu *fmu, void *state, char *bytes, size_t size) {
  START(fmu, SLW_CALL_SERIALIZE);
  r->channel->number = number_of(state);
  const uint64_t length = size;
  slw_tape_put(&r->tape, &length, sizeof length);
  const slw_status status = finish(r);
  if (status > SLW_WARNING) return status;
  const char *data = slw_tape_take(&r->tape, size);
  if (!data) return too_large(r);
  memcpy(bytes, data, size);
  return status;
}

static slw_status deserialize(slw_fmu *fmu, const char *bytes, size_t size, void **state) {
  START(fmu, SLW_CALL_DESERIALIZE);
  const uint64_t length = size;
  slw_tape_put(&r->tape, &length, sizeof length);
  slw_tape_put(&r->tape, bytes, size);
  const slw_status status = finish(r);
  if (status <= SLW_WARNING) *state = (void *)(uintptr_t)r->channel->number;
  return status;
}

static slw_status directional(slw_fmu *fmu, const uint32_t *unknowns, size_t n_unknowns, const uint32_t *knowns,
                              size_t n_knowns, const double *seed, size_t n_seed, double *result, size_t n_result) {
  START(fmu, SLW_CALL_DIRECTIONAL);
  const uint64_t sizes[4] = {n_unknowns, n_knowns, n_seed, n_result};
  slw_tape_put(&r->tape, sizes, sizeof sizes);
  slw_tape_put(&r->tape, unknowns, n_unknowns * sizeof *unknowns);
  slw_tape_put(&r->tape, knowns, n_knowns * sizeof *knowns);
  slw_tape_put(&r->tape, seed, n_seed * sizeof *seed);
  const slw_status status = finish(r);
  if (status > SLW_WARNING) return status;
  const double *found = slw_tape_take(&r->tape, n_result * sizeof *result);
  if (!found) return too_large(r);
  memcpy(result, found, n_result * sizeof *result);
  return status;
}

/* ---- life ---- */

static void free_fmu(slw_fmu *fmu) {
  slw_remote *r = self(fmu);
  if (!r->dead && r->host > 0) {
    if (r->limit_s > QUIT_S) r->limit_s = QUIT_S;
    begin(r, SLW_CALL_QUIT);
    ask(r);
    if (await(r) <= SLW_FATAL && !r->dead) { /* it answers, then ends; where it does not, it is ended */
      int status;
      const double until = clock_s() + r->limit_s;
      bool gone;
      while (!(gone = ended(r, &status)) && clock_s() < until) usleep(200);
      if (!gone) end_host(r);
    }
  }
  if (r->channel) munmap(r->channel, sizeof *r->channel + SLW_DATA_SIZE);
  free(r);
}

static const slw_fmu_functions functions = {
    .enter_configuration = enter_configuration, .exit_configuration = exit_configuration,
    .enter_initialisation = enter_initialisation, .exit_initialisation = exit_initialisation,
    .set = set, .get = get, .step = step, .after_discard = after_discard,
    .enter_event = enter_event, .update_discrete = update_discrete, .enter_step = enter_step,
    .interval = interval, .shift = shift, .get_state = get_state, .set_state = set_state, .free_state = free_state,
    .serialized_size = serialized_size, .serialize = serialize, .deserialize = deserialize,
    .directional = directional, .terminate = terminate, .reset = reset, .free = free_fmu};

void slw_fmu_hurry(slw_fmu *fmu, double limit_s) {
  if (fmu->call == &functions && self(fmu)->limit_s > limit_s) self(fmu)->limit_s = limit_s;
}

/* Descriptor of the shared memory, clear of those that the host's must not be; -1 when that fails. */
static int shared_memory(void) {
  const int low = (int)syscall(SYS_memfd_create, "slewright-fmu", MEMFD_FLAGS);
  if (low < 0) return -1;
  const int fd = fcntl(low, F_DUPFD_CLOEXEC, FREE_FD);
  close(low);
  if (fd < 0) return -1;
  /* Sealed: were it cut short over there, our next access would be the end of us. */
  if (ftruncate(fd, (off_t)(sizeof(slw_channel) + SLW_DATA_SIZE)) == 0 &&
      fcntl(fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) == 0)
    return fd;
  close(fd);
  return -1;
}

/* stdin from nowhere, stdout to our stderr, the memory as SLW_HOST_FD; signals as new, a group of its own. */
static int spawn(const char *host, int fd, pid_t *pid) {
  extern char **environ;
  posix_spawn_file_actions_t files;
  posix_spawnattr_t how;
  sigset_t none, all;
  char *const arguments[] = {(char *)(uintptr_t)host, NULL};
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, 2, 1);
  posix_spawn_file_actions_adddup2(&files, fd, SLW_HOST_FD);
  posix_spawnattr_init(&how);
  posix_spawnattr_setflags(&how, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setsigmask(&how, &none);
  posix_spawnattr_setsigdefault(&how, &all);
  posix_spawnattr_setpgroup(&how, 0);
  const int failed = posix_spawn(pid, host, &files, &how, arguments, environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&how);
  return failed;
}

static slw_status load(slw_remote *r, const slw_fmu_options *o) {
  const char *const strings[7] = {o->library, o->name, o->token, o->resources, o->exchange, o->log, o->scheduled};
  const uint64_t head[7] = {(uint64_t)o->fmi_version, o->event_mode, o->early_return, o->resources != NULL,
                            o->exchange != NULL, o->log != NULL, o->scheduled != NULL};
  const uint64_t parent = (uint64_t)getpid();
  begin(r, SLW_CALL_LOAD);
  slw_tape_put(&r->tape, head, sizeof head);
  slw_tape_put(&r->tape, &parent, sizeof parent);
  for (int i = 0; i < 7; i++) {
    const uint64_t size = strings[i] ? strlen(strings[i]) + 1 : 1;
    slw_tape_put(&r->tape, &size, sizeof size);
    slw_tape_put(&r->tape, strings[i] ? strings[i] : "", (size_t)size);
  }
  return finish(r);
}

static slw_fmu *give_up(slw_remote *r) {
  free_fmu(&r->fmu);
  return NULL;
}

slw_fmu *slw_fmu_spawn(const slw_fmu_options *options, const char *host, double limit_s, char *error,
                       size_t error_size) {
  slw_remote *r = calloc(1, sizeof *r);
  const int fd = r ? shared_memory() : -1;
  if (fd < 0) {
    snprintf(error, error_size, "no shared memory: %s", strerror(errno));
    free(r);
    return NULL;
  }
  r->fmu.call = &functions, r->fmu.fmi_version = options->fmi_version, r->limit_s = limit_s;
  r->fmu.scheduled = options->scheduled != NULL;
  void *memory = mmap(NULL, sizeof(slw_channel) + SLW_DATA_SIZE, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE,
                      fd, 0);
  r->channel = memory == MAP_FAILED ? NULL : memory;
  const int failed = r->channel ? spawn(host, fd, &r->host) : ENOMEM;
  close(fd);
  if (failed) {
    snprintf(error, error_size, "its host process %s cannot be started: %s", host, strerror(failed));
    r->host = 0;
    return give_up(r);
  }
  if (load(r, options) <= SLW_WARNING) return &r->fmu;
  snprintf(error, error_size, "%s", r->fmu.n_messages ? slw_fmu_message(&r->fmu, 0) : "it gave no reason");
  return give_up(r);
}

#else

slw_fmu *slw_fmu_spawn(const slw_fmu_options *options, const char *host, double limit_s, char *error,
                       size_t error_size) {
  (void)options, (void)host, (void)limit_s;
  snprintf(error, error_size, "processes for FMUs need Linux; trust it to run it in this one");
  return NULL;
}

void slw_fmu_hurry(slw_fmu *fmu, double limit_s) { (void)fmu, (void)limit_s; }

slw_status slw_remote_begin(slw_fmu *fmu, const slw_group *sets, size_t n_sets, double time, double h,
                            const slw_group *gets, size_t n_gets) {
  (void)fmu, (void)sets, (void)n_sets, (void)time, (void)h, (void)gets, (void)n_gets;
  return SLW_ERROR;
}

slw_status slw_remote_finish(slw_fmu *fmu, const slw_group *gets, size_t n_gets, slw_exchanged *result) {
  (void)fmu, (void)gets, (void)n_gets;
  memset(result, 0, sizeof *result);
  return SLW_ERROR;
}
#endif
