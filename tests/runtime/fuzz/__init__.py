"""Fuzzing of the runtime's wires: CAN frames into port and core, bytes into the Modbus server."""
