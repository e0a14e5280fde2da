/* Loading an FMU in this process; messages; cells to and from native forms. See fmu.h and binding.h. */
#include <float.h>
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

uint64_t slw_fmu_messages(const slw_fmu *fmu) { return fmu->n_messages; }

/* An empty message would hide the last one that says something. */
void slw_fmu_log(slw_fmu *fmu, const char *message) {
  if (message && *message) slw_fmu_logf(fmu, "%s", message);
}

void slw_fmu_logf(slw_fmu *fmu, const char *format, ...) {
  char *place = fmu->messages[fmu->n_messages % SLW_MESSAGES];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(place, SLW_MESSAGE_SIZE, format, arguments);
  va_end(arguments);
  fmu->n_messages++;
}

bool slw_lines_of(const char *text, slw_lines *lines) {
  const size_t size = strlen(text) + 1;
  *lines = (slw_lines){malloc(size), calloc(size, sizeof *lines->list), 0};
  if (!lines->text || !lines->list) return slw_lines_free(lines), false;
  memcpy(lines->text, text, size);
  for (char *at = lines->text; *at;) {
    char *end = strchr(at, '\n');
    lines->list[lines->n++] = at;
    if (!end) break;
    *end = 0, at = end + 1;
  }
  return true;
}

void slw_lines_free(slw_lines *lines) {
  free(lines->text);
  free(lines->list);
  *lines = (slw_lines){NULL, NULL, 0};
}

slw_status slw_missing(slw_fmu *fmu, const char *name) {
  slw_fmu_logf(fmu, "the FMU lacks the function %s", name);
  return SLW_ERROR;
}

slw_status slw_status_of(slw_fmu *fmu, int status, const char *function) {
  if (status == SLW_FATAL) fmu->fatal = true;
  if (status >= SLW_OK && status <= SLW_FATAL) return (slw_status)status;
  if (status == SLW_PENDING) {
    fmu->fatal = true; /* its step still runs */
    slw_fmu_logf(fmu, "%s returned Pending; asynchronous steps are not supported", function);
  } else {
    slw_fmu_logf(fmu, "%s returned the unknown status %d", function, status);
  }
  return SLW_ERROR;
}

/* ---- libraries ---- */

#ifdef _WIN32
void *slw_library_open(const char *path, char *error, size_t error_size) {
  wchar_t wide[1024];
  HMODULE library = NULL;
  /* The altered search path finds libraries beside the FMU's own. */
  if (MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 1024))
    library = LoadLibraryExW(wide, NULL, LOAD_WITH_ALTERED_SEARCH_PATH);
  if (!library) snprintf(error, error_size, "the loader's error %lu", (unsigned long)GetLastError());
  return (void *)library;
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

