"""Configuration files: read, or refused with one message; nothing else ever happens.

A case is a list of lines, each a tuple of one text.
"""

import random
import tempfile
from functools import cache
from pathlib import Path

import runtime
from runtime import configuration
from specs.errors import InputError
from specs.generate import FOLDER
from tests.edges import Edge, traced

PACKAGE = runtime
MESSAGE = 1500  # characters
Case = list[tuple[str]]
WORDS = (
    *(
        "0",
        "-1",
        "1",
        "1e999",
        "nan",
        "inf",
        "true",
        '""',
        '"x"',
        "[]",
        "{}",
        "[1, 2]",
        '"can0"',
        "1.5",
        "65536",
    ),
    *(
        '"/dev/null"',
        '"é"',
        "1979-05-27",
        "9223372036854775808",
        '"\\u0000"',
        '"""',
        "0x7f",
        "{ port = 1 }",
        "=",
    ),
)
WHOLE = """bundle = "pd.bundle"
unsigned = true
[can]
interface = "slewright"
channel = "bus"
bit_rate = 250000
[can.joystick]
cycle_ms = 50
slew = { source = 133, group = "BJM1", axis = "x", sign = -1 }
enable = { source = 133, group = "BJM1", button = 3 }
[rates]
base_hz = 50
policy_hz = 10
[realtime]
fifo = true
lock = false
priority = 70
core = 0
[modbus]
port = 1502
host = "127.0.0.1"
map = "modbus_map.csv"
tls = { port = 802, certificate = "server.pem", key = "server.key", authority = "ca.pem" }
[recorder]
folder = "recording"
limit_mb = 100
segment_s = 60
[retain]
folder = "retained"
signals = ["fault_code", "load_estimate"]
every_s = 5"""


@cache
def seeds() -> list[Case]:
    """Everything, and the least."""
    return [
        _case(WHOLE),
        _case('bundle = "b"\n[can]\ninterface = "socketcan"\nchannel = "can0"\n[modbus]\nport = 502'),
    ]


def run(case: Case, edges: set[Edge], images: list[bytes] | None = None) -> None:
    """Read it; AssertionError for a message that is none."""
    text = "\n".join(line for (line,) in case)
    with tempfile.TemporaryDirectory(prefix="slewright-fuzz-") as folder:
        path = Path(folder) / "machine.toml"
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        (Path(folder) / "modbus_map.csv").symlink_to(FOLDER / "modbus_map.csv")
        try:
            traced(lambda: configuration.read(path), PACKAGE, edges)
        except InputError as error:
            said = str(error)
            assert said, "no message"
            assert len(said) < MESSAGE, said
            assert said.count("\n") <= 2, said


def mutate(case: Case, chance: random.Random) -> Case:
    """One to three changes."""
    found = list(case)
    for _ in range(chance.randint(1, 3)):
        if not found:
            return list(seeds()[0])
        found = chance.choice((_value, _value, _drop, _again, _swap, _letter))(found, chance)
    return found


def _case(text: str) -> Case:
    return [(line,) for line in text.splitlines()]


def _value(case: Case, chance: random.Random) -> Case:
    at = chance.randrange(len(case))
    key = case[at][0].partition("=")[0]
    return [*case[:at], (f"{key}= {chance.choice(WORDS)}",), *case[at + 1 :]]


def _drop(case: Case, chance: random.Random) -> Case:
    at = chance.randrange(len(case))
    return [*case[:at], *case[at + chance.choice((1, 1, 5)) :]]


def _again(case: Case, chance: random.Random) -> Case:
    return [*case[: (at := chance.randrange(len(case)))], chance.choice(case), *case[at:]]


def _swap(case: Case, chance: random.Random) -> Case:
    a, b = chance.randrange(len(case)), chance.randrange(len(case))
    found = list(case)
    found[a], found[b] = case[b], case[a]
    return found


def _letter(case: Case, chance: random.Random) -> Case:
    at = chance.randrange(len(case))
    line = case[at][0]
    place = chance.randint(0, len(line))
    other = chance.choice(
        ("", chr(chance.choice((0, 34, 91, 123, 35, 228, 0x2028, chance.randrange(32, 127)))))
    )
    return [*case[:at], (line[:place] + other + line[place + 1 :],), *case[at + 1 :]]
