/* FMI 3.0 co-simulation around a Python class: values here, the class in a Python process of its own.
 *
 * `table.h` is generated: N_CELLS, N_VARIABLES, TOKEN and `variables` by value reference. A request is a letter
 * and numbers, an answer a status (0: done), a length and bytes; server.py reads and writes the same. */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fmi/fmi3Functions.h"
#include "table.h"

#ifndef MSG_NOSIGNAL
#define MSG_NOSIGNAL 0
#endif
#define CHILD_FD 3

typedef struct {
  double cells[N_CELLS];
  double request[N_CELLS + 2], answer[N_CELLS]; /* here, since large arrays would not fit the stack */
  int socket;
  pid_t child;
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
} instance_t;

typedef struct {
  double cells[N_CELLS];
  uint32_t size;
  char bytes[];
} state_t;

#define SELF ((instance_t *)instance)

static fmi3Status say(instance_t *m, const char *text) {
  if (m->log) m->log(m->environment, fmi3Error, "python", text);
  return fmi3Error;
}

/* ---- the other process ---- */

static bool put(instance_t *m, const void *data, size_t size) {
  const char *from = data;
  while (size) {
    const ssize_t n = send(m->socket, from, size, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    from += n, size -= (size_t)n;
  }
  return true;
}

static bool take(instance_t *m, void *data, size_t size) {
  char *to = data;
  while (size) {
    const ssize_t n = recv(m->socket, to, size, 0);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    to += n, size -= (size_t)n;
  }
  return true;
}

/* Asks and waits. The answer's bytes go into `room` if they fit, else into *grown, which is the caller's. */
static fmi3Status ask(instance_t *m, char what, const void *data, uint32_t size, void *room, uint32_t fits,
                      char **grown, uint32_t *found) {
  uint32_t status = 1, length = 0;
  if (!put(m, &what, 1) || !put(m, &size, sizeof size) || !put(m, data, size) || !take(m, &status, sizeof status) ||
      !take(m, &length, sizeof length))
    return say(m, "the Python process has ended");
  char *bytes = room && status == 0 && length <= fits ? room : malloc(length + 1u);
  if (!bytes || !take(m, bytes, length)) return say(m, "the Python process has ended");
  if (found) *found = length;
  if (status == 0) {
    if (bytes != room && grown) *grown = bytes;
    else if (bytes != room) free(bytes);
    return fmi3OK;
  }
  bytes[length] = 0;
  say(m, bytes);
  free(bytes);
  return fmi3Error;
}

/* The interpreter: of the environment, of the file that the FMU was packed with, or the one on the path. */
static void run(const char *resources, int fd) {
  char named[4096] = "", script[4096], *own = getenv("SLEWRIGHT_FMU_PYTHON");
  snprintf(script, sizeof script, "%spython.txt", resources);
  FILE *file = fopen(script, "r");
  if (file && fgets(named, sizeof named, file)) named[strcspn(named, "\r\n")] = 0;
  if (file) fclose(file);
  snprintf(script, sizeof script, "%sserver.py", resources);
  if (fd == CHILD_FD) fcntl(fd, F_SETFD, 0);
  else dup2(fd, CHILD_FD);
  dup2(2, 1); /* what the class prints must not disturb the importer's output */
  const bool chosen = own && *own; /* by the user, so that no other one takes its place */
  const char *const choices[] = {chosen ? own : named, chosen ? "" : "python3"};
  for (int i = 0; i < 2; i++)
    if (*choices[i]) execlp(choices[i], choices[i], script, (char *)NULL);
  fprintf(stderr, "%s cannot be started%s\n", choices[0], chosen ? "; SLEWRIGHT_FMU_PYTHON names it" : ", nor python3");
  _exit(127);
}

static bool start(instance_t *m, const char *resources) {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0) return false;
  for (int i = 0; i < 2; i++) fcntl(ends[i], F_SETFD, FD_CLOEXEC);
  m->child = fork();
  if (m->child == 0) run(resources, ends[1]);
  close(ends[1]);
  m->socket = ends[0];
  return m->child > 0;
}

const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[]) {
  (void)instance, (void)on, (void)n, (void)categories;
  return fmi3OK;
}

void fmi3FreeInstance(fmi3Instance instance) {
  if (!instance) return;
  if (SELF->socket >= 0) close(SELF->socket);
  if (SELF->child > 0) {
    kill(SELF->child, SIGTERM);
    waitpid(SELF->child, NULL, 0);
  }
  free(instance);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n_required,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
  (void)name, (void)visible, (void)logging, (void)events, (void)early, (void)required, (void)n_required, (void)update;
  instance_t *m = calloc(1, sizeof *m);
  if (!m) return NULL;
  m->environment = environment, m->log = log, m->socket = -1;
  memcpy(m->cells, starts, sizeof starts);
  if (!resources || strcmp(token, TOKEN) != 0) say(m, "another token, or no resources");
  else if (!start(m, resources)) say(m, "no Python process can be started");
  else if (ask(m, 'L', NULL, 0, NULL, 0, NULL, NULL) == fmi3OK) return m;
  fmi3FreeInstance(m);
  return NULL;
}

