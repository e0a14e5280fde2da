"""The recorder: every tick's inputs, outputs and timing as MCAP, written by a process of its own."""
