/* A small kit for test FMUs: one flat, copyable instance, a table of variables that is generated
 * (variables.h, one for each FMU), the models (models.c) and a shell for each FMI version. */
#ifndef KIT_H
#define KIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KIT_TEXT 256 /* bytes that a string or binary variable holds, the final 0 included */

typedef enum {
  FLOAT64, FLOAT32, INT8, UINT8, INT16, UINT16, INT32, UINT32, INT64, UINT64, BOOLEAN, STRING, BINARY, CLOCK
} kit_type;

typedef union {
  double real;
  int64_t whole; /* also Booleans and clocks */
  uint64_t natural;
} kit_cell;

typedef struct {
  size_t size;
  char data[KIT_TEXT];
} kit_text;

/* The variable of a value reference: cells (or texts) first, first + 1, ...
 * `sized_by`: cell of the structural parameter that is its number of elements, or -1: `size` elements. */
typedef struct {
  kit_type type;
  int first, size, sized_by;
} kit_variable;

#include "variables.h" /* KIT_VARIABLES, KIT_CELLS, KIT_TEXTS, kit_variables[], an enum of the cells by name */

typedef struct {
  kit_cell v[KIT_CELLS];
  kit_text text[KIT_TEXTS];
  double time;        /* s */
  double x, x2;       /* states */
  int64_t count;      /* a discrete state */
  int64_t told;       /* count for which the next tick was told, plus 1 */
  bool initialising;  /* outputs follow what is set */
  bool events;        /* event mode is used */
  bool early;         /* early return is allowed */
  bool terminated;    /* it asked to end the simulation */
} kit_instance;

typedef enum { KIT_OK, KIT_WARNING, KIT_DISCARD, KIT_ERROR } kit_status;

typedef struct {
  double reached; /* s: where the step got to */
  bool event, terminate, early;
} kit_result;

#define R(name) (m->v[name].real)
#define W(name) (m->v[name].whole)
#define N(name) (m->v[name].natural)

/* What a model is. */
void kit_outputs(kit_instance *m);
kit_status kit_step(kit_instance *m, double t, double h, kit_result *result);
void kit_event(kit_instance *m);

/* What a model for model exchange is besides (KIT_EXCHANGE): two states, x and x2, and one event indicator.
 * An event: whether states have changed; the time of the next one, which is in the past where there is none. */
void kit_rates(const kit_instance *m, double dx[2]);
double kit_indicator(const kit_instance *m);
bool kit_happens(kit_instance *m, double *next);

/* The variable of that type with a value reference, or NULL. */
static inline const kit_variable *kit_find(uint32_t vr, kit_type type) {
  return vr < KIT_VARIABLES && kit_variables[vr].type == type ? &kit_variables[vr] : NULL;
}

static inline size_t kit_size(const kit_instance *m, const kit_variable *x) {
  return (size_t)(x->sized_by < 0 ? x->size : (int)m->v[x->sized_by].whole);
}

#endif
