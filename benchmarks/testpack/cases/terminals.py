"""Terminals of FMUs: shown or not, they do no harm; connected by in this project's annotation.

SSP 2.0 knows no connections between terminals.
"""

from benchmarks.testpack.case import Case, cases
from benchmarks.testpack.cases.common import HOP, U, whole
from benchmarks.testpack.render import annotation, component, connection, gives, joined, takes

COUNT = "(whole(t/0.3) + 1)"
TIMES = (0.1, 0.2, 0.4, 0.5, 0.7, 0.8)  # not where the source counts


def _joined(start: str, end: str, *outputs: str) -> str:
    types = {"real_out": "Real", "integer_out": "Integer", "boolean_out": "Boolean"}
    shown = [gives(name, types[name]) for name in outputs]
    return whole(
        [component("a", "source_plug"), component("b", "echo_plug", *shown)],
        [],
        {f"b.{name}": types[name] for name in outputs},
        annotated=annotation(0.1, joined(start, end)),
    )


def _right(name: str, about: str, start: str, end: str, *outputs: str, sign: str = "") -> list[Case]:
    expect = {"real_out": f"{sign}{U} + 1", "integer_out": COUNT}
    return cases(
        f"terminals-{name}",
        about,
        _joined(start, end, *outputs),
        expect={f"b.{n}": expect[n] for n in outputs},
        tolerance=HOP,
        times=(0.2, 0.5, 0.8),
        own=True,
    )


def _bad(name: str, about: str, start: str, end: str, *names: str) -> list[Case]:
    return cases(
        f"terminals-{name}",
        about,
        _joined(start, end, "real_out"),
        kind="refused",
        names=(*names, start, end),
        at="<slw:TerminalConnection",
        own=True,
    )


CASES: tuple[Case, ...] = (
    *cases(
        "terminals-plain",
        "FMUs with terminals, connected by their variables",
        whole(
            [
                component("a", "source_plug", gives("y")),
                component("b", "echo_plug", takes("real_in"), gives("real_out")),
            ],
            [connection("a.y", "b.real_in")],
            {"b.real_out": "Real"},
        ),
        expect={"b.real_out": f"{U} + 1"},
        tolerance=HOP,
    ),
    *_right("plug", "a plug: members by name, all of them", "a.plug", "b.plug", "real_out", "integer_out"),
    *_right("backwards", "the same, from input to output", "b.plug", "a.plug", "real_out", "integer_out"),
    *_right(
        "bus", "a bus: members by name, those that both have", "a.bus", "b.bus", "real_out", "integer_out"
    ),
    *_right("sequence", "a sequence: members by their place", "a.sequence", "b.sequence", "real_out"),
    *_right("nested", "a terminal in a terminal", "a.nested", "b.nested", "real_out", "integer_out"),
    *_right("flow", "what flows into one flows out of the other", "a.flow", "b.outflow", "real_out"),
    *_right(
        "signs", "two flows into their FMUs: one turns its sign", "a.flow", "b.inflow", "real_out", sign="-"
    ),
    *_bad("rules", "terminals of different rules", "a.plug", "b.bus", "rule plug", "rule bus"),
    *_bad("kinds", "terminals of different kinds", "a.plug", "b.kind", "case.a", "case.b"),
    *_bad("missing", "a plug without a member that the other has", "a.plug", "b.less", "switch"),
    *_bad("length", "sequences of different lengths", "a.sequence", "b.longer", "2", "3"),
    *_bad("nothing", "two buses without a member in common", "a.bus", "b.other", "text"),
    *_bad("outputs", "two outputs", "a.bus", "b.results", "a.y", "b.real_out"),
    *_bad("rule", "a rule that nobody knows", "a.own", "b.own", "case.rule", "plug, bus, sequence"),
    *cases(
        "terminals-unknown",
        "a terminal that is not there",
        _joined("a.plug", "b.plugg", "real_out"),
        kind="refused",
        names=("b", "'plugg'", "plug"),
        at="<slw:TerminalConnection",
        own=True,
    ),
)