bool slw_version_is(const char *expected, const char *version, char *error, size_t error_size) {
  if (version && strncmp(version, expected, strlen(expected)) == 0) return true;
  snprintf(error, error_size, "its library says it is of FMI %.40s, its description %s0",
           version ? version : "(none)", expected);
  return false;
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
  if (size > SIZE_MAX / 4) return false;
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

#define EACH for (size_t i = 0; i < g->n; i++)

static slw_blob *blob_of(const slw_group *g, size_t i) { return &g->blobs[g->cells[i].integer]; }
static const char *text_of(const slw_blob *blob) { return blob->data ? blob->data : ""; }

/* The variable is named by its value reference, which is all that is known here. */
static bool too_large(slw_fmu *fmu, const char *type, const slw_group *g, size_t i) {
  if (g->type == SLW_FLOAT32) {
    slw_fmu_logf(fmu, "%.17g does not fit the type %s of variable %u", g->cells[i].real, type, g->vr[0]);
  } else {
    slw_fmu_logf(fmu, "%lld does not fit the type %s of variable %u", (long long)g->cells[i].integer, type,
                 g->vr[g->n == g->n_vr ? i : 0]);
  }
  return false;
}

/* A whole number of another type, or one that a mapping made, may be out of range. */
#define TO(type, low, high)                                              \
  EACH {                                                                 \
    const int64_t x = g->cells[i].integer;                               \
    if (x < (low) || x > (high)) return too_large(fmu, #type, g, i);     \
    ((type *)g->native)[i] = (type)x;                                    \
  }                                                                      \
  return true
#define FROM(type)                                             \
  EACH g->cells[i].integer = (int64_t)((type *)g->native)[i]; \
  return true

static bool floats_to_native(slw_fmu *fmu, const slw_group *g) {
  EACH {
    const double x = g->cells[i].real;
    const bool finite = x - x == 0.0;
    if (finite && (x > FLT_MAX || x < -FLT_MAX)) return too_large(fmu, "float", g, i);
    ((float *)g->native)[i] = (float)x;
  }
  return true;
}

static bool booleans_to_native(int fmi_version, const slw_group *g) {
  EACH {
    const bool on = g->cells[i].integer != 0;
    if (fmi_version == 2) ((int32_t *)g->native)[i] = on;
    else ((bool *)g->native)[i] = on;
  }
  return true;
}

static bool binaries_to_native(const slw_group *g) {
  const void **data = g->native;
  size_t *size = (size_t *)(data + g->n);
  EACH data[i] = text_of(blob_of(g, i)), size[i] = blob_of(g, i)->size;
  return true;
}

bool slw_to_native(slw_fmu *fmu, const slw_group *g) {
  if (!g->native) return true;
  switch (g->type) {
    case SLW_FLOAT32: return floats_to_native(fmu, g);
    case SLW_INT8: TO(int8_t, INT8_MIN, INT8_MAX);
    case SLW_UINT8: TO(uint8_t, 0, UINT8_MAX);
    case SLW_INT16: TO(int16_t, INT16_MIN, INT16_MAX);
    case SLW_UINT16: TO(uint16_t, 0, UINT16_MAX);
    case SLW_INT32: TO(int32_t, INT32_MIN, INT32_MAX);
    case SLW_UINT32: TO(uint32_t, 0, UINT32_MAX);
    case SLW_STRING: EACH((const char **)g->native)[i] = text_of(blob_of(g, i)); return true;
    case SLW_BINARY: return binaries_to_native(g);
    case SLW_BOOLEAN: case SLW_CLOCK:
      return booleans_to_native(fmu->fmi_version, g);
    default: return true;
  }
}

/* Foreign code may put any byte into a bool: read it as one. */
static bool booleans_from_native(int fmi_version, const slw_group *g) {
  const int32_t *words = g->native;
  const unsigned char *bytes = g->native;
  EACH g->cells[i].integer = fmi_version == 2 ? words[i] != 0 : bytes[i] != 0;
  return true;
}

static bool no_memory(slw_fmu *fmu, size_t size) {
  slw_fmu_logf(fmu, "no memory for a value of %zu bytes", size);
  return false;
}

static bool strings_from_native(slw_fmu *fmu, const slw_group *g) {
  const char **strings = g->native;
  EACH {
    const char *s = strings[i] ? strings[i] : "";
    if (!slw_blob_write(blob_of(g, i), s, strlen(s))) return no_memory(fmu, strlen(s));
  }
  return true;
}

static bool binaries_from_native(slw_fmu *fmu, const slw_group *g) {
  const void **data = g->native;
  const size_t *size = (const size_t *)(data + g->n);
  EACH {
    const size_t n = data[i] ? size[i] : 0;
    if (!slw_blob_write(blob_of(g, i), data[i], n)) return no_memory(fmu, n);
  }
  return true;
}

bool slw_from_native(slw_fmu *fmu, const slw_group *g) {
  if (!g->native) return true;
  switch (g->type) {
    case SLW_FLOAT32: EACH g->cells[i].real = (double)((float *)g->native)[i]; return true;
    case SLW_INT8: FROM(int8_t);
    case SLW_UINT8: FROM(uint8_t);
    case SLW_INT16: FROM(int16_t);
    case SLW_UINT16: FROM(uint16_t);
    case SLW_INT32: FROM(int32_t);
    case SLW_UINT32: FROM(uint32_t);
    case SLW_STRING: return strings_from_native(fmu, g);
    case SLW_BINARY: return binaries_from_native(fmu, g);
    case SLW_BOOLEAN: case SLW_CLOCK:
      return booleans_from_native(fmu->fmi_version, g);
    default: return true;
  }
}
