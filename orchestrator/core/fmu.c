/* Loading an FMU in this process; messages; cells to and from native forms. See fmu.h and binding.h. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "binding.h"

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

/* ---- messages ---- */

const char *slw_fmu_message(const slw_fmu *fmu, unsigned k) {
  if (k >= fmu->n_messages || k >= SLW_MESSAGES) return "";
  return fmu->messages[(fmu->n_messages - 1 - k) % SLW_MESSAGES];
}

void slw_fmu_log(slw_fmu *fmu, const char *message) { slw_fmu_logf(fmu, "%s", message ? message : ""); }

void slw_fmu_logf(slw_fmu *fmu, const char *format, ...) {
  char *place = fmu->messages[fmu->n_messages % SLW_MESSAGES];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(place, SLW_MESSAGE_SIZE, format, arguments);
  va_end(arguments);
  fmu->n_messages++;
}

slw_status slw_missing(slw_fmu *fmu, const char *name) {
  slw_fmu_logf(fmu, "the FMU lacks the function %s", name);
  return SLW_ERROR;
}

slw_status slw_status_of(slw_fmu *fmu, int status, const char *function) {
  if (status >= SLW_OK && status <= SLW_FATAL) return (slw_status)status;
  if (status == SLW_PENDING) {
    slw_fmu_logf(fmu, "%s returned Pending; asynchronous steps are not supported", function);
  } else {
    slw_fmu_logf(fmu, "%s returned the unknown status %d", function, status);
  }
  return SLW_ERROR;
}

/* ---- libraries ---- */

#ifdef _WIN32
void *slw_library_open(const char *path, char *error, size_t error_size) {
  void *library = (void *)LoadLibraryA(path);
  if (!library) snprintf(error, error_size, "error %lu", (unsigned long)GetLastError());
  return library;
}
void slw_library_close(void *library) { FreeLibrary((HMODULE)library); }
static void *address(void *library, const char *name) {
  return (void *)(uintptr_t)GetProcAddress((HMODULE)library, name);
}
#else
void *slw_library_open(const char *path, char *error, size_t error_size) {
  void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  if (!library) snprintf(error, error_size, "%s", dlerror());
  return library;
}
void slw_library_close(void *library) { dlclose(library); }
static void *address(void *library, const char *name) { return dlsym(library, name); }
#endif

bool slw_library_symbol(void *library, const char *name, void *function) {
  void *found = address(library, name);
  memcpy(function, &found, sizeof found); /* an object pointer does not convert to a function pointer */
  return found != NULL;
}

slw_fmu *slw_fmu_load(const slw_fmu_options *options, char *error, size_t error_size) {
  if (options->fmi_version == 2) return slw_fmi2_load(options, error, error_size);
  if (options->fmi_version == 3) return slw_fmi3_load(options, error, error_size);
  snprintf(error, error_size, "FMI version %d is not supported", options->fmi_version);
  return NULL;
}

/* ---- values ---- */

typedef struct {
  const void *data;
  size_t size;
} slw_native_binary; /* FMI 3 passes two arrays: all pointers, then all sizes */

size_t slw_native_size(int fmi_version, slw_type type) {
  if (fmi_version == 2) {
    if (type == SLW_FLOAT64) return 0;
    return type == SLW_STRING ? sizeof(char *) : sizeof(int32_t);
  }
  switch (type) {
    case SLW_FLOAT32: return sizeof(float);
    case SLW_INT8: case SLW_UINT8: return 1;
    case SLW_INT16: case SLW_UINT16: return 2;
    case SLW_INT32: case SLW_UINT32: return 4;
    case SLW_BOOLEAN: case SLW_CLOCK: return sizeof(bool);
    case SLW_STRING: return sizeof(char *);
    case SLW_BINARY: return sizeof(slw_native_binary);
    default: return 0;
  }
}

