"""The PLC-style cyclic runtime: runs controllers as compiled bundles, without casadi and without models."""
