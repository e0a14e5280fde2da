"""Tests of the runtime's CAN."""
