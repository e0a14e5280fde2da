/* An FMI 2.0 FMU that, from the step at t = 0.05 s on, does what its parameter `trick` says to the process it
 * runs in; `trick` 20 and above in fmi2Instantiate (chosen by the instance's name) and fmi2FreeInstance. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <fenv.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi/fmi2Functions.h"

enum { NOTHING, SEGFAULT, ABORT, EXIT, HANG, OVERFLOW_STACK, CLOSE_FILES, PRINT, ROUND_DOWN, IGNORE_SIGNALS, FORK,
       CHANGE_FOLDER, UNKNOWN_STATUS, NULL_STRING, KILL_PARENT_INPUT, HANG_IN_FREE, LEAVE_GROUP, CUT_MEMORY };

typedef struct {
  int trick;
  double value;
} villain_t;

const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }

static void hang(void) {
  for (volatile int i = 0;; i++) {}
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
  (void)type, (void)guid, (void)resources, (void)functions, (void)visible, (void)logging;
  if (strcmp(name, "hangs") == 0) hang();
  if (strcmp(name, "crashes") == 0) raise(SIGSEGV);
  return calloc(1, sizeof(villain_t));
}
void fmi2FreeInstance(fmi2Component c) {
  if (((villain_t *)c)->trick == HANG_IN_FREE) hang();
  free(c);
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real t, fmi2Real a, fmi2Boolean e, fmi2Real b) {
  (void)c, (void)d, (void)t, (void)a, (void)e, (void)b;
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
  (void)vr;
  if (n) ((villain_t *)c)->trick = value[0];
  return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
  (void)vr;
  for (size_t i = 0; i < n; i++) value[i] = ((villain_t *)c)->value;
  return fmi2OK;
}
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
  (void)c, (void)vr;
  for (size_t i = 0; i < n; i++) value[i] = NULL;
  return fmi2OK;
}

static volatile char sink;
static void overflow(int depth) {
  volatile char block[4096];
  block[depth % 4096] = (char)depth;
  if (depth >= 0) overflow(depth + 1);
  sink = block[0];
}

/* Cut the memory shared with the master to nothing, where the system lets us name it. */
static void cut_memory(void) {
  char line[512], path[128];
  unsigned long from, to;
  FILE *maps = fopen("/proc/self/maps", "r");
  while (maps && fgets(line, sizeof line, maps)) {
    if (!strstr(line, "memfd:") || sscanf(line, "%lx-%lx", &from, &to) != 2) continue;
    snprintf(path, sizeof path, "/proc/self/map_files/%lx-%lx", from, to);
    if (truncate(path, 0) != 0) break;
  }
  if (maps) fclose(maps);
}

static fmi2Status do_evil(villain_t *v) {
  switch (v->trick) {
    case SEGFAULT: raise(SIGSEGV); break;
    case ABORT: abort();
    case EXIT: exit(7);
    case HANG: hang(); break;
    case OVERFLOW_STACK: overflow(0); break;
    case CLOSE_FILES: for (int fd = 0; fd < 256; fd++) close(fd); break;
    case PRINT: printf("from the villain\n"); fflush(stdout); break;
    case ROUND_DOWN: fesetround(FE_DOWNWARD); break;
    case IGNORE_SIGNALS: for (int s = 1; s < 32; s++) signal(s, SIG_IGN); break;
    case FORK: if (fork() == 0) for (;;) pause(); break;
    case CHANGE_FOLDER: if (chdir("/") != 0) return fmi2Error; break;
    case LEAVE_GROUP: setpgid(0, getpgid(getppid())); hang(); break;
    case CUT_MEMORY: cut_memory(); break;
    case UNKNOWN_STATUS: return (fmi2Status)77;
    default: break;
  }
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean n) {
  villain_t *v = c;
  (void)n;
  v->value = t + h;
  return t > 0.045 ? do_evil(v) : fmi2OK;
}
