"""Hardware in the loop on one machine: the reference machine and the runtime, in lock-step or real time."""
