"""How FMI's types and statuses are numbered between Python and the core (orchestrator/core/fmu.h)."""

# FMI type -> slw_type, by FMI version.
WIRE = {
    2: {"Real": 0, "Integer": 6, "Enumeration": 6, "Boolean": 10, "String": 11},
    3: {
        **{
            "Float64": 0,
            "Float32": 1,
            "Int8": 2,
            "UInt8": 3,
            "Int16": 4,
            "UInt16": 5,
            "Int32": 6,
            "UInt32": 7,
        },
        **{"Int64": 8, "Enumeration": 8, "UInt64": 9, "Boolean": 10, "String": 11, "Binary": 12, "Clock": 13},
    },
}
BLOBS = ("String", "Binary")
BOOLEANS = ("Boolean", "Clock")

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending", "crashed", "hung")  # slw_status
WARNING = 1  # the worst status with which a run goes on
