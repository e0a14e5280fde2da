"""What happens to the files and processes of a run: its audit log, its retained values, its supervisor."""

from deployment.faults.table import Fault

ENDED_MS = 5000.0  # a recorder writes what it has first

FILES = (
    Fault(
        "audit_disk_full",
        "the audit log's disk is full",
        "what is asked is refused; hold stays",
        0.0,
        "inside",
    ),
    Fault("audit_flood", "one peer fills the audit log", "entries of others stay", 0.0, "inside"),
    Fault(
        "retained_lost",
        "a retained copy is damaged, the other one missing",
        "refused at the start",
        0.0,
        "inside",
    ),
)
KILLED_STARTING = (
    Fault(
        "supervisor_killed",
        "the supervisor is killed while its processes start, or later",
        "all of its processes end",
        ENDED_MS,
        "process",
    ),
)
