#if defined(__linux__)
#define _GNU_SOURCE
#include "scan.h"

#include <sys/resource.h>
#include <time.h>

#include "bus.h"
#include "canopen.h"
#include "exchange.h"

enum { OLD_BATCHES = 64 }; /* more than a socket holds */

static void add(void *times, int64_t ns) {
  SlrTimes *t = times;
  const int64_t units = ns < 0 ? 0 : ns / t->unit, bin = units < SLR_SCAN_TIMES_TOP ? units : SLR_SCAN_TIMES_TOP;
  int bits = 0;
  while (bin >> bits) bits++;
  t->bins[bin] += 1;
  t->coarse[bits] += 1;
  t->count += 1;
  if (ns > t->largest) t->largest = ns;
}

/* How often this thread gave the processor away by itself. */
static int64_t waits(void) {
  struct rusage used;
  getrusage(RUSAGE_THREAD, &used);
  return used.ru_nvcsw;
}

/* ---- in ---- */

/* Before the deadline: most frames of a tick wait already.  To take one out of a socket costs the kernel a µs or two,
 * as much as all that is done with it afterwards. */
static void take_early(SlrScan *s) {
  slr_bus_begin(&s->wires);
  slr_bus_take(&s->wires);
  if (!s->devices.state) return;
  slr_bus_begin(&s->devices);
  slr_bus_take(&s->devices);
}

/* Those that came meanwhile. */
static void take(SlrScan *s, SlrBusEnd *bus) {
  const int64_t begun = slr_now();
  bus->gone = slr_bus_take(bus) < 0;
  s->tick.bus += slr_now() - begun;
}

static void give(SlrScan *s, SlrBusEnd *bus, int count) {
  const int64_t begun = slr_now();
  slr_bus_give(bus, count);
  s->tick.bus += slr_now() - begun;
}

static void look_for_others(SlrBusEnd *bus, SlrBus *said, int64_t *flags, int64_t ours, int64_t tick) {
  if (bus->gone) {
    said->off = 1;
    *flags |= SLR_FLAG_BUS_OFF;
  }
  if (ours != bus->heard) {
    bus->heard = ours;
    bus->another = tick + SLR_SCAN_SHOWN_TICKS;
  }
  bus->flags = *flags | (bus->alone && tick < bus->another ? SLR_FLAG_OTHER_CONTROLLER : 0);
}

static void hear_wires(SlrScan *s) {
  SlrBusEnd *bus = &s->wires;
  SlrWire *w = bus->state;
  bus->now = slr_now();
  take(s, bus);
  slr_wire_receive(w, bus->came, (int)bus->count, s->tick.number, bus->now, s->inputs);
  look_for_others(bus, &w->bus, &w->flags, w->ours, s->tick.number);
}

static void drop(SlrBusEnd *bus) {
  int found = 1;
  for (int i = 0; found > 0 && i < OLD_BATCHES; i++) {
    slr_bus_begin(bus);
    found = slr_bus_take(bus);
  }
  slr_bus_begin(bus);
}

/* The devices' settings that are in force; a new one is as good as a heartbeat.  Before the first time, what has waited
 * until then is dropped. */
static void accept_devices(SlrDevices *d, SlrBusEnd *bus, int64_t tick) {
  SlrCanopen *c = bus->state;
  int64_t numbers[SLR_CANOPEN_NODES];
  if (!d->accepted.memory || slr_cell_number(&d->accepted) == d->seen) return;
  if (!d->seen) drop(bus);
  const int64_t found = slr_cell_read(&d->accepted, numbers);
  if (!found) return;
  d->seen = found;
  for (int n = 0; n < SLR_CANOPEN_NODES; n++) {
    if (numbers[n] && numbers[n] != c->accepted[n]) c->beat[n] = tick;
    c->accepted[n] = numbers[n];
  }
}

/* Which settings are not in force any more. */
static void tell_spent(const SlrDevices *d, const SlrCanopen *c, const int64_t before[SLR_CANOPEN_NODES]) {
  int changed = 0;
  for (int n = 0; n < SLR_CANOPEN_NODES; n++) changed |= c->spent[n] != before[n];
  const SlrPart part = {c->spent, sizeof c->spent};
  if (d->spent.memory && (changed || !slr_cell_number(&d->spent))) slr_cell_write(&d->spent, &part, 1);
}

static void hear_devices(SlrScan *s) {
  SlrBusEnd *bus = &s->devices;
  SlrCanopen *c = bus->state;
  int64_t spent[SLR_CANOPEN_NODES];
  if (!c) return;
  accept_devices(&s->setting, bus, s->tick.number);
  for (int n = 0; n < SLR_CANOPEN_NODES; n++) spent[n] = c->spent[n];
  take(s, bus);
  bus->now = slr_now();
  slr_canopen_receive(c, bus->came, (int)bus->count, s->tick.number, bus->now, s->inputs);
  look_for_others(bus, &c->bus, &c->flags, c->ours, s->tick.number);
  tell_spent(&s->setting, c, spent);
}

static int64_t read_all(SlrScan *s) {
  SlrInput *in = s->inputs;
  in->tick = s->tick.number;
  in->overruns = (int32_t)((SlrScanCounts *)s->counts)->overruns;
  hear_wires(s);
  hear_devices(s);
  if (s->planner.present) slr_hear_planner(&s->planner, in, slr_now());
  if (s->outside.present) slr_hear_outside(&s->outside, in, slr_now());
  return (s->attends ? SLR_ATTEND_ALWAYS : 0) | (s->wires.gone || s->devices.gone ? SLR_ATTEND_BUS : 0);
}