/* ---- stepping ---- */

static fmi3Status exchange(instance_t *m, char what, double t, double h) {
  uint32_t length = 0;
  m->request[0] = t, m->request[1] = h;
  memcpy(m->request + 2, m->cells, sizeof m->cells);
  const fmi3Status status =
      ask(m, what, m->request, sizeof m->request, m->answer, sizeof m->answer, NULL, &length);
  if (status != fmi3OK) return status;
  if (length != sizeof m->answer) return say(m, "the Python process gave another number of values");
  memcpy(m->cells, m->answer, sizeof m->answer);
  m->cells[0] = t + h;
  return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean told, fmi3Float64 tolerance,
                                       fmi3Float64 begin, fmi3Boolean ends, fmi3Float64 end) {
  (void)told, (void)tolerance, (void)ends, (void)end;
  SELF->cells[0] = begin;
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) { return exchange(SELF, 'I', SELF->cells[0], 0.0); }

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 h, fmi3Boolean final, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
  (void)final;
  *event = *terminate = *early = false, *reached = t;
  const fmi3Status status = exchange(SELF, 'S', t, h);
  if (status == fmi3OK) *reached = t + h;
  return status;
}
fmi3Status fmi3Terminate(fmi3Instance instance) {
  (void)instance;
  return fmi3OK;
}
fmi3Status fmi3Reset(fmi3Instance instance) {
  memcpy(SELF->cells, starts, sizeof starts);
  return ask(SELF, 'L', NULL, 0, NULL, 0, NULL, NULL);
}

/* ---- values ---- */

#define ACCESS(Name, type, letter, from_cell, to_cell)                                                            \
  fmi3Status fmi3Get##Name(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, type values[],         \
                           size_t n_values) {                                                                     \
    size_t k = 0;                                                                                                 \
    for (size_t i = 0; i < n; i++) {                                                                              \
      if (vr[i] >= N_VARIABLES || variables[vr[i]].kind != letter) return say(SELF, "no variable of that type");  \
      for (unsigned j = 0; j < variables[vr[i]].size && k < n_values; j++, k++)                                   \
        values[k] = from_cell(SELF->cells[variables[vr[i]].first + j]);                                           \
    }                                                                                                             \
    return fmi3OK;                                                                                                \
  }                                                                                                               \
  fmi3Status fmi3Set##Name(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const type values[],   \
                           size_t n_values) {                                                                     \
    size_t k = 0;                                                                                                 \
    for (size_t i = 0; i < n; i++) {                                                                              \
      if (vr[i] >= N_VARIABLES || variables[vr[i]].kind != letter) return say(SELF, "no variable of that type");  \
      for (unsigned j = 0; j < variables[vr[i]].size && k < n_values; j++, k++)                                   \
        SELF->cells[variables[vr[i]].first + j] = to_cell(values[k]);                                             \
    }                                                                                                             \
    return fmi3OK;                                                                                                \
  }
#define AS_IS(x) (x)
#define TO_INT(x) ((fmi3Int32)(x))
#define TO_REAL(x) ((double)(x))
#define TO_BOOL(x) ((x) != 0.0)
#define FROM_BOOL(x) ((x) ? 1.0 : 0.0)
ACCESS(Float64, fmi3Float64, 'd', AS_IS, AS_IS)
ACCESS(Int32, fmi3Int32, 'i', TO_INT, TO_REAL)
ACCESS(Boolean, fmi3Boolean, 'b', TO_BOOL, FROM_BOOL)

/* ---- state ---- */

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state) {
  (void)instance;
  free(*state);
  *state = NULL;
  return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state) {
  char *bytes = NULL;
  uint32_t size = 0;
  const fmi3Status status = ask(SELF, 'G', NULL, 0, NULL, 0, &bytes, &size);
  state_t *made = status == fmi3OK && bytes ? malloc(sizeof *made + size) : NULL;
  if (made) {
    memcpy(made->cells, SELF->cells, sizeof made->cells);
    memcpy(made->bytes, bytes, size);
    made->size = size;
    free(*state);
    *state = made;
  }
  free(bytes);
  return made ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
  const state_t *s = state;
  memcpy(SELF->cells, s->cells, sizeof s->cells);
  return ask(SELF, 'P', s->bytes, s->size, NULL, 0, NULL, NULL);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size) {
  (void)instance;
  *size = sizeof(state_t) + ((state_t *)state)->size;
  return fmi3OK;
}
fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  (void)instance;
  memcpy(bytes, state, size);
  return fmi3OK;
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  if (size < sizeof(state_t)) return say(SELF, "these are no bytes of a state");
  state_t *made = malloc(size);
  if (!made) return fmi3Error;
  memcpy(made, bytes, size);
  if (made->size != size - sizeof(state_t)) {
    free(made);
    return say(SELF, "these are no bytes of a state");
  }
  free(*state);
  *state = made;
  return fmi3OK;
}
