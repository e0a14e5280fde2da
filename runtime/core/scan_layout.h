/* Generated from runtime/scan_layout.py by slewright generate; do not edit. */
#ifndef SLR_SCAN_LAYOUT_H
#define SLR_SCAN_LAYOUT_H

#include <stdint.h>

#define SLR_SCAN_LAYOUT "e492f9b4a67c367f"
#define SLR_SCAN_TARGETS 8
#define SLR_SCAN_FIRST_TARGET 0
#define SLR_SCAN_HEARD 19
#define SLR_SCAN_COMMANDS 4
#define SLR_SCAN_FIRST_COMMAND 8
#define SLR_SCAN_SEATS 2
#define SLR_SCAN_NOBODY 0
#define SLR_SCAN_PLANNER 1
#define SLR_SCAN_PAGE 2
#define SLR_SCAN_LOCAL 1
#define SLR_SCAN_SOCKETCAN 2
#define SLR_SCAN_PERIOD_NS 20000000
#define SLR_SCAN_POLICY_EVERY 5
#define SLR_SCAN_STOLEN_NS 1000000
#define SLR_SCAN_SHOWN_TICKS 50
#define SLR_SCAN_DEAD_TICKS 50
#define SLR_SCAN_DISK_FULL 1
#define SLR_SCAN_TICK 1
#define SLR_SCAN_SNAPSHOT 2
#define SLR_SCAN_PAGE_EVERY 5
#define SLR_SCAN_PAGE_PHASE 3
#define SLR_SCAN_PUBLISH_EVERY 50
#define SLR_SCAN_VALUES 1
#define SLR_SCAN_SAVE_FAILED 1
#define SLR_SCAN_TIMES_TOP 20000
#define SLR_SCAN_TIMES_COARSE 16
typedef struct {
  void *memory;
  int64_t size;
  int64_t stride;
} SlrCellEnd;
typedef struct {
  void *words;
  void *data;
  int64_t capacity;
} SlrRingEnd;
typedef struct {
  int64_t beat;
  int64_t tick;
} SlrWatch;
typedef struct {
  int64_t kind;
  int64_t descriptor;
  void *state;
  void *came;
  int64_t size;
  int64_t count;
  int64_t now;
  void *heads;
  void *told;
  int64_t empty;
  void *going;
  void *going_heads;
  int64_t unsent;
  int64_t gone;
  int64_t alone;
  int64_t heard;
  int64_t another;
  int64_t flags;
} SlrBusEnd;
typedef struct {
  SlrCellEnd accepted;
  SlrCellEnd spent;
  int64_t seen;
} SlrDevices;
typedef struct {
  int64_t stamp_ns;
  int64_t heartbeat_ns;
  uint32_t commits;
  uint32_t owner;
  double value[8];
} SlrTargets;
typedef struct {
  int64_t present;
  SlrCellEnd image;
  SlrCellEnd targets;
  int64_t late;
  int64_t seen;
  int64_t stamp;
  int64_t heartbeat;
  int64_t commits;
  int64_t owner;
  int64_t started;
  int64_t lost;
  double value[8];
} SlrPlanner;
typedef struct {
  int64_t made_ns;
  int64_t owner;
  double value[4];
} SlrCommand;
typedef struct {
  int64_t present;
  SlrCellEnd commands;
  int64_t late;
  int64_t seen;
  int64_t made;
  int64_t owner;
  double value[4];
} SlrOutside;
typedef struct {
  SlrCellEnd cell;
  int64_t number;
  int64_t seen;
  int64_t ended;
  SlrTargets asked;
} SlrSeat;
typedef struct {
  SlrCellEnd granted;
  int64_t late;
  SlrSeat seat[2];
  int64_t who;
  int64_t owner;
  int64_t draining;
} SlrSeats;
typedef struct {
  SlrTargets targets;
  double value[60];
  uint32_t force_number;
  uint8_t forced[60];
  uint8_t pad[8];
} SlrHmi;
typedef struct {
  uint32_t writer;
  uint32_t owner;
  uint32_t forcing;
  uint32_t force_ended;
} SlrGrant;
typedef struct {
  SlrCellEnd seen;
  SlrCellEnd grant;
  SlrCellEnd asked;
  void *refused;
  int64_t heard[19];
  int64_t late;
  int64_t taken;
  SlrHmi newest;
  SlrGrant granted;
  int64_t ended;
  int64_t draining;
  int64_t quiet;
  int64_t next;
  int64_t frames[19];
} SlrPageEnd;
typedef struct {
  int64_t present;
  SlrCellEnd counts;
  SlrRingEnd retain;
  SlrWatch watch;
  int64_t off;
  int64_t kept;
  int64_t places[17];
} SlrPublished;
typedef struct {
  SlrRingEnd ring;
  SlrWatch watch;
  int64_t every;
  int64_t due;
  int64_t count;
  int64_t day;
  void *kept;
  int64_t keeps;
} SlrRecord;
typedef struct {
  int64_t ticks;
  int64_t overruns;
  int64_t stolen;
  int64_t skipped;
  int64_t unrecorded;
  int64_t flags_seen;
} SlrScanCounts;
typedef struct {
  int64_t number;
  int64_t deadline;
  int64_t woke;
  int64_t cpu;
  int64_t waited;
  int64_t attend;
  int64_t sent;
  int64_t used;
  int64_t bus;
} SlrScanTick;
typedef struct {
  void *inputs;
  void *outputs;
  void *core;
  int64_t waits;
  int64_t attends;
  int64_t granted;
  SlrBusEnd wires;
  SlrBusEnd devices;
  SlrDevices setting;
  SlrPlanner planner;
  SlrOutside outside;
  void *seats;
  void *page;
  SlrPublished published;
  SlrRecord record;
  void *counts;
  void *lateness;
  void *policy_work;
  void *other_work;
  void *policy_step;
  void *step;
  void *bus;
  void *latency;
  int64_t stolen_until;
  int64_t received;
  int64_t automatic;
  int64_t policy;
  int64_t phase;
  SlrScanTick tick;
} SlrScan;
#endif
