"""Tests of the runtime's Modbus."""
