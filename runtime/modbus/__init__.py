"""Modbus TCP of the runtime: a server in a process of its own, and its port in the control process."""
