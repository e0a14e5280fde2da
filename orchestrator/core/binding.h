/* What fmi2.c and fmi3.c share: the loaded library, cells to and from an FMU's own form. Internal. */
#ifndef SLW_BINDING_H
#define SLW_BINDING_H

#include "fmu.h"

/* A shared library and its functions. */
void *slw_library_open(const char *path, char *error, size_t error_size);
void slw_library_close(void *library);
/* Copies the address of a function into `function` (a pointer to a function pointer); false: not there. */
bool slw_library_symbol(void *library, const char *name, void *function);

/* cells -> group->native, and back. */
void slw_to_native(int fmi_version, const slw_group *group);
slw_status slw_from_native(int fmi_version, const slw_group *group);

/* Set a blob's content; false: no memory. */
bool slw_blob_write(slw_blob *blob, const void *data, size_t size);

/* "<name> returned ..." etc.: append a formatted message. */
void slw_fmu_logf(slw_fmu *fmu, const char *format, ...);

/* Where a function that the FMU lacks is called. */
slw_status slw_missing(slw_fmu *fmu, const char *name);

/* FMI's numbers to ours; what is none of them is an error, and said. */
slw_status slw_status_of(slw_fmu *fmu, int status, const char *function);

slw_fmu *slw_fmi2_load(const slw_fmu_options *options, char *error, size_t error_size);
slw_fmu *slw_fmi3_load(const slw_fmu_options *options, char *error, size_t error_size);

#endif
