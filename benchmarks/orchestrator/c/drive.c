/* What the benchmark compares with: the least that a master can do (the floor), and a loop around one FMU.
 *
 * The floor: three links, direct calls, values exchanged as Jacobi does, a row of time and four signals a
 * step into memory, no checks. The loop: a container FMU of the same chain, its doStep, the same four signals
 * by one get, the same row. Both measure themselves; only the loop is inside the clock readings. */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fmi/fmi2Functions.h"
#include "fmi/fmi3Functions.h"
#include "link.h"

#define EXPORT __attribute__((visibility("default")))
#define SIGNALS 4
#define ROW (1 + SIGNALS)

typedef struct {
  void *instance;
  fmi2DoStepTYPE *step2;
  fmi2SetRealTYPE *set2;
  fmi2GetRealTYPE *get2;
  fmi3DoStepTYPE *step3;
  fmi3SetFloat64TYPE *set3;
  fmi3GetFloat64TYPE *get3;
} fmu_t;

typedef struct drive {
  fmu_t fmu[3];
  bool (*loop)(struct drive *, int64_t); /* false: the FMU failed */
  double h;
  int64_t tick;
  double y[SIGNALS]; /* of the chain: y of the three links, rate of the last */
  unsigned vr[SIGNALS];
  double *log; /* rows of one run, written over by the next */
} drive_t;

static void quiet2(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
  (void)e, (void)name, (void)status, (void)category, (void)message;
}
static const fmi2CallbackFunctions callbacks = {quiet2, calloc, free, NULL, NULL};

static void quiet3(fmi3InstanceEnvironment e, fmi3Status status, fmi3String category, fmi3String message) {
  (void)e, (void)status, (void)category, (void)message;
}

static bool open2(fmu_t *f, void *library, const char *token, const char *resources) {
  *(void **)&f->step2 = dlsym(library, "fmi2DoStep");
  *(void **)&f->set2 = dlsym(library, "fmi2SetReal");
  *(void **)&f->get2 = dlsym(library, "fmi2GetReal");
  fmi2InstantiateTYPE *instantiate;
  *(void **)&instantiate = dlsym(library, "fmi2Instantiate");
  fmi2SetupExperimentTYPE *setup;
  *(void **)&setup = dlsym(library, "fmi2SetupExperiment");
  fmi2EnterInitializationModeTYPE *enter, *leave;
  *(void **)&enter = dlsym(library, "fmi2EnterInitializationMode");
  *(void **)&leave = dlsym(library, "fmi2ExitInitializationMode");
  f->instance = instantiate("fmu", fmi2CoSimulation, token, resources, &callbacks, fmi2False, fmi2False);
  return f->instance && setup(f->instance, fmi2False, 0, 0, fmi2False, 0) == fmi2OK &&
         enter(f->instance) == fmi2OK && leave(f->instance) == fmi2OK;
}

static bool open3(fmu_t *f, void *library, const char *token, const char *resources) {
  *(void **)&f->step3 = dlsym(library, "fmi3DoStep");
  *(void **)&f->set3 = dlsym(library, "fmi3SetFloat64");
  *(void **)&f->get3 = dlsym(library, "fmi3GetFloat64");
  fmi3InstantiateCoSimulationTYPE *instantiate;
  *(void **)&instantiate = dlsym(library, "fmi3InstantiateCoSimulation");
  fmi3EnterInitializationModeTYPE *enter;
  *(void **)&enter = dlsym(library, "fmi3EnterInitializationMode");
  fmi3ExitInitializationModeTYPE *leave;
  *(void **)&leave = dlsym(library, "fmi3ExitInitializationMode");
  f->instance = instantiate("fmu", token, resources, false, false, false, false, NULL, 0, NULL, quiet3, NULL);
  return f->instance && enter(f->instance, false, 0, 0, false, 0) == fmi3OK && leave(f->instance) == fmi3OK;
}

static bool open_fmu(fmu_t *f, int fmi_version, const char *path, const char *token, const char *resources) {
  void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  if (!library) {
    fprintf(stderr, "%s\n", dlerror());
    return false;
  }
  return fmi_version == 2 ? open2(f, library, token, resources) : open3(f, library, token, resources);
}

static inline void write_row(const drive_t *d, double *row, const double *y) {
  row[0] = (double)d->tick * d->h;
  for (int k = 0; k < SIGNALS; k++) row[1 + k] = y[k];
}

static const unsigned input[] = {LINK_U}, output[] = {LINK_Y, LINK_RATE};

