/* FMI 3.0 co-simulation over network.h: variables, clocks and binaries, modes, states. Nothing of a bus is here. */
#include "network.h"

#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"

enum { FLOAT64, UINT32, BOOLEAN };
enum { PORT_VR = NW_PORT_VR, PER_PORT = 4, RX_DATA = 0, TX_DATA, RX_CLOCK, TX_CLOCK };
typedef enum { NEW, INITIALISING, STEPPING, EVENTS, ENDED, FAILED } Mode;

typedef struct {
  fmi3ValueReference vr;
  int type;
  double start, low, high;
} Variable;

#define ROW(vr, type, start, low, high) {vr, type, start, low, high},
static const Variable variables[NW_VALUES] = {NW_TABLE(ROW)}; /* by value reference */

typedef struct {
  NwNode node;
  Mode mode;
  int event_mode;
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
} Instance;

static Instance *cast(fmi3Instance c) { return (Instance *)c; }

static fmi3Status fail(Instance *i, const char *message) {
  if (i->log) i->log(i->environment, fmi3Error, "logStatusError", message);
  return fmi3Error;
}

static fmi3Status failed(Instance *i) {
  i->mode = FAILED;
  return fail(i, i->node.message);
}

static void reset(Instance *i) {
  memset(&i->node, 0, sizeof i->node);
  for (int k = 0; k < NW_VALUES; k++) i->node.value[k] = variables[k].start;
  i->mode = NEW;
}

/* ---- life cycle ---- */

FMI3_Export const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)resources, (void)visible, (void)logging, (void)early_return, (void)intermediate, (void)update;
  if (!name || !token) return NULL;
  Instance *i = (Instance *)calloc(1, sizeof *i);
  if (!i) return NULL;
  i->environment = environment, i->log = log, i->event_mode = event_mode;
  reset(i);
  if (n_intermediate == 0 && strcmp(token, NW_TOKEN) == 0) return i;
  fail(i, n_intermediate ? "intermediate variables are not supported"
                         : "the token is not that of this FMU's modelDescription.xml");
  free(i);
  return NULL;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  if (cast(c)->mode != NEW) return fail(cast(c), "initialisation mode: already initialised");
  cast(c)->node.start = start;
  cast(c)->mode = INITIALISING;
  return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  if (cast(c)->mode != INITIALISING) return fail(cast(c), "not in initialisation mode");
  nw_start(&cast(c)->node);
  cast(c)->mode = cast(c)->event_mode ? EVENTS : STEPPING;
  return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
  cast(c)->mode = ENDED;
  return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c) {
  reset(cast(c));
  return fmi3OK;
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
  return cast(c)->mode == NEW ? fmi3OK : fail(cast(c), "configuration mode: already initialised");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
  (void)c;
  return fmi3OK;
}

/* ---- steps and events ---- */

static int64_t ns(double s) { return (int64_t)(s * 1e9 + 0.5); }

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_state_before,
                      fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_time) {
  Instance *i = cast(c);
  (void)no_set_state_before;
  if (event_needed) *event_needed = fmi3False;
  if (terminate) *terminate = fmi3False;
  if (early_return) *early_return = fmi3False;
  if (i->mode != STEPPING) return fail(i, "fmi3DoStep outside step mode");
  const int64_t until = ns(time + step - i->node.start);
  if (until <= i->node.now) return fail(i, "fmi3DoStep: a step of less than 1 ns");
  if (!nw_step(&i->node, until)) return failed(i);
  i->node.now = until;
  for (int k = 0; k < NW_PORTS; k++) {
    NwBuffer *sent = &i->node.port[k].sent;
    if (sent->overflowed) return fail(i, "more operations at once than the binary may hold");
    if (!i->event_mode) sent->size = 0; /* nobody will come for it */
    if (sent->size && event_needed) *event_needed = fmi3True;
  }
  if (last_time) *last_time = time + step;
  return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
  Instance *i = cast(c);
  if (i->mode != STEPPING || !i->event_mode) return fail(i, "event mode: not in step mode, or instantiated without");
  for (int k = 0; k < NW_PORTS; k++) i->node.port[k].sent_now = i->node.port[k].sent.size != 0;
  i->mode = EVENTS;
  return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next) {
  Instance *i = cast(c);
  *more = *terminate = *nominals = *values = *defined = fmi3False, *next = 0.0;
  if (i->mode != EVENTS) return fail(i, "fmi3UpdateDiscreteStates outside event mode");
  for (int k = 0; k < NW_PORTS; k++) { /* what is sent now is gone */
    if (i->node.port[k].sent_now) i->node.port[k].sent.size = 0;
    i->node.port[k].sent_now = 0;
  }
  for (int k = 0; k < NW_PORTS; k++) {
    if (i->node.port[k].received_now && !nw_receive(&i->node, k)) return failed(i);
    i->node.port[k].received_now = 0, i->node.port[k].received.size = 0;
  }
  return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
  (void)c;
  return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance c) {
  if (cast(c)->mode != EVENTS) return fail(cast(c), "step mode: not in event mode");
  cast(c)->mode = STEPPING;
  return fmi3OK;
}

/* ---- numbers ---- */

static int place_of(fmi3ValueReference vr, int type) {
  int low = 0, high = NW_VALUES - 1;
  while (low <= high) {
    const int middle = (low + high) / 2;
    if (variables[middle].vr == vr) return variables[middle].type == type ? middle : -1;
    if (variables[middle].vr < vr) low = middle + 1;
    else high = middle - 1;
  }
  return -1;
}

