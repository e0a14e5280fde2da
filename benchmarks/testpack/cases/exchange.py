"""Model exchange: states that the importer integrates, events that it looks for."""

from benchmarks.testpack.case import Case, cases
from benchmarks.testpack.cases.common import HOP, U, gain, source, whole
from benchmarks.testpack.render import component, connection, gives, takes

CLOSE = 1e-3  # of an integrator with a tolerance of 1e-4 or less
FREE = {"u": takes("u"), "y": gives("y"), "count": gives("count", "Integer")}
SINK = 'name="b"'


def _fmu(name: str, kind: str, *connectors: str, implementation: str = "ModelExchange") -> str:
    shown = [FREE[c] for c in connectors]
    return component(name, f"exchange_{kind}", *shown, implementation=implementation)


def _alone(kind: str, outputs: dict[str, str], stop: float = 0.8) -> str:
    names = [name.rpartition(".")[2] for name in outputs]
    return whole([_fmu("b", kind, *names)], [], outputs, stop=stop)


LAG = f"({U} - 0.1 - 4.9*exp(-t))"  # y' = u - y from 0, for what the source gives
BALL = "(1 - 4*t**2)*(t < 0.5) + (2*(t - 0.5) - 4*(t - 0.5)**2)*(t >= 0.5)"

CASES: tuple[Case, ...] = (
    *cases(
        "exchange-lag",
        "an FMU for model exchange alone: y' = 5 - y",
        _alone("lag", {"b.y": "Real"}),
        expect={"b.y": "5*(1 - exp(-t))"},
        tolerance=CLOSE,
    ),
    *cases(
        "exchange-chosen",
        "an FMU that offers model exchange only, with nothing asked for",
        whole([_fmu("b", "lag", "y", implementation="any")], [], {"b.y": "Real"}),
        expect={"b.y": "5*(1 - exp(-t))"},
        tolerance=CLOSE,
    ),
    *cases(
        "exchange-input",
        "model exchange behind co-simulation",
        whole([source(), _fmu("b", "lag", "u", "y")], [connection("a.y", "b.u")], {"b.y": "Real"}),
        expect={"b.y": LAG},
        tolerance=HOP,
    ),
    *cases(
        "exchange-output",
        "co-simulation behind model exchange",
        whole(
            [source(), _fmu("b", "lag", "u", "y"), gain("c", "gain_double")],
            [connection("a.y", "b.u"), connection("b.y", "c.u")],
            {"c.y": "Real"},
        ),
        expect={"c.y": f"2*{LAG}"},
        tolerance=0.5,  # a step's delay
        times=(0.8,),
    ),
    *cases(
        "exchange-state-event",
        "a ball bounces: an event that the states lead to",
        _alone("ball", {"b.y": "Real", "b.count": "Integer"}),
        expect={"b.y": BALL, "b.count": "1*(t > 0.5)"},
        tolerance=CLOSE,
        times=(0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8),
    ),
    *cases(
        "exchange-time-event",
        "an event every 0.25 s, between the steps: y' = count",
        _alone("stairs", {"b.y": "Real", "b.count": "Integer"}),
        expect={"b.y": "(t - 0.25)*(t > 0.25) + (t - 0.5)*(t > 0.5) + (t - 0.75)*(t > 0.75)",
                "b.count": "whole(t/0.25)"},
        tolerance=CLOSE,
        times=(0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8),
    ),
    *cases(
        "exchange-iterate",
        "steps of an integrator that are taken back",
        _alone("ball", {"b.y": "Real"}).replace('stepSize="0.1"', 'stepSize="0.1" algorithm="iterate"'),
        expect={"b.y": BALL},
        tolerance=CLOSE,
        times=(0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8),
        own=True,
    ),
    *cases(
        "exchange-lacking",
        "model exchange is asked for, and the FMU lacks it",
        whole([component("b", "gain", gives("y"), implementation="ModelExchange")], [], {"b.y": "Real"}),
        kind="refused",
        names=("ModelExchange", "CoSimulation", "component b"),
    ),
    *cases(
        "exchange-endless",
        "events that follow each other ever faster, without end",
        _alone("ball", {"b.y": "Real"}, stop=2.0),
        kind="fails",
        names=("component b", "without end"),
        stop_s=2.0,
    ),
    *cases(
        "exchange-no-number",
        "a derivative becomes NaN",
        _alone("broken", {"b.y": "Real"}),
        kind="fails",
        names=("component b", "der(y)"),
    ),
)  # fmt: skip