static bool floor2(drive_t *d, int64_t steps) {
  const fmu_t a = d->fmu[0], b = d->fmu[1], c = d->fmu[2];
  const double h = d->h;
  double *y = d->y;
  for (int64_t k = 0; k < steps; k++, d->tick++) {
    const double t = (double)d->tick * h;
    write_row(d, d->log + k * ROW, y);
    b.set2(b.instance, input, 1, &y[0]);
    c.set2(c.instance, input, 1, &y[1]);
    a.step2(a.instance, t, h, fmi2True);
    b.step2(b.instance, t, h, fmi2True);
    c.step2(c.instance, t, h, fmi2True);
    a.get2(a.instance, output, 1, &y[0]);
    b.get2(b.instance, output, 1, &y[1]);
    c.get2(c.instance, output, 2, &y[2]);
  }
  return true;
}

static bool floor3(drive_t *d, int64_t steps) {
  const fmu_t a = d->fmu[0], b = d->fmu[1], c = d->fmu[2];
  const double h = d->h;
  double *y = d->y;
  bool event, terminate, early;
  double reached;
  for (int64_t k = 0; k < steps; k++, d->tick++) {
    const double t = (double)d->tick * h;
    write_row(d, d->log + k * ROW, y);
    b.set3(b.instance, input, 1, &y[0], 1);
    c.set3(c.instance, input, 1, &y[1], 1);
    a.step3(a.instance, t, h, true, &event, &terminate, &early, &reached);
    b.step3(b.instance, t, h, true, &event, &terminate, &early, &reached);
    c.step3(c.instance, t, h, true, &event, &terminate, &early, &reached);
    a.get3(a.instance, output, 1, &y[0], 1);
    b.get3(b.instance, output, 1, &y[1], 1);
    c.get3(c.instance, output, 2, &y[2], 2);
  }
  return true;
}

static bool box2(drive_t *d, int64_t steps) {
  const fmu_t f = d->fmu[0];
  const double h = d->h;
  for (int64_t k = 0; k < steps; k++, d->tick++) {
    write_row(d, d->log + k * ROW, d->y);
    if (f.step2(f.instance, (double)d->tick * h, h, fmi2True) != fmi2OK) return false;
    if (f.get2(f.instance, d->vr, SIGNALS, d->y) != fmi2OK) return false;
  }
  return true;
}

static bool box3(drive_t *d, int64_t steps) {
  const fmu_t f = d->fmu[0];
  const double h = d->h;
  bool event, terminate, early;
  double reached;
  for (int64_t k = 0; k < steps; k++, d->tick++) {
    write_row(d, d->log + k * ROW, d->y);
    if (f.step3(f.instance, (double)d->tick * h, h, true, &event, &terminate, &early, &reached) != fmi3OK)
      return false;
    if (f.get3(f.instance, d->vr, SIGNALS, d->y, SIGNALS) != fmi3OK) return false;
  }
  return true;
}

static drive_t *new_drive(double h, size_t rows) {
  drive_t *d = calloc(1, sizeof *d);
  if (!d) return NULL;
  d->h = h;
  d->log = calloc(rows * ROW, sizeof *d->log);
  return d->log ? d : NULL;
}

/* Three links from three libraries, at time 0; NULL if one does not load. `rows`: the most steps of one run. */
EXPORT drive_t *slw_drive_chain(int fmi_version, const char *const libraries[], double h, size_t rows);
EXPORT drive_t *slw_drive_chain(int fmi_version, const char *const libraries[], double h, size_t rows) {
  drive_t *d = new_drive(h, rows);
  for (int i = 0; d && i < 3; i++)
    if (!open_fmu(&d->fmu[i], fmi_version, libraries[i], "link", NULL)) return NULL;
  if (d) d->loop = fmi_version == 2 ? floor2 : floor3;
  return d;
}

/* One container FMU; `vr`: its outputs in the order of drive_t.y. */
EXPORT drive_t *slw_drive_box(int fmi_version, const char *library, const char *token, const char *resources,
                              const unsigned vr[], double h, size_t rows);
EXPORT drive_t *slw_drive_box(int fmi_version, const char *library, const char *token, const char *resources,
                              const unsigned vr[], double h, size_t rows) {
  drive_t *d = new_drive(h, rows);
  if (!d || !open_fmu(&d->fmu[0], fmi_version, library, token, resources)) return NULL;
  for (int k = 0; k < SIGNALS; k++) d->vr[k] = vr[k];
  d->loop = fmi_version == 2 ? box2 : box3;
  return d;
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Seconds that `steps` steps take; negative if the FMU failed. */
EXPORT double slw_drive_run(drive_t *d, int64_t steps);
EXPORT double slw_drive_run(drive_t *d, int64_t steps) {
  const double before = now();
  const bool done = d->loop(d, steps);
  const double after = now();
  return done ? after - before : -1.0;
}

/* The four signals as they stand. */
EXPORT const double *slw_drive_values(const drive_t *d);
EXPORT const double *slw_drive_values(const drive_t *d) { return d->y; }
