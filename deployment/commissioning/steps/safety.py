"""Emergency stop, enabling switch, joystick, the other switches: each is worked and seen; nothing moves."""

import numpy as np

from deployment.commissioning.bench import Bench
from deployment.commissioning.rig import AXES, JOYSTICKS

LEFT = {"slew": "left", "boom": "up", "stick": "out"}  # the positive way
RIGHT = {"slew": "right", "boom": "down", "stick": "in"}


def run(bench: Bench) -> None:
    """Released, joystick, switches, enabling, emergency stop."""
    bench.rig.hands_off = False
    bench.do("switch.enable.0", "Let go of the enabling switch, emergency stop pulled out, joysticks at rest")
    _states(
        bench,
        "nothing held",
        {"operator_enable": 0, "emergency_stop": 0, "machine_ready": 1, "pilot_enabled": 0},
    )
    _states(bench, "nothing held", {"automatic_request": 0, "automatic_allowed": 1, "machine_fault": 0})
    _pilot(bench, "nothing held", on=False)
    bench.equal("mode, nothing held", bench.rig.mode, "standby", "fault: " + bench.rig.fault)
    bench.verdict()
    for axis in AXES:
        _joystick(bench, axis)
    bench.verdict()
    _toggle(bench, "automatic", "automatic_request", "the automatic switch", 1)
    _toggle(bench, "allowed", "automatic_allowed", "the key switch that lets the controller drive", 0)
    bench.verdict()
    hold(bench)
    _stop(bench)
    release(bench)
    bench.verdict()


def hold(bench: Bench) -> None:
    """Have the enabling switch held until the core is armed; Failed if that does not come about."""
    rig = bench.rig
    rig.hands_off = False
    for _ in range(3):  # a latched fault takes two
        if rig.mode == "armed":
            break
        bench.do("switch.enable.0", "Let go of the enabling switch")
        bench.do("switch.enable.1", "Hold the enabling switch")
    _states(bench, "held", {"operator_enable": 1, "machine_ready": 1, "pilot_enabled": 1})
    _pilot(bench, "held", on=True)
    bench.equal("mode, enabling switch held", rig.mode, "armed", f"fault: {rig.fault}")
    bench.verdict()
    rig.taken_over, rig.hands_off = False, True


def release(bench: Bench) -> None:
    """Have it let go."""
    bench.rig.hands_off = False
    bench.do("switch.enable.0", "Let go of the enabling switch")
    bench.wait(0.3)
    _states(bench, "let go", {"operator_enable": 0, "pilot_enabled": 0})
    _pilot(bench, "let go", on=False)
    bench.equal("control_enable, let go", bench.rig.now("control_enable"), 0.0, "the control core's mode")
    bench.verdict()


def _stop(bench: Bench) -> None:
    bench.rig.hands_off = False
    bench.do("switch.stop.1", "Press the emergency stop, the enabling switch still held")
    _states(bench, "emergency stop", {"emergency_stop": 1, "machine_ready": 0, "pilot_enabled": 0})
    _pilot(bench, "emergency stop", on=False)
    bench.equal("mode, emergency stop", bench.rig.mode, "fault", "the emergency stop's report on CAN")
    bench.equal("fault, emergency stop", bench.rig.fault, "emergency_stop")
    bench.do("switch.stop.0", "Pull the emergency stop out again")
    _states(bench, "emergency stop pulled out", {"emergency_stop": 0, "machine_ready": 1})


def _states(bench: Bench, when: str, wanted: dict[str, int]) -> None:
    for name, value in wanted.items():
        look = f"the wiring of {name}: contact, normally open or closed, which input"
        bench.equal(f"{name}, {when}", bench.rig.now(name), float(value), look)


def _pilot(bench: Bench, when: str, on: bool) -> None:
    """Pilot pressure downstream of enabling switch and emergency stop: they must cut it by themselves."""
    f, pressure = bench.f, bench.rig.now("supply_pressure") / 1e5
    low, high = (f.commissioning_pilot_on / 1e5, 60.0) if on else (-1.0, f.commissioning_pilot_off / 1e5)
    bench.between(
        f"pilot pressure, {when}", pressure, low, high, "bar", "the pilot valve and its hard wiring"
    )


def _joystick(bench: Bench, axis: str) -> None:
    begin = bench.rig.tick
    way = f"{LEFT[axis]}, then fully {RIGHT[axis]}, and let go"
    bench.do(f"joystick.{axis}", f"Enabling switch let go: move the joystick of the {axis} fully {way}")
    trace = bench.rig.since(begin)
    f, own = bench.f, trace[f"joystick_{axis}"]
    full = (f.commissioning_full_joystick, 1.0)
    look = f"the joystick's axes of the {axis}: channel, sign, calibration of its end"
    bench.between(f"joystick_{axis}, fully {LEFT[axis]}", float(own.max()), *full, "", look)
    bench.between(f"joystick_{axis}, fully {RIGHT[axis]}", float(-own.min()), *full, "", look)
    bench.equal(f"joystick_{axis}, which way first", int(np.argmax(own) < np.argmin(own)), 1, look)
    for name in JOYSTICKS:
        if name != f"joystick_{axis}":
            most = float(np.abs(trace[name]).max())
            bench.between(f"{name} meanwhile", most, 0.0, f.commissioning_joystick_rest, "", look)
    _half(bench, axis, look)


def _half(bench: Bench, axis: str, look: str) -> None:
    """Halfway: one that reads too much is at its limit already; at the end it looks like a good one."""
    begin, spread = bench.rig.tick, bench.f.commissioning_half_joystick
    bench.do(f"joystick.{axis}.half", f"Move the joystick of the {axis} halfway {LEFT[axis]}, and let go")
    most = float(bench.rig.since(begin)[f"joystick_{axis}"].max())
    bench.between(f"joystick_{axis}, halfway {LEFT[axis]}", most, 0.5 - spread, 0.5 + spread, "", look)


def _toggle(bench: Bench, switch: str, name: str, what: str, there: int) -> None:
    for value in (there, 1 - there):
        bench.do(f"switch.{switch}.{value}", f"Turn {what} {'on' if value else 'off'}")
        _states(bench, f"{what} {'on' if value else 'off'}", {name: value})
