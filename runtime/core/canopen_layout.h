/* Generated from specs/canopen.toml by slewright generate; do not edit. */
#ifndef SLR_CANOPEN_LAYOUT_H
#define SLR_CANOPEN_LAYOUT_H

#define SLR_CANOPEN_LAYOUT "5d595ebc101f03cf"
#define SLR_CANOPEN_NODES 8
#define SLR_CANOPEN_LOST 15 /* ticks */
#define SLR_CANOPEN_SYNC 0x80
#define SLR_CANOPEN_READY 48 /* machine_ready */
#define SLR_CANOPEN_TIMED_BY 12 /* q_slew */
/* name, id, whether it takes commands */
#define SLR_CANOPEN_NODE_TABLE(X) \
  X(encoder_slew, 32, 0) \
  X(encoder_boom, 33, 0) \
  X(encoder_stick, 34, 0) \
  X(inclinometer_cabin, 40, 0) \
  X(inclinometer_tool, 41, 0) \
  X(valve_slew, 48, 1) \
  X(valve_boom, 49, 1) \
  X(valve_stick, 50, 1)
#define SLR_CANOPEN_IN_PDOS 5
#define SLR_CANOPEN_IN_FIELDS 10
#define SLR_CANOPEN_IN_PDO_TABLE(X) \
  X(0, 0x1a0, 6, 0, 2) \
  X(1, 0x1a1, 6, 2, 2) \
  X(2, 0x1a2, 6, 4, 2) \
  X(3, 0x1a8, 8, 6, 2) \
  X(4, 0x1a9, 8, 8, 2)
#define SLR_CANOPEN_IN_FIELD_TABLE(X) \
  X(q_slew, 12, 0, 32, 0, INT64_C(2147483648), 2.3968449810713143e-05, -1000.0000119842249, 1000.0000119842249, 1) \
  X(qd_slew, 15, 32, 16, 1, INT64_C(0), 9.587379924285257e-05, -1.6000479368996214, 1.6000479368996214, 0) \
  X(q_boom, 13, 0, 32, 0, INT64_C(2147483648), 2.3968449810713143e-05, -3.2000119842249055, 3.2000119842249055, 1) \
  X(qd_boom, 16, 32, 16, 1, INT64_C(0), 9.587379924285257e-05, -1.6000479368996214, 1.6000479368996214, 0) \
  X(q_stick, 14, 0, 32, 0, INT64_C(2147483648), 2.3968449810713143e-05, -3.2000119842249055, 3.2000119842249055, 1) \
  X(qd_stick, 17, 32, 16, 1, INT64_C(0), 9.587379924285257e-05, -1.6000479368996214, 1.6000479368996214, 0) \
  X(imu_cabin_pitch, 33, 0, 32, 1, INT64_C(0), 1.7453292519943296e-05, -3.20000872664626, 3.20000872664626, 1) \
  X(imu_cabin_roll, 29, 32, 32, 1, INT64_C(0), 1.7453292519943296e-05, -3.20000872664626, 3.20000872664626, 1) \
  X(imu_tool_pitch, 41, 0, 32, 1, INT64_C(0), 1.7453292519943296e-05, -3.20000872664626, 3.20000872664626, 1) \
  X(imu_tool_roll, 37, 32, 32, 1, INT64_C(0), 1.7453292519943296e-05, -3.20000872664626, 3.20000872664626, 1)
#define SLR_CANOPEN_OUT_PDOS 3
#define SLR_CANOPEN_OUT_FIELDS 6
#define SLR_CANOPEN_OUT_PDO_TABLE(X) \
  X(5, 0x230, 4, 0, 2) \
  X(6, 0x231, 4, 2, 2) \
  X(7, 0x232, 4, 4, 2)
#define SLR_CANOPEN_OUT_FIELD_TABLE(X) \
  X(control_enable, 5, 0, 16, 0, INT64_C(3), 0.25, -0.125, 1.125, 0) \
  X(u_slew, 0, 16, 16, 1, INT64_C(0), 6.103515625e-05, -1.000030517578125, 1.000030517578125, 0) \
  X(control_enable, 5, 0, 16, 0, INT64_C(3), 0.25, -0.125, 1.125, 0) \
  X(u_boom, 1, 16, 16, 1, INT64_C(0), 6.103515625e-05, -1.000030517578125, 1.000030517578125, 0) \
  X(control_enable, 5, 0, 16, 0, INT64_C(3), 0.25, -0.125, 1.125, 0) \
  X(u_stick, 2, 16, 16, 1, INT64_C(0), 6.103515625e-05, -1.000030517578125, 1.000030517578125, 0)
#endif
