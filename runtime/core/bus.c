#if defined(__linux__)
#define _GNU_SOURCE
#include "bus.h"

#include <errno.h>
#include <sys/socket.h>
#include <time.h>

#include "wire.h"

enum { CAN_FRAME = 16, SECOND = 1000000000 }; /* struct can_frame */
enum { AT_ONCE = MSG_DONTWAIT | MSG_NOSIGNAL };
enum { STAMP = 35 }; /* SO_TIMESTAMPNS, asm-generic/socket.h: a message with seconds and nanoseconds, time of day */

/* struct cmsghdr and struct timespec of a 64-bit Linux, and room for more that is not asked for. */
typedef struct {
  uint64_t length;
  int32_t level, type;
  int64_t s, ns;
  uint8_t room[32];
} Told;
enum { TOLD_BYTES = sizeof(Told) - 32 };

static int64_t clock_ns(clockid_t of) {
  struct timespec t;
  clock_gettime(of, &t);
  return (int64_t)t.tv_sec * SECOND + t.tv_nsec;
}

int64_t slr_now(void) { return clock_ns(CLOCK_MONOTONIC); }
int64_t slr_day(void) { return clock_ns(CLOCK_REALTIME); }
int64_t slr_cpu(void) { return clock_ns(CLOCK_THREAD_CPUTIME_ID); }

/* The driver's time, put on the monotonic clock: it came after the queue was seen empty, and before now. */
static void stamp_frames(const SlrBusEnd *bus, int64_t first, int64_t end) {
  const struct mmsghdr *heads = bus->heads;
  const Told *told = bus->told;
  SlrFrame *came = bus->came;
  const int64_t now = slr_now(), day = slr_day(), longest = now - bus->empty;
  for (int64_t i = first; i < end; i++) {
    const int timed = told[i].level == SOL_SOCKET && told[i].type == STAMP &&
                      heads[i].msg_hdr.msg_controllen >= TOLD_BYTES;
    const int64_t age = timed ? day - (told[i].s * SECOND + told[i].ns) : 0;
    came[i].stamp = now - (age < 0 ? 0 : age > longest ? longest : age);
  }
}

void slr_bus_begin(SlrBusEnd *bus) {
  struct mmsghdr *heads = bus->heads;
  for (int64_t i = 0; bus->told && i < bus->count; i++) heads[i].msg_hdr.msg_controllen = sizeof(Told);
  bus->count = 0;
}

/* Packets that wait, behind those that are there; how many, -1: none can be had. */
static int packets(const SlrBusEnd *bus) {
  struct mmsghdr *heads = bus->heads;
  const unsigned room = (unsigned)(bus->size - bus->count);
  const int found = room ? recvmmsg((int)bus->descriptor, heads + bus->count, room, MSG_DONTWAIT, NULL) : 0;
  return found < 0 && errno == EAGAIN ? 0 : found;
}

/* The end of a local bus is read again and again as a packet of no bytes. */
static int take_local(const SlrBusEnd *bus) {
  const struct mmsghdr *heads = bus->heads;
  int found = packets(bus);
  const int some = found > 0;
  while (found > 0 && heads[bus->count + found - 1].msg_len != sizeof(SlrFrame)) found--;
  return some && !found ? -1 : found;
}

static int take_can(SlrBusEnd *bus) {
  const struct mmsghdr *heads = bus->heads;
  const int64_t before = slr_now(), room = bus->size - bus->count;
  const int found = packets(bus);
  for (int i = 0; i < found; i++)
    if (heads[bus->count + i].msg_len != CAN_FRAME) return -1; /* no classical CAN */
  if (found > 0) stamp_frames(bus, bus->count, bus->count + found);
  if (found >= 0 && found < room) bus->empty = before;
  return found;
}

int slr_bus_take(SlrBusEnd *bus) {
  const int found = bus->kind == SLR_SCAN_LOCAL ? take_local(bus) : take_can(bus);
  if (found > 0) bus->count += found;
  return found;
}

/* The local bus takes all frames in one packet: its process is woken once. */
static void give_local(SlrBusEnd *bus, int count) {
  const size_t bytes = (size_t)count * sizeof(SlrFrame);
  const ssize_t sent = send((int)bus->descriptor, bus->going, bytes, AT_ONCE);
  if (sent != (ssize_t)bytes) bus->unsent += count;
}

static void give_can(SlrBusEnd *bus, int count) {
  struct mmsghdr *heads = bus->going_heads;
  for (int sent = 0; sent < count;) {
    const int found = sendmmsg((int)bus->descriptor, heads + sent, (unsigned)(count - sent), AT_ONCE);
    bus->unsent += found < 1;
    sent += found < 1 ? 1 : found; /* one for which there is no room is left out */
  }
}

void slr_bus_give(SlrBusEnd *bus, int count) {
  if (count > 0 && bus->kind == SLR_SCAN_LOCAL) give_local(bus, count);
  if (count > 0 && bus->kind == SLR_SCAN_SOCKETCAN) give_can(bus, count);
}
#endif
