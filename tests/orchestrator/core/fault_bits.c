/* Prints the bits of what every kind of fault makes of a wave, for a comparison of platforms. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "fault.h"

static void print_bits(double y) {
  uint64_t bits;
  memcpy(&bits, &y, sizeof bits);
  printf("%016" PRIx64 "\n", bits);
}

int main(void) {
  static const double a[SLW_N_FAULTS] = {0, 0.3, 0.7, 0.11, 0.1, 0.3, 0.2, 0.03, 1.7, -0.2};
  static const double b[SLW_N_FAULTS] = {0, 0, 0, 0, 0, 4.0, 1.3, 0, 0, 0.4};
  for (int kind = 0; kind < SLW_N_FAULTS; kind++) {
    slw_fault *fault = slw_fault_new((slw_fault_kind)kind, 5, INT64_MAX, a[kind], b[kind], 42, 0.02);
    if (!fault) return 1;
    for (int64_t tick = 0; tick < 500; tick++) {
      const double x = (double)((tick * 37) % 100) * 0.01 - 0.5;
      print_bits(slw_fault_apply(fault, tick, x));
      slw_fault_accept(fault, tick, x);
    }
    slw_fault_free(fault);
  }
  return 0;
}
