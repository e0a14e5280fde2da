"""What the heading of a column says: its unit, and its role by its words and unit."""

import re
from collections.abc import Sequence

from records.formats.units import OTHERS, is_unit, spelled
from specs.errors import InputError
from specs.units import compatible

WORDS = {
    "output": "out output response",
    "setpoint": "des desired ref reference target setpoint soll sollwert goal",
    "acceleration": "acc accel acceleration qdd ddq beschleunigung",
    "velocity": "v vel velocity speed omega w rpm rate qd dq qdot drehzahl geschwindigkeit geschw thetadot",
    "input": "u tau torque force cmd command voltage current moment drehmoment kraft pwm input spannung "
    "strom volt effort duty trq frc in valve spool pump heater throttle lever joystick control ctrl rudder",
    "position": "q p x y pos position angle phi theta winkel weg height hoehe encoder stroke lage ang",
}
ROLE_OF_WORD = {word: role for role, words in WORDS.items() for word in words.split()}
COMMANDS = ("command", "cmd", "input", "rudder")  # inputs whatever their unit: a position may be asked for
UNIT_ROLES = (
    ("rad", "position"), ("m", "position"), ("rad/s", "velocity"), ("m/s", "velocity"),
    ("rad/s2", "acceleration"), ("m/s2", "acceleration"), ("N", "input"), ("N.m", "input"),
)  # fmt: skip
SHORT_UNITS = {
    "degps": "deg/s", "dps": "deg/s", "radps": "rad/s", "mps": "m/s", "kmh": "km/h", "kph": "km/h",
}  # fmt: skip
QUANTITIES = {
    "level", "niveau", "stand", "fuellstand", "temp", "temperature", "temperatur", "pressure", "druck",
    "concentration", "humidity",
}  # fmt: skip
COMMAND_UNITS = ("V", "A", "%")
ENDINGS = "a heading that ends with _out is an output, one that ends with _in an input, as in 'u_in [V]'"


def unit_in_name(name: str) -> str:
    """The unit that a name ends with, as in `q_rad`, `torque(Nm)`, `speed rpm`, or is a word of it, as in
    `rpm1`; "" where it has none."""
    match = re.search(r"\(([^()]+)\)\s*$", name) or re.search(r"[_ .]([A-Za-z°%]+(?:/s|ps)?)$", name)
    text = match[1] if match else ""
    text = SHORT_UNITS.get(text.lower(), text)
    lone = len(text) == 1 and match is not None and not match[0].endswith(")") and text not in "VANm%"
    inlet = text == "in" and "position" not in roles_named(name)  # no inch
    if text and not lone and not inlet and is_unit(text):
        return spelled(text)
    return "rpm" if "rpm" in words_of(name) else ""


def words_of(name: str) -> list[str]:
    """The words of a name, in small letters."""
    return [w.lower() for w in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]


def roles_named(name: str) -> list[str]:
    """The roles that words of a name have."""
    return [ROLE_OF_WORD[w] for w in words_of(name) if w in ROLE_OF_WORD]


def role_of(name: str, unit: str) -> tuple[str, str]:
    """What a heading says that a column is, "" where nothing, and why."""
    words, named = words_of(name), roles_named(name)
    if "setpoint" in named and "input" not in named:
        return "setpoint", "its name says that it is a wanted value"
    if says_command(name) and (unit != "in" or "position" not in named):
        return "input", f"its name has '{next((w for w in words if w in COMMANDS), 'in')}'"
    if quantity := _quantity(words, named, unit):
        return "other", f"its name has '{quantity}'"
    of_unit = next((role for wanted, role in UNIT_ROLES if is_of(unit, wanted)), "")
    if of_unit and not (of_unit == "input" and words[-1:] == ["out"]):
        return of_unit, f"its unit is {unit}"
    if "output" in named:
        return "output", "its name says that it is an output"
    if unit in COMMAND_UNITS and (not named or "input" in named or (unit == "%" and words == ["q"])):
        return "input", f"its unit is {unit}"
    if unit and unit != "1":
        return "other", f"its unit is {unit}"
    order = [r for r in WORDS if r in named]
    return (
        (order[0], f"its name has '{words[[ROLE_OF_WORD.get(w) for w in words].index(order[0])]}'")
        if (order)
        else ("", "")
    )


def says_command(name: str) -> bool:
    """Whether a name says that it is an input, whatever its unit."""
    words = words_of(name)
    return bool(set(words) & set(COMMANDS)) or words[-1:] == ["in"]


def _quantity(words: Sequence[str], named: Sequence[str], unit: str) -> str:
    """The word of a name for what an output is, whatever its unit; "" of a pump's level in %."""
    found = next((w for w in words if w in QUANTITIES), "")
    return found if "input" not in named or is_of(unit, "m") else ""


def is_of(unit: str, wanted: str) -> bool:
    """Whether a unit measures what `wanted` does."""
    ours = OTHERS[unit][1] if unit in OTHERS else unit
    try:
        return bool(unit) and compatible(ours, wanted)
    except (InputError, KeyError):
        return False
