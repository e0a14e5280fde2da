"""Hardware in the loop on one machine: the reference machine and the runtime, in lock-step or real time."""

import runtime.can  # noqa: F401  (before python-can is: it says why)
