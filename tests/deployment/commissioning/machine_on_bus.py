"""`python -m tests.deployment.commissioning.machine_on_bus CHANNEL`: a machine in real time on a local bus.

Its operator does what comes as a line on stdin (the key of a question) and says so by a line with the answer.
"""

import select
import sys

from deployment.commissioning.operator import Kind, Question
from deployment.commissioning.rig import RealTime
from deployment.commissioning.simulated import SimulatedMachine, SimulatedOperator
from runtime.can.port import frame_source, open_bus

BIT_RATE = 250_000


def main(channel: str) -> None:
    """Until stdin ends."""
    bus = open_bus("slewright", channel, BIT_RATE)
    source, pace, tick, doing = frame_source(bus), RealTime(), 0, None
    with SimulatedMachine() as machine:
        operator = SimulatedOperator(machine)
        print("ready", flush=True)
        while True:
            pace.wait(tick)
            machine.wait(tick)
            while (frame := source.recv_raw()) is not None:
                machine.send_raw(*frame[:2])
            while (frame := machine.recv_raw()) is not None:
                source.send_raw(*frame[:2])
            tick += 1
            if doing is None and select.select([sys.stdin], [], [], 0)[0]:
                key = sys.stdin.readline().strip()
                if not key:
                    return
                doing = operator.answer(Question(Kind.DO, key, ""))
            if doing is not None:
                try:
                    next(doing)
                except StopIteration as end:
                    doing = None
                    operator.watching()  # whatever is asked about next begins now
                    print(f"did {end.value}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
