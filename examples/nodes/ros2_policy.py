"""A policy as a ROS 2 node that commands: python examples/nodes/ros2_policy.py POLICY.onnx [DOMAIN]

The controller runs a bundle of `slewright bundle outside` and gives the role to this node:

    [ros2]
    policy = "/swing/policy"

Every 0.1 s it fills the policy's observation from /slewright/signals, and publishes the answer. Needs the
extras `interfaces` and `learning`. What stops it: docs/how-to/ros2.md.
"""

import sys
import time

import numpy as np
import onnxruntime

from runtime.ros2 import loopback
from runtime.ros2.messages import header
from runtime.ros2.node import Node
from runtime.ros2.wire import message
from specs.policy import (
    ACTIONS,
    INPUT,
    LIMITS,
    OUTPUT,
    SENSORS,
    TARGETS,
    History,
    check_signals,
    read_contract,
)
from specs.ros2 import POLICY, SIGNALS
from specs.signals import signal

AUTOMATIC = next(n for n, text in signal("control_mode").values.items() if text == "automatic")
PERIOD = 5  # ticks of 20 ms
BEATS = 251

session = onnxruntime.InferenceSession(sys.argv[1], providers=["CPUExecutionProvider"])
contract = read_contract(session.get_modelmeta().custom_metadata_map, sys.argv[1])
check_signals(contract, sys.argv[1])
loopback.settings()
node = Node(int(sys.argv[2]) if len(sys.argv) > 2 else 0, "/swing/policy")
node.publisher("/slewright/policy", POLICY)
signals = node.subscriber("/slewright/signals", SIGNALS)
node.announce()


def answer(seen, history, held):
    """The policy's commands for what is seen now; `held` are its last ones."""
    history.push({name: getattr(seen, name) for name in SENSORS}, dict(zip(ACTIONS, held, strict=True)))
    observation = history.observation({name: getattr(seen, name) for name in TARGETS})
    found = np.asarray(session.run([OUTPUT], {INPUT: np.array([observation], dtype=np.float32)})[0])
    low, high = zip(*(LIMITS[name] for name in ACTIONS), strict=True)
    return np.clip(found[0].astype(float), low, high)


history, held, due, beat = History(contract.history), np.zeros(len(ACTIONS)), 0, 0
while True:
    for seen in signals.take(10):
        if 0 < due - seen.tick <= PERIOD:  # further back: the controller was started again
            continue
        if seen.control_mode == AUTOMATIC:
            held = answer(seen, history, held)
        else:  # it says that it is there, and begins anew
            history, held = History(contract.history), np.zeros(len(ACTIONS))
        due, beat = seen.tick + PERIOD, (beat + 1) % BEATS
        stamp = header(time.time_ns(), "base")
        node.publish("/slewright/policy", message(POLICY)(stamp, *map(float, held), beat))
    time.sleep(0.002)