/* ---- between ---- */

static uint32_t flags_of(SlrScan *s) {
  const int64_t tick = s->tick.number;
  uint32_t flags = (uint32_t)(s->granted | s->wires.flags | s->devices.flags);
  if (s->planner.present && s->planner.lost) flags |= SLR_FLAG_MODBUS_LOST;
  if (tick < s->stolen_until) flags |= SLR_FLAG_STOLEN_TIME;
  flags |= slr_page_flags(s) | slr_retain_flags(&s->published, tick) | slr_record_flags(&s->record, tick);
  ((SlrScanCounts *)s->counts)->flags_seen |= flags;
  return flags;
}

/* A policy computes in every fifth tick from the beginning of automatic mode on. */
static void find_policy(SlrScan *s) {
  const int64_t automatic = (int32_t)((SlrOutput *)s->outputs)->value[SLR_OUT_control_mode] == SLR_MODE_AUTOMATIC;
  if (automatic && !s->automatic) s->phase = s->tick.number % SLR_SCAN_POLICY_EVERY;
  s->automatic = automatic;
  s->policy = s->tick.number % SLR_SCAN_POLICY_EVERY == s->phase;
}

static void step(SlrScan *s) {
  const int64_t begun = slr_now();
  slr_step(s->inputs, s->core, s->tick.number, s->outputs);
  const int64_t took = slr_now() - begun;
  find_policy(s);
  add(s->step, took);
  if (s->policy) add(s->policy_step, took);
}

/* ---- out ---- */

static void write_all(SlrScan *s) {
  const int64_t tick = s->tick.number;
  SlrBusEnd *wires = &s->wires, *devices = &s->devices;
  give(s, wires, slr_wire_send(wires->state, s->outputs, tick, wires->going));
  if (devices->state) give(s, devices, slr_canopen_send(devices->state, s->outputs, tick, devices->going));
  if (s->planner.image.memory) slr_show_images(&s->planner, s->inputs, s->outputs, slr_now());
  slr_show_page(s);
  slr_publish(s);
}

/* ns from a new sensor message to the command that rests on it; -1 without one. */
static int64_t latency_of(SlrScan *s) {
  const SlrWire *w = s->wires.state;
  const SlrCanopen *c = s->devices.state;
  const int64_t received = c && c->stamp > w->stamp ? c->stamp : w->stamp;
  if (!received || received == s->received) return -1;
  s->received = received;
  add(s->latency, s->tick.sent - received);
  return s->tick.sent - received;
}

void slr_scan_account(SlrScan *s, int64_t end, int64_t used, int64_t own_wait) {
  SlrScanCounts *c = s->counts;
  const int64_t late = s->tick.woke - s->tick.deadline, work = end - s->tick.woke;
  c->ticks += 1;
  add(s->lateness, late);
  add(s->policy ? s->policy_work : s->other_work, work);
  /* wall time of the work in which the thread did not run: work - used */
  if (late > SLR_SCAN_STOLEN_NS || (work - used > SLR_SCAN_STOLEN_NS && !own_wait)) {
    c->stolen += 1;
    s->stolen_until = s->tick.number + SLR_SCAN_SHOWN_TICKS;
  }
  const int too_long = used > SLR_SCAN_PERIOD_NS || (own_wait && work > SLR_SCAN_PERIOD_NS);
  c->overruns += end - s->tick.deadline > SLR_SCAN_PERIOD_NS && too_long;
}

/* ---- what the runtime calls ---- */

const char *slr_scan_layout(void) { return SLR_SCAN_LAYOUT; }
size_t slr_scan_size(void) { return sizeof(SlrScan); }
void slr_scan_prepare(void) { slr_memory_prepare(); }

/* Clocks of the thread take a system call each, so they are read only where they decide something. */
static void account(SlrScan *s) {
  const int64_t end = slr_now();
  const int on_time = end - s->tick.woke <= SLR_SCAN_STOLEN_NS && end - s->tick.deadline <= SLR_SCAN_PERIOD_NS;
  add(s->bus, s->tick.bus);
  if (on_time)
    slr_scan_account(s, end, end - s->tick.woke, 0);
  else
    slr_scan_account(s, end, slr_cpu() - s->tick.cpu, waits() != s->tick.waited);
}

int64_t slr_scan(SlrScan *s, int64_t tick, int64_t deadline) {
  const int64_t waited = waits(); /* so far; from here on the thread keeps the processor */
  take_early(s);
  while (s->waits && slr_now() < deadline) continue;
  s->tick = (SlrScanTick){.number = tick, .deadline = deadline, .woke = slr_now(), .cpu = slr_cpu(), .waited = waited};
  s->tick.attend = read_all(s);
  if (!s->tick.attend) slr_scan_rest(s);
  return s->tick.attend;
}

void slr_scan_rest(SlrScan *s) {
  slr_decide(s);
  ((SlrInput *)s->inputs)->flags = flags_of(s);
  slr_keep_state(s);
  step(s);
  write_all(s);
  s->tick.sent = slr_now();
  s->tick.used = slr_cpu() - s->tick.cpu;
  slr_record(s, latency_of(s));
  account(s);
}
#endif
