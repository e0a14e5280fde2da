"""Machines that a controller can be tried on: found by name or file, and runs of many targets on them."""
