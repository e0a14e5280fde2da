/* Generated from specs/signals.toml by slewright generate; do not edit. */
#ifndef SLR_IMAGE_LAYOUT_H
#define SLR_IMAGE_LAYOUT_H

#include <stdint.h>

#define SLR_LAYOUT "87651f1be0afaea3"
#define SLR_TICK_S 0.02
typedef enum { SLR_STATUS_OK = 0, SLR_STATUS_NEVER = 1, SLR_STATUS_TIMEOUT = 2, SLR_STATUS_ERROR = 3, SLR_STATUS_NOT_AVAILABLE = 4, SLR_STATUS_CHECKSUM = 5, SLR_STATUS_RANGE = 6, SLR_STATUS_STUCK = 7, SLR_STATUS_FORCED = 8, SLR_STATUS_TWO_SENDERS = 9 } SlrStatus;
typedef enum { SLR_FLAG_NO_REALTIME = 1, SLR_FLAG_NO_LOCK = 2, SLR_FLAG_STOLEN_TIME = 4, SLR_FLAG_BUS_PASSIVE = 8, SLR_FLAG_BUS_OFF = 16, SLR_FLAG_RECORDER_LOST = 32, SLR_FLAG_MODBUS_LOST = 64, SLR_FLAG_RETAIN_LOST = 128, SLR_FLAG_DISK_FULL = 256, SLR_FLAG_GATE_LIMITED = 512, SLR_FLAG_POLICY_LATE = 1024, SLR_FLAG_FORCED = 2048, SLR_FLAG_OTHER_CONTROLLER = 4096, SLR_FLAG_GUARDED = 8192 } SlrFlag;
typedef enum { SLR_GROUP_PLANNER = 0, SLR_GROUP_OPERATOR = 1, SLR_GROUP_MACHINE = 2, SLR_GROUP_SENSOR = 3, SLR_GROUP_INFORMATION = 4, SLR_GROUP_OWN = 5, SLR_GROUP_POLICY = 6 } SlrGroup;
typedef enum { SLR_MODE_OFF = 0, SLR_MODE_STANDBY = 1, SLR_MODE_MANUAL = 2, SLR_MODE_AUTOMATIC = 3, SLR_MODE_STOPPING = 4, SLR_MODE_FAULT = 5, SLR_MODE_ARMED = 6, SLR_MODE_HOLD = 7 } SlrMode;
typedef enum { SLR_FAULT_NONE = 0, SLR_FAULT_SENSOR_TIMEOUT = 1, SLR_FAULT_SENSOR_RANGE = 2, SLR_FAULT_TARGET_TIMEOUT = 3, SLR_FAULT_TARGET_OUT_OF_REACH = 4, SLR_FAULT_MACHINE_NOT_READY = 5, SLR_FAULT_TASK_OVERRUN = 6, SLR_FAULT_CONTROLLER_FAILED = 7, SLR_FAULT_CONFIGURATION = 8, SLR_FAULT_EMERGENCY_STOP = 9, SLR_FAULT_OPERATOR_TIMEOUT = 10, SLR_FAULT_MACHINE_TIMEOUT = 11, SLR_FAULT_SENSOR_CHECKSUM = 12, SLR_FAULT_SENSOR_ERROR = 13, SLR_FAULT_SENSOR_STUCK = 14, SLR_FAULT_BUS_OFF = 15, SLR_FAULT_MACHINE_FAULT = 16, SLR_FAULT_KEEP_OUT = 17, SLR_FAULT_OTHER_CONTROLLER = 18, SLR_FAULT_TWO_SENDERS = 19, SLR_FAULT_POLICY_TIMEOUT = 20 } SlrFault;
enum {
  SLR_IN_target_x = 0,
  SLR_IN_target_y = 1,
  SLR_IN_target_z = 2,
  SLR_IN_target_valid = 3,
  SLR_IN_target_number = 4,
  SLR_IN_load_told = 5,
  SLR_IN_pace = 6,
  SLR_IN_planner_heartbeat = 7,
  SLR_IN_policy_u_slew = 8,
  SLR_IN_policy_qd_boom_ref = 9,
  SLR_IN_policy_qd_stick_ref = 10,
  SLR_IN_policy_heartbeat = 11,
  SLR_IN_q_slew = 12,
  SLR_IN_q_boom = 13,
  SLR_IN_q_stick = 14,
  SLR_IN_qd_slew = 15,
  SLR_IN_qd_boom = 16,
  SLR_IN_qd_stick = 17,
  SLR_IN_p_slew_a = 18,
  SLR_IN_p_slew_b = 19,
  SLR_IN_p_boom_a = 20,
  SLR_IN_p_boom_b = 21,
  SLR_IN_p_stick_a = 22,
  SLR_IN_p_stick_b = 23,
  SLR_IN_p_pump = 24,
  SLR_IN_brake_released = 25,
  SLR_IN_imu_cabin_rate_x = 26,
  SLR_IN_imu_cabin_rate_y = 27,
  SLR_IN_imu_cabin_rate_z = 28,
  SLR_IN_imu_cabin_roll = 29,
  SLR_IN_imu_cabin_acc_x = 30,
  SLR_IN_imu_cabin_acc_y = 31,
  SLR_IN_imu_cabin_acc_z = 32,
  SLR_IN_imu_cabin_pitch = 33,
  SLR_IN_imu_tool_rate_x = 34,
  SLR_IN_imu_tool_rate_y = 35,
  SLR_IN_imu_tool_rate_z = 36,
  SLR_IN_imu_tool_roll = 37,
  SLR_IN_imu_tool_acc_x = 38,
  SLR_IN_imu_tool_acc_y = 39,
  SLR_IN_imu_tool_acc_z = 40,
  SLR_IN_imu_tool_pitch = 41,
  SLR_IN_joystick_slew = 42,
  SLR_IN_joystick_boom = 43,
  SLR_IN_joystick_stick = 44,
  SLR_IN_operator_enable = 45,
  SLR_IN_automatic_request = 46,
  SLR_IN_operator_heartbeat = 47,
  SLR_IN_machine_ready = 48,
  SLR_IN_emergency_stop = 49,
  SLR_IN_pilot_enabled = 50,
  SLR_IN_automatic_allowed = 51,
  SLR_IN_machine_fault = 52,
  SLR_IN_supply_pressure = 53,
  SLR_IN_machine_heartbeat = 54,
  SLR_IN_imu_cabin_heartbeat = 55,
  SLR_IN_imu_tool_heartbeat = 56,
  SLR_IN_engine_speed = 57,
  SLR_IN_oil_temperature = 58,
  SLR_IN_supply_voltage = 59,
  SLR_IN_COUNT = 60
};
typedef struct {
  int64_t tick;
  int32_t overruns;
  uint32_t flags;
  double value[60];
  int32_t age[60];
  uint8_t status[60];
  uint8_t pad[4];
} SlrInput;
#define SLR_INPUT_SIGNALS(X) \
  X(target_x, 20, SLR_GROUP_PLANNER, -25.0, 25.0, 25, 0.0) \
  X(target_y, 21, SLR_GROUP_PLANNER, -25.0, 25.0, 25, 0.0) \
  X(target_z, 22, SLR_GROUP_PLANNER, -25.0, 25.0, 25, 0.0) \
  X(target_valid, 23, SLR_GROUP_PLANNER, 0.0, 1.0, 25, 0.0) \
  X(target_number, 24, SLR_GROUP_PLANNER, 0.0, 250.0, 25, 0.0) \
  X(load_told, 25, SLR_GROUP_PLANNER, 0.0, 4000.0, 25, 0.0) \
  X(pace, 26, SLR_GROUP_PLANNER, 0.0, 2.0, 25, 1.0) \
  X(planner_heartbeat, 27, SLR_GROUP_PLANNER, 0.0, 250.0, 25, 0.0) \
  X(policy_u_slew, 28, SLR_GROUP_POLICY, -1.0, 1.0, 15, 0.0) \
  X(policy_qd_boom_ref, 29, SLR_GROUP_POLICY, -0.2, 0.2, 15, 0.0) \
  X(policy_qd_stick_ref, 30, SLR_GROUP_POLICY, -0.2, 0.2, 15, 0.0) \
  X(policy_heartbeat, 31, SLR_GROUP_POLICY, 0.0, 250.0, 15, 0.0) \
  X(q_slew, 40, SLR_GROUP_SENSOR, -1000.0, 1000.0, 5, 0.0) \
  X(q_boom, 41, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 1.1) \
  X(q_stick, 42, SLR_GROUP_SENSOR, -3.2, 3.2, 5, -1.2) \
  X(qd_slew, 43, SLR_GROUP_SENSOR, -1.6, 1.6, 5, 0.0) \
  X(qd_boom, 44, SLR_GROUP_SENSOR, -1.6, 1.6, 5, 0.0) \
  X(qd_stick, 45, SLR_GROUP_SENSOR, -1.6, 1.6, 5, 0.0) \
  X(p_slew_a, 46, SLR_GROUP_SENSOR, -1000000.0, 60000000.0, 5, 0.0) \
  X(p_slew_b, 47, SLR_GROUP_SENSOR, -1000000.0, 60000000.0, 5, 0.0) \
  X(p_boom_a, 48, SLR_GROUP_SENSOR, -1000000.0, 60000000.0, 5, 0.0) \
  X(p_boom_b, 49, SLR_GROUP_SENSOR, -1000000.0, 60000000.0, 5, 0.0) \
  X(p_stick_a, 50, SLR_GROUP_SENSOR, -1000000.0, 60000000.0, 5, 0.0) \
  X(p_stick_b, 51, SLR_GROUP_SENSOR, -1000000.0, 60000000.0, 5, 0.0) \
  X(p_pump, 52, SLR_GROUP_SENSOR, -1000000.0, 60000000.0, 5, 0.0) \
  X(brake_released, 53, SLR_GROUP_SENSOR, 0.0, 1.0, 5, 0.0) \
  X(imu_cabin_rate_x, 54, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(imu_cabin_rate_y, 55, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(imu_cabin_rate_z, 56, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(imu_cabin_roll, 57, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(imu_cabin_acc_x, 58, SLR_GROUP_SENSOR, -32.0, 32.0, 5, 0.0) \
  X(imu_cabin_acc_y, 59, SLR_GROUP_SENSOR, -32.0, 32.0, 5, 0.0) \
  X(imu_cabin_acc_z, 60, SLR_GROUP_SENSOR, -32.0, 32.0, 5, 0.0) \
  X(imu_cabin_pitch, 61, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(imu_tool_rate_x, 62, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(imu_tool_rate_y, 63, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(imu_tool_rate_z, 64, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(imu_tool_roll, 65, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(imu_tool_acc_x, 66, SLR_GROUP_SENSOR, -32.0, 32.0, 5, 0.0) \
  X(imu_tool_acc_y, 67, SLR_GROUP_SENSOR, -32.0, 32.0, 5, 0.0) \
  X(imu_tool_acc_z, 68, SLR_GROUP_SENSOR, -32.0, 32.0, 5, 0.0) \
  X(imu_tool_pitch, 69, SLR_GROUP_SENSOR, -3.2, 3.2, 5, 0.0) \
  X(joystick_slew, 80, SLR_GROUP_OPERATOR, -1.0, 1.0, 5, 0.0) \
  X(joystick_boom, 81, SLR_GROUP_OPERATOR, -1.0, 1.0, 5, 0.0) \
  X(joystick_stick, 82, SLR_GROUP_OPERATOR, -1.0, 1.0, 5, 0.0) \
  X(operator_enable, 83, SLR_GROUP_OPERATOR, 0.0, 1.0, 5, 0.0) \
  X(automatic_request, 84, SLR_GROUP_OPERATOR, 0.0, 1.0, 5, 0.0) \
  X(operator_heartbeat, 85, SLR_GROUP_OPERATOR, 0.0, 250.0, 5, 0.0) \
  X(machine_ready, 150, SLR_GROUP_MACHINE, 0.0, 1.0, 25, 0.0) \
  X(emergency_stop, 151, SLR_GROUP_MACHINE, 0.0, 1.0, 25, 0.0) \
  X(pilot_enabled, 152, SLR_GROUP_MACHINE, 0.0, 1.0, 25, 0.0) \
  X(automatic_allowed, 153, SLR_GROUP_MACHINE, 0.0, 1.0, 25, 0.0) \
  X(machine_fault, 154, SLR_GROUP_MACHINE, 0.0, 250.0, 25, 0.0) \
  X(supply_pressure, 155, SLR_GROUP_MACHINE, 0.0, 6000000.0, 25, 0.0) \
  X(machine_heartbeat, 156, SLR_GROUP_MACHINE, 0.0, 250.0, 25, 0.0) \
  X(imu_cabin_heartbeat, 157, SLR_GROUP_INFORMATION, 0.0, 250.0, 25, 0.0) \
  X(imu_tool_heartbeat, 158, SLR_GROUP_INFORMATION, 0.0, 250.0, 25, 0.0) \
  X(engine_speed, 159, SLR_GROUP_INFORMATION, 0.0, 300.0, 150, 0.0) \
  X(oil_temperature, 160, SLR_GROUP_INFORMATION, 233.15, 413.15, 150, 320.0) \
  X(supply_voltage, 161, SLR_GROUP_INFORMATION, 0.0, 60.0, 150, 0.0)
enum {
  SLR_OUT_u_slew = 0,
  SLR_OUT_u_boom = 1,
  SLR_OUT_u_stick = 2,
  SLR_OUT_qd_boom_ref = 3,
  SLR_OUT_qd_stick_ref = 4,
  SLR_OUT_control_enable = 5,
  SLR_OUT_command_heartbeat = 6,
  SLR_OUT_control_mode = 7,
  SLR_OUT_target_reached = 8,
  SLR_OUT_target_in_reach = 9,
  SLR_OUT_fault_code = 10,
  SLR_OUT_load_estimate = 11,
  SLR_OUT_cycle_overruns = 12,
  SLR_OUT_controller_heartbeat = 13,
  SLR_OUT_fault_signal = 14,
  SLR_OUT_runtime_flags = 15,
  SLR_OUT_guard_part = 16,
  SLR_OUT_COUNT = 17
};
typedef struct {
  int64_t tick;
  int32_t overruns;
  uint32_t flags;
  double value[17];
  int32_t age[17];
  uint8_t status[17];
  uint8_t pad[3];
} SlrOutput;
#define SLR_OUTPUT_SIGNALS(X) \
  X(u_slew, 1, SLR_GROUP_OWN, -1.0, 1.0, 5, 0.0) \
  X(u_boom, 2, SLR_GROUP_OWN, -1.0, 1.0, 5, 0.0) \
  X(u_stick, 3, SLR_GROUP_OWN, -1.0, 1.0, 5, 0.0) \
  X(qd_boom_ref, 4, SLR_GROUP_OWN, -0.2, 0.2, 5, 0.0) \
  X(qd_stick_ref, 5, SLR_GROUP_OWN, -0.2, 0.2, 5, 0.0) \
  X(control_enable, 6, SLR_GROUP_OWN, 0.0, 1.0, 5, 0.0) \
  X(command_heartbeat, 7, SLR_GROUP_OWN, 0.0, 250.0, 5, 0.0) \
  X(control_mode, 140, SLR_GROUP_OWN, 0.0, 7.0, 25, 0.0) \
  X(target_reached, 141, SLR_GROUP_OWN, 0.0, 1.0, 25, 0.0) \
  X(target_in_reach, 142, SLR_GROUP_OWN, 0.0, 1.0, 25, 0.0) \
  X(fault_code, 143, SLR_GROUP_OWN, 0.0, 250.0, 25, 0.0) \
  X(load_estimate, 144, SLR_GROUP_OWN, 0.0, 4000.0, 25, 0.0) \
  X(cycle_overruns, 145, SLR_GROUP_OWN, 0.0, 250.0, 25, 0.0) \
  X(controller_heartbeat, 146, SLR_GROUP_OWN, 0.0, 250.0, 25, 0.0) \
  X(fault_signal, 147, SLR_GROUP_OWN, 0.0, 999.0, 25, 0.0) \
  X(runtime_flags, 148, SLR_GROUP_OWN, 0.0, 16383.0, 25, 0.0) \
  X(guard_part, 149, SLR_GROUP_OWN, 0.0, 7.0, 25, 0.0)
#endif
