/* Generated from specs/signals.toml by slewright generate; do not edit. */
#ifndef SLR_WIRE_LAYOUT_H
#define SLR_WIRE_LAYOUT_H

#define SLR_WIRE_LAYOUT "17afd120bfb06c71"
#define SLR_WIRE_EXTENDED 0x80000000
#define SLR_WIRE_REMOTE 0x40000000
#define SLR_WIRE_ERROR 0x20000000
#define SLR_WIRE_IDENTIFIER 0x1fffffff
#define SLR_WIRE_BUS_OFF 0x40
#define SLR_WIRE_RESTARTED 0x100
#define SLR_WIRE_CONTROLLER 0x4
#define SLR_WIRE_RX_OVERFLOW 0x1
#define SLR_WIRE_ACTIVE 0x40
#define SLR_WIRE_PASSIVE 0x30
#define SLR_WIRE_COUNTS 0xf
#define SLR_WIRE_SPARE 0x1
#define SLR_WIRE_LAST_COUNT 0xe
#define SLR_WIRE_PERIOD_NS 0x1312d00
#define SLR_WIRE_DOUBT 0x10
#define SLR_WIRE_MOST_DOUBT 0x40
#define SLR_WIRE_TWO_SENDERS 0x28
#define SLR_WIRE_TIMED_BY 1 /* SlewPosition */
#define SLR_WIRE_CRC {0, 29, 58, 39, 116, 105, 78, 83, 232, 245, 210, 207, 156, 129, 166, 187, 205, 208, 247, 234, 185, 164, 131, 158, 37, 56, 31, 2, 81, 76, 107, 118, 135, 154, 189, 160, 243, 238, 201, 212, 111, 114, 85, 72, 27, 6, 33, 60, 74, 87, 112, 109, 62, 35, 4, 25, 162, 191, 152, 133, 214, 203, 236, 241, 19, 14, 41, 52, 103, 122, 93, 64, 251, 230, 193, 220, 143, 146, 181, 168, 222, 195, 228, 249, 170, 183, 144, 141, 54, 43, 12, 17, 66, 95, 120, 101, 148, 137, 174, 179, 224, 253, 218, 199, 124, 97, 70, 91, 8, 21, 50, 47, 89, 68, 99, 126, 45, 48, 23, 10, 177, 172, 139, 150, 197, 216, 255, 226, 38, 59, 28, 1, 82, 79, 104, 117, 206, 211, 244, 233, 186, 167, 128, 157, 235, 246, 209, 204, 159, 130, 165, 184, 3, 30, 57, 36, 119, 106, 77, 80, 161, 188, 155, 134, 213, 200, 239, 242, 73, 84, 115, 110, 61, 32, 7, 26, 108, 113, 86, 75, 24, 5, 34, 63, 132, 153, 190, 163, 240, 237, 202, 215, 53, 40, 15, 18, 65, 92, 123, 102, 221, 192, 231, 250, 169, 180, 147, 142, 248, 229, 194, 223, 140, 145, 182, 171, 16, 13, 42, 55, 100, 121, 94, 67, 178, 175, 136, 149, 198, 219, 252, 225, 90, 71, 96, 125, 46, 51, 20, 9, 127, 98, 69, 88, 11, 22, 49, 44, 151, 138, 173, 176, 227, 254, 217, 196}
#define SLR_WIRE_IN_MESSAGES 19
#define SLR_WIRE_IN_FIELDS 60
#define SLR_WIRE_IN_MESSAGE_TABLE(X) \
  X(OperatorJoystick, 0xcff1285u, 8, 239, 1, 0, 0, 6) \
  X(SlewPosition, 0xcff2081u, 8, 182, 1, 0, 6, 1) \
  X(ArmPosition, 0xcff2481u, 8, 155, 1, 0, 7, 2) \
  X(JointVelocity, 0xcff2181u, 8, 250, 1, 0, 9, 3) \
  X(PressureA, 0xcff2281u, 8, 46, 1, 0, 12, 4) \
  X(PressureB, 0xcff2381u, 8, 98, 1, 0, 16, 4) \
  X(CabinImuRate, 0xcff3082u, 8, 2, 1, 0, 20, 3) \
  X(CabinImuAcc, 0xcff3182u, 8, 78, 1, 0, 23, 3) \
  X(CabinImuAngle, 0xcff3482u, 8, 47, 1, 0, 26, 2) \
  X(ToolImuRate, 0xcff3283u, 8, 154, 1, 0, 28, 3) \
  X(ToolImuAcc, 0xcff3383u, 8, 214, 1, 0, 31, 3) \
  X(ToolImuAngle, 0xcff3583u, 8, 99, 1, 0, 34, 2) \
  X(TargetPosition, 0x10ff4084u, 8, 41, 5, 0, 36, 4) \
  X(TargetTask, 0x10ff4184u, 8, 101, 5, 0, 40, 4) \
  X(PolicyCommand, 0x10ff4286u, 8, 177, 5, 0, 44, 4) \
  X(MachineStatus, 0x18ff5181u, 8, 209, 5, 0, 48, 7) \
  X(MachineSlow, 0x1cff5281u, 8, 5, 50, 0, 55, 3) \
  X(CabinImuStatus, 0x18ff5382u, 8, 73, 5, 0, 58, 1) \
  X(ToolImuStatus, 0x18ff5483u, 8, 176, 5, 0, 59, 1)