static fmi3Status put(Instance *i, fmi3ValueReference vr, int type, double x) {
  const int k = place_of(vr, type);
  if (k < 0) return fail(i, "no such variable of this type");
  if (!(x >= variables[k].low && x <= variables[k].high)) return fail(i, "a value out of its range");
  i->node.value[k] = x;
  return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[], size_t nv) {
  for (size_t k = 0; k < n && k < nv; k++) {
    const int place = vr[k] == NW_TIME_VR ? 0 : place_of(vr[k], FLOAT64);
    if (place < 0) return fail(cast(c), "no such variable of type Float64");
    value[k] = vr[k] == NW_TIME_VR ? cast(c)->node.start + 1e-9 * (double)cast(c)->node.now
                                   : cast(c)->node.value[place];
  }
  return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 value[],
                          size_t nv) {
  for (size_t k = 0; k < n && k < nv; k++)
    if (put(cast(c), vr[k], FLOAT64, value[k]) != fmi3OK) return fmi3Error;
  return fmi3OK;
}

#define NUMBERS(type, number)                                                                               \
  fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##type value[],     \
                           size_t nv) {                                                                     \
    for (size_t k = 0; k < n && k < nv; k++) {                                                              \
      const int place = place_of(vr[k], number);                                                            \
      if (place < 0) return fail(cast(c), "no such variable of type " #type);                               \
      value[k] = (fmi3##type)cast(c)->node.value[place];                                                    \
    }                                                                                                       \
    return fmi3OK;                                                                                          \
  }                                                                                                         \
  fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3##type value[], \
                           size_t nv) {                                                                     \
    for (size_t k = 0; k < n && k < nv; k++)                                                                \
      if (put(cast(c), vr[k], number, (double)value[k]) != fmi3OK) return fmi3Error;                        \
    return fmi3OK;                                                                                          \
  }
NUMBERS(UInt32, UINT32)
NUMBERS(Boolean, BOOLEAN)

/* ---- binaries and clocks ---- */

/* The port that a variable of this kind belongs to; -1: none. */
static int port_of(fmi3ValueReference vr, int kind) {
  if (vr < PORT_VR || vr >= PORT_VR + PER_PORT * NW_PORTS || (int)(vr - PORT_VR) % PER_PORT != kind) return -1;
  return (int)(vr - PORT_VR) / PER_PORT;
}

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[], fmi3Binary value[],
                         size_t nv) {
  for (size_t k = 0; k < n && k < nv; k++) {
    const int sent = port_of(vr[k], TX_DATA), received = port_of(vr[k], RX_DATA);
    if (sent < 0 && received < 0) return fail(cast(c), "no such variable of type Binary");
    const NwPort *port = &cast(c)->node.port[sent < 0 ? received : sent];
    const NwBuffer *buffer = sent < 0 ? &port->received : &port->sent;
    value[k] = buffer->data, sizes[k] = sent >= 0 && !port->sent_now ? 0 : buffer->size;
  }
  return fmi3OK;
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary value[], size_t nv) {
  for (size_t k = 0; k < n && k < nv; k++) {
    const int port = port_of(vr[k], RX_DATA);
    if (port < 0) return fail(cast(c), "no input of type Binary");
    if (sizes[k] > NW_ROOM) return fail(cast(c), "more operations at once than the binary may hold");
    NwBuffer *buffer = &cast(c)->node.port[port].received;
    buffer->size = (uint32_t)sizes[k];
    if (sizes[k]) memcpy(buffer->data, value[k], sizes[k]);
  }
  return fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock value[]) {
  for (size_t k = 0; k < n; k++) {
    const int sent = port_of(vr[k], TX_CLOCK), received = port_of(vr[k], RX_CLOCK);
    if (sent < 0 && received < 0) return fail(cast(c), "no such clock");
    value[k] = sent < 0 ? cast(c)->node.port[received].received_now : cast(c)->node.port[sent].sent_now;
  }
  return fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock value[]) {
  for (size_t k = 0; k < n; k++) {
    const int port = port_of(vr[k], RX_CLOCK);
    if (port < 0 || cast(c)->mode != EVENTS) return fail(cast(c), "no input clock, or not in event mode");
    cast(c)->node.port[port].received_now = value[k];
  }
  return fmi3OK;
}

/* ---- state ---- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(NwNode));
  if (!*state) return fail(cast(c), "out of memory");
  memcpy(*state, &cast(c)->node, sizeof(NwNode));
  return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  if (!state) return fail(cast(c), "fmi3SetFMUState: no state");
  memcpy(&cast(c)->node, state, sizeof(NwNode));
  if (cast(c)->mode == FAILED) cast(c)->mode = STEPPING;
  return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  (void)c;
  if (state) {
    free(*state);
    *state = NULL;
  }
  return fmi3OK;
}

enum { TOKEN = sizeof NW_TOKEN, SERIALISED = TOKEN + sizeof(NwNode) };

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  (void)c, (void)state;
  *size = SERIALISED;
  return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  if (size < SERIALISED) return fail(cast(c), "fmi3SerializeFMUState: buffer too small");
  memcpy(bytes, NW_TOKEN, TOKEN);
  memcpy(bytes + TOKEN, state, sizeof(NwNode));
  return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  if (size != SERIALISED || memcmp(bytes, NW_TOKEN, TOKEN) != 0)
    return fail(cast(c), "the serialised state is not of this FMU and version");
  if (!*state) *state = malloc(sizeof(NwNode));
  if (!*state) return fail(cast(c), "out of memory");
  memcpy(*state, bytes + TOKEN, sizeof(NwNode));
  return fmi3OK;
}
