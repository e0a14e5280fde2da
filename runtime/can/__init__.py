"""CAN of the runtime: codec and protection from the specs, buses, joysticks, a local bus without hardware."""

import sys

if "can" not in sys.modules and "asammdf" not in sys.modules:
    # Where asammdf is installed python-can imports it for MDF files, which nobody here reads with it, and
    # pandas and pyarrow with that: two thirds of the time that a control process takes to start.
    sys.modules["asammdf"] = None  # type: ignore[assignment]
    import can  # noqa: F401

    del sys.modules["asammdf"]
