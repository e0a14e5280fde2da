"""The controller as CANopen master: PDOs in the cycle (in C); a process that sets up and watches devices."""
