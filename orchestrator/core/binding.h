/* What fmi2.c and fmi3.c share: the loaded library, cells to and from an FMU's own form. Internal. */
#ifndef SLW_BINDING_H
#define SLW_BINDING_H

#include "fmu.h"

/* A shared library and its functions. */
void *slw_library_open(const char *path, char *error, size_t error_size);
void slw_library_close(void *library);
/* Copies the address of a function into `function` (a pointer to a function pointer); false: not there. */
bool slw_library_symbol(void *library, const char *name, void *function);
/* Whether a library's version (NULL: none told) starts with `expected`; else says so in `error`. */
bool slw_version_is(const char *expected, const char *version, char *error, size_t error_size);

/* cells -> group->native; false, and said, when a number does not fit the FMU's type. */
bool slw_to_native(slw_fmu *fmu, const slw_group *group);
/* group->native -> cells; false, and said, without memory for a string or binary. */
bool slw_from_native(slw_fmu *fmu, const slw_group *group);

/* Set a blob's content; false: no memory. */
bool slw_blob_write(slw_blob *blob, const void *data, size_t size);

/* Append a formatted message. */
void slw_fmu_logf(slw_fmu *fmu, const char *format, ...);

/* The lines of a text; `list` points into `text`, both of which slw_lines_free frees. */
typedef struct {
  char *text;
  const char **list;
  size_t n;
} slw_lines;
bool slw_lines_of(const char *text, slw_lines *lines); /* false: no memory */
void slw_lines_free(slw_lines *lines);

/* Where a function that the FMU lacks is called. */
slw_status slw_missing(slw_fmu *fmu, const char *name);

/* FMI's numbers to ours; what is none of them is an error, and said. Notes what is fatal. */
slw_status slw_status_of(slw_fmu *fmu, int status, const char *function);

slw_fmu *slw_fmi2_load(const slw_fmu_options *options, char *error, size_t error_size);
slw_fmu *slw_fmi3_load(const slw_fmu_options *options, char *error, size_t error_size);

#endif
