/* What moody2.c and moody3.c share: one call of a chosen function, from t = 0.05 s on, returns a chosen status,
 * and one step tells a chosen time. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NOTHING, SET, GET, STEP, TERMINATE, ENTER, LEAVE, ENTER_EVENT, UPDATE, ENTER_STEP, GET_STATE, SET_STATE };
enum { UNTOLD, TOLD, TOLD_NAN, TOLD_INF };
/* Value references. */
enum { U = 1, Y, LEAST, OFFSET, FUNCTION = 10, STATUS, KIND, EARLY, ALWAYS };

typedef struct {
  double u, y, least, offset, time, told;
  int function, status, kind, early, always, fired;
} Moody;

/* What `function` returns now. */
static int mood(Moody *m, int function) {
  const int late = m->time > 0.0499 || function == ENTER || function == LEAVE;
  if (m->function != function || !late || (m->fired && !m->always)) return 0;
  m->fired = 1;
  return m->status;
}

static double *real(Moody *m, unsigned vr) {
  return vr == U ? &m->u : vr == Y ? &m->y : vr == LEAST ? &m->least : &m->offset;
}

static int *whole(Moody *m, unsigned vr) {
  int *const places[] = {&m->function, &m->status, &m->kind, &m->early, &m->always};
  return places[vr - FUNCTION];
}

static Moody *made(void) {
  Moody *m = calloc(1, sizeof *m);
  if (m) m->least = 1e9;
  return m;
}

/* One step: its status; m->told is the time that it says it reached, where `kind` says so. */
static int step(Moody *m, double t, double h) {
  const int before = m->fired;
  if (h < m->least) m->least = h;
  m->time = t;
  const int status = mood(m, STEP), moody = m->fired && !before;
  m->told = m->kind == TOLD_NAN ? (double)NAN : m->kind == TOLD_INF ? (double)INFINITY : t + m->offset * h;
  if (!moody) m->told = t + h;
  const double got = m->kind == UNTOLD ? t : m->told;
  const double reached = status == 2 || (moody && m->early) ? got : t + h;
  if (status <= 1 || (reached > t && reached <= t + 1.001 * h)) m->y += m->u * (reached - t), m->time = reached;
  if (!moody && status == 2) m->told = t;
  return status;
}