bool slw_blob_write(slw_blob *blob, const void *data, size_t size) {
  if (blob->capacity < size + 1) {
    char *grown = realloc(blob->data, 2 * size + 1);
    if (!grown) return false;
    blob->data = grown, blob->capacity = 2 * size + 1;
  }
  if (size) memcpy(blob->data, data, size);
  blob->data[size] = 0;
  blob->size = size;
  return true;
}

void slw_blob_release(slw_blob *blob) {
  free(blob->data);
  memset(blob, 0, sizeof *blob);
}

static const char *text_of(const slw_blob *blob) { return blob->data ? blob->data : ""; }

#define EACH for (size_t i = 0; i < g->n; i++)
#define TO(type, member) EACH((type *)g->native)[i] = (type)g->cells[i].member
#define FROM(type, member, wide) EACH g->cells[i].member = (wide)((type *)g->native)[i]

void slw_to_native(int fmi_version, const slw_group *g) {
  if (!g->native) return;
  if (g->type == SLW_STRING) {
    EACH((const char **)g->native)[i] = text_of(&g->blobs[g->cells[i].integer]);
    return;
  }
  if (fmi_version == 2) {
    TO(int32_t, integer);
    return;
  }
  switch (g->type) {
    case SLW_FLOAT32: TO(float, real); break;
    case SLW_INT8: TO(int8_t, integer); break;
    case SLW_UINT8: TO(uint8_t, integer); break;
    case SLW_INT16: TO(int16_t, integer); break;
    case SLW_UINT16: TO(uint16_t, integer); break;
    case SLW_INT32: TO(int32_t, integer); break;
    case SLW_UINT32: TO(uint32_t, integer); break;
    case SLW_BOOLEAN: case SLW_CLOCK: EACH((bool *)g->native)[i] = g->cells[i].integer != 0; break;
    case SLW_BINARY: {
      const void **data = g->native;
      size_t *size = (size_t *)(data + g->n);
      EACH {
        const slw_blob *b = &g->blobs[g->cells[i].integer];
        data[i] = text_of(b), size[i] = b->size;
      }
      break;
    }
    default: break;
  }
}

static slw_status strings_from_native(const slw_group *g) {
  const char **strings = g->native;
  EACH {
    const char *s = strings[i] ? strings[i] : "";
    if (!slw_blob_write(&g->blobs[g->cells[i].integer], s, strlen(s))) return SLW_ERROR;
  }
  return SLW_OK;
}

static slw_status binaries_from_native(const slw_group *g) {
  const void **data = g->native;
  const size_t *size = (const size_t *)(data + g->n);
  EACH {
    const size_t n = data[i] ? size[i] : 0;
    if (!slw_blob_write(&g->blobs[g->cells[i].integer], data[i], n)) return SLW_ERROR;
  }
  return SLW_OK;
}

slw_status slw_from_native(int fmi_version, const slw_group *g) {
  if (!g->native) return SLW_OK;
  if (g->type == SLW_STRING) return strings_from_native(g);
  if (fmi_version == 2) {
    FROM(int32_t, integer, int64_t);
    if (g->type == SLW_BOOLEAN) EACH g->cells[i].integer = g->cells[i].integer != 0;
    return SLW_OK;
  }
  switch (g->type) {
    case SLW_FLOAT32: FROM(float, real, double); break;
    case SLW_INT8: FROM(int8_t, integer, int64_t); break;
    case SLW_UINT8: FROM(uint8_t, integer, int64_t); break;
    case SLW_INT16: FROM(int16_t, integer, int64_t); break;
    case SLW_UINT16: FROM(uint16_t, integer, int64_t); break;
    case SLW_INT32: FROM(int32_t, integer, int64_t); break;
    case SLW_UINT32: FROM(uint32_t, integer, int64_t); break;
    /* Foreign code may put any byte into a bool: read it as one. */
    case SLW_BOOLEAN: case SLW_CLOCK: EACH g->cells[i].integer = ((const unsigned char *)g->native)[i] != 0; break;
    case SLW_BINARY: return binaries_from_native(g);
    default: break;
  }
  return SLW_OK;
}