#define SLR_WIRE_IN_FIELD_TABLE(X) \
  X(joystick_slew, 42, 16, 12, 0.0005, -1.0, -1.00025, 1.00025, 0xffdu, 0xffeu, 0xfffu) \
  X(joystick_boom, 43, 28, 12, 0.0005, -1.0, -1.00025, 1.00025, 0xffdu, 0xffeu, 0xfffu) \
  X(joystick_stick, 44, 40, 12, 0.0005, -1.0, -1.00025, 1.00025, 0xffdu, 0xffeu, 0xfffu) \
  X(operator_enable, 45, 12, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(automatic_request, 46, 14, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(operator_heartbeat, 47, 56, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(q_slew, 12, 16, 32, 1e-06, -2000.0, -1000.0000005, 1000.0000005, 0xfaffffffu, 0xfe000000u, 0xff000000u) \
  X(q_boom, 13, 16, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(q_stick, 14, 32, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(qd_slew, 15, 16, 16, 5e-05, -1.6, -1.600025, 1.600025, 0xfaffu, 0xfe00u, 0xff00u) \
  X(qd_boom, 16, 32, 16, 5e-05, -1.6, -1.600025, 1.600025, 0xfaffu, 0xfe00u, 0xff00u) \
  X(qd_stick, 17, 48, 16, 5e-05, -1.6, -1.600025, 1.600025, 0xfaffu, 0xfe00u, 0xff00u) \
  X(p_slew_a, 18, 12, 13, 10000.0, -1000000.0, -1005000.0, 60005000.0, 0x1ffdu, 0x1ffeu, 0x1fffu) \
  X(p_slew_b, 19, 25, 13, 10000.0, -1000000.0, -1005000.0, 60005000.0, 0x1ffdu, 0x1ffeu, 0x1fffu) \
  X(p_boom_a, 20, 38, 13, 10000.0, -1000000.0, -1005000.0, 60005000.0, 0x1ffdu, 0x1ffeu, 0x1fffu) \
  X(p_boom_b, 21, 51, 13, 10000.0, -1000000.0, -1005000.0, 60005000.0, 0x1ffdu, 0x1ffeu, 0x1fffu) \
  X(p_stick_a, 22, 16, 16, 10000.0, -1000000.0, -1005000.0, 60005000.0, 0xfaffu, 0xfe00u, 0xff00u) \
  X(p_stick_b, 23, 32, 16, 10000.0, -1000000.0, -1005000.0, 60005000.0, 0xfaffu, 0xfe00u, 0xff00u) \
  X(p_pump, 24, 48, 16, 10000.0, -1000000.0, -1005000.0, 60005000.0, 0xfaffu, 0xfe00u, 0xff00u) \
  X(brake_released, 25, 12, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(imu_cabin_rate_x, 26, 16, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_cabin_rate_y, 27, 32, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_cabin_rate_z, 28, 48, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_cabin_acc_x, 30, 16, 16, 0.001, -32.0, -32.0005, 32.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_cabin_acc_y, 31, 32, 16, 0.001, -32.0, -32.0005, 32.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_cabin_acc_z, 32, 48, 16, 0.001, -32.0, -32.0005, 32.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_cabin_roll, 29, 16, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_cabin_pitch, 33, 32, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_tool_rate_x, 34, 16, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_tool_rate_y, 35, 32, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_tool_rate_z, 36, 48, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_tool_acc_x, 38, 16, 16, 0.001, -32.0, -32.0005, 32.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_tool_acc_y, 39, 32, 16, 0.001, -32.0, -32.0005, 32.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_tool_acc_z, 40, 48, 16, 0.001, -32.0, -32.0005, 32.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_tool_roll, 37, 16, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_tool_pitch, 41, 32, 16, 0.0001, -3.2, -3.20005, 3.20005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(target_x, 0, 16, 16, 0.001, -32.0, -25.0005, 25.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(target_y, 1, 32, 16, 0.001, -32.0, -25.0005, 25.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(target_z, 2, 48, 16, 0.001, -32.0, -25.0005, 25.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(target_valid, 3, 12, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(target_number, 4, 48, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(load_told, 5, 16, 16, 0.1, 0.0, -0.05, 4000.05, 0xfaffu, 0xfe00u, 0xff00u) \
  X(pace, 6, 32, 16, 0.0001, 0.0, -5e-05, 2.00005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(planner_heartbeat, 7, 56, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(policy_u_slew, 8, 20, 16, 3.125e-05, -1.0, -1.000015625, 1.000015625, 0xfaffu, 0xfe00u, 0xff00u) \
  X(policy_qd_boom_ref, 9, 36, 14, 2.5e-05, -0.2, -0.2000125, 0.2000125, 0x3ffdu, 0x3ffeu, 0x3fffu) \
  X(policy_qd_stick_ref, 10, 50, 14, 2.5e-05, -0.2, -0.2000125, 0.2000125, 0x3ffdu, 0x3ffeu, 0x3fffu) \
  X(policy_heartbeat, 11, 12, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(machine_ready, 48, 12, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(emergency_stop, 49, 14, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(pilot_enabled, 50, 16, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(automatic_allowed, 51, 18, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(machine_fault, 52, 24, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(supply_pressure, 53, 32, 16, 100.0, 0.0, -50.0, 6000050.0, 0xfaffu, 0xfe00u, 0xff00u) \
  X(machine_heartbeat, 54, 56, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(engine_speed, 57, 16, 16, 0.01, 0.0, -0.005, 300.005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(oil_temperature, 58, 32, 16, 0.03125, 0.0, 233.134375, 413.165625, 0xfaffu, 0xfe00u, 0xff00u) \
  X(supply_voltage, 59, 48, 16, 0.001, 0.0, -0.0005, 60.0005, 0xfaffu, 0xfe00u, 0xff00u) \
  X(imu_cabin_heartbeat, 55, 16, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(imu_tool_heartbeat, 56, 16, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu)
#define SLR_WIRE_OUT_MESSAGES 4
#define SLR_WIRE_OUT_FIELDS 17
#define SLR_WIRE_OUT_MESSAGE_TABLE(X) \
  X(SlewCommand, 0xcff1080u, 8, 119, 1, 0, 0, 4) \
  X(ArmRateCommand, 0xcff1180u, 8, 59, 1, 0, 4, 3) \
  X(ControllerStatus, 0x18ff5080u, 8, 157, 5, 0, 7, 7) \
  X(ControllerDetail, 0x1cff5580u, 8, 252, 5, 1, 14, 3)
#define SLR_WIRE_OUT_FIELD_TABLE(X) \
  X(u_slew, 0, 16, 16, 3.125e-05, -1.0, -1.000015625, 1.000015625, 0xfaffu, 0xfe00u, 0xff00u) \
  X(u_boom, 1, 32, 16, 3.125e-05, -1.0, -1.000015625, 1.000015625, 0xfaffu, 0xfe00u, 0xff00u) \
  X(u_stick, 2, 48, 16, 3.125e-05, -1.0, -1.000015625, 1.000015625, 0xfaffu, 0xfe00u, 0xff00u) \
  X(control_enable, 5, 12, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(qd_boom_ref, 3, 16, 16, 1e-05, -0.32, -0.20000500000000002, 0.20000500000000002, 0xfaffu, 0xfe00u, 0xff00u) \
  X(qd_stick_ref, 4, 32, 16, 1e-05, -0.32, -0.20000500000000002, 0.20000500000000002, 0xfaffu, 0xfe00u, 0xff00u) \
  X(command_heartbeat, 6, 48, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(control_mode, 7, 12, 4, 1.0, 0.0, -0.5, 7.5, 0xdu, 0xeu, 0xfu) \
  X(target_reached, 8, 16, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(target_in_reach, 9, 18, 2, 1.0, 0.0, -0.5, 1.5, 0x1u, 0x2u, 0x3u) \
  X(fault_code, 10, 24, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(load_estimate, 11, 32, 16, 0.1, 0.0, -0.05, 4000.05, 0xfaffu, 0xfe00u, 0xff00u) \
  X(cycle_overruns, 12, 48, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(controller_heartbeat, 13, 56, 8, 1.0, 0.0, -0.5, 250.5, 0xfau, 0xfeu, 0xffu) \
  X(fault_signal, 14, 16, 16, 1.0, 0.0, -0.5, 999.5, 0xfaffu, 0xfe00u, 0xff00u) \
  X(runtime_flags, 15, 32, 16, 1.0, 0.0, -0.5, 16383.5, 0xfaffu, 0xfe00u, 0xff00u) \
  X(guard_part, 16, 48, 4, 1.0, 0.0, -0.5, 7.5, 0xdu, 0xeu, 0xfu)
#endif
