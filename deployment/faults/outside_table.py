"""The faults of a policy outside, which commands over ROS 2; table.py has those of all others."""

from deployment.faults.table import SHOWN_FAULT_MS, TICK_MS, Fault, stops
from runtime.interfaces.outside import LATE

POLICY_MS = TICK_MS * LATE
OUTSIDE = (
    stops(
        "policy_silent",
        "the node of a policy outside is killed",
        POLICY_MS + SHOWN_FAULT_MS,
        "policy_timeout",
        level="process",
    ),
    stops(
        "policy_stale",
        "its commands carry stamps of a second ago",
        POLICY_MS + SHOWN_FAULT_MS,
        "policy_timeout",
        level="process",
    ),
    stops(
        "policy_hangs",
        "its commands go on, its heartbeat stands still",
        POLICY_MS + SHOWN_FAULT_MS,
        "policy_timeout",
        level="process",
    ),
    stops(
        "policy_wrong_message",
        "its commands are out of range, or no numbers",
        POLICY_MS + SHOWN_FAULT_MS,
        "policy_timeout",
        level="process",
    ),
    Fault(
        "policy_wrong_type",
        "another node publishes another type on its topic",
        "refused; automatic goes on",
        0.0,
        "process",
    ),
    Fault(
        "policy_second_commander",
        "another node, and another publisher of the same name, command too",
        "refused; automatic goes on",
        0.0,
        "process",
    ),
    Fault(
        "policy_flood",
        "2,000 commands in one go by a node without the role",
        "refused; automatic goes on",
        0.0,
        "process",
    ),
)
NAMES = tuple(f.name for f in OUTSIDE)
