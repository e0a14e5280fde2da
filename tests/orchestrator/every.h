/* What every2.c and every3.c share: FMUs with one input, one output, and in FMI 3 arrays, of every type.
 *
 * Variable `vr` = 10 * type + role, types as in orchestrator/core/fmu.h (an enumeration of FMI 3 is 14),
 * roles 1 input, 2 output, 3 array input, 4 array output. A step copies inputs to outputs.
 * Macros leave functions out or make them lie: NO_DOSTEP, NO_STRINGS, NO_VERSION, VERSION, PLATFORM, MUTE. */
#ifndef EVERY_H
#define EVERY_H

#ifdef _WIN32
#define SHOWN __declspec(dllexport)
#else
#define SHOWN __attribute__((visibility("default")))
#endif

#define MOST 8   /* elements of an array */
#define TEXT 64  /* bytes of a string or binary, final 0 included */

enum { IN, OUT, ARRAY_IN, ARRAY_OUT, N_ROLES };
enum { SIZE = 1000, TRICK = 1001, EVENTS = 1002, TICKS = 1003 };

/* What the next step does, as the parameter `trick` says; those below 4 are the status it returns. */
enum {
  FATAL = 4, PENDING = 5,
  UNKNOWN = 6,      /* a status that there is not */
  EARLY, EVENT, END,
  LONG,             /* an error with a message of 5000 characters */
  MANY,             /* an error after 30 messages */
  UGLY,             /* an error with line breaks and escapes */
  WARN_GET, FAIL_GET, WARN_SETUP,
};

/* Instances that are not freed, and calls of one after it returned fatal. */
SHOWN extern int every_live, every_after_fatal;
int every_live, every_after_fatal;

#endif
