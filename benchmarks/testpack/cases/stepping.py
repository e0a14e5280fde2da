"""How systems are stepped: exchange of values, rates, loops, events, clocks, steps that go otherwise."""

from benchmarks.testpack.case import Case, cases
from benchmarks.testpack.cases.common import HOP, U, gain, source, whole
from benchmarks.testpack.render import annotation, component, connection, gives, takes


def _integrator(name: str, fmu: str) -> str:
    return component(name, fmu, takes("u"), gives("y"))


def _oscillator(step: float = 0.1, stop: float = 0.8, inner: str = "", **more: str) -> str:
    """x' = v, v' = -x from x = 1: two FMUs, each exact for an input that is held."""
    return whole(
        [_integrator("x", "integrator_one"), _integrator("v", "integrator_back")],
        [connection("v.y", "x.u"), connection("x.y", "v.u")],
        {"x.y": "Real"},
        stop=stop,
        annotated=annotation(step, inner, **more),
    )


def loop(first: str, second: str, stop: float = 2.0, **more: str) -> str:
    """y1 = k1 y2 + b1, y2 = k2 y1 + b2: an algebraic loop."""
    return whole(
        [gain("a", first), gain("b", second)],
        [connection("a.y", "b.u"), connection("b.y", "a.u")],
        {"a.y": "Real"},
        stop=stop,
        **more,
    )


def _alone(fmu: str, *outputs: tuple[str, str], inner: str = "", **more: str) -> str:
    shown = [gives(name, type) for name, type in outputs]
    return whole(
        [component("b", fmu, *shown)],
        [],
        {f"b.{name}": type for name, type in outputs},
        annotated=annotation(0.1, inner, **more),
    )


SAMPLER = whole(
    [source(), component("b", "sampler", takes("u"), gives("count", "Integer"), gives("sampled"))],
    [connection("a.y", "b.u")],
    {"b.count": "Integer", "b.sampled": "Real"},
)
COUNTS = (("count", "Integer"), ("last", "Real"))
ALGORITHMS = ("gauss-seidel", "iterate", "adaptive")


def _sampler(algorithm: str) -> str:
    return SAMPLER.replace('stepSize="0.1"', f'stepSize="0.1" algorithm="{algorithm}"')


def _slow(**more: str) -> str:
    return whole(
        [source(), _integrator("b", "integrator")],
        [connection("a.y", "b.u")],
        {"b.y": "Real"},
        annotated=annotation(0.1, '<slw:Component name="b" stepSize="0.4"/>', **more),
    )


BIAS = '<slw:Fault target="b.u" kind="bias" start_s="0.4" value="10"/>'
FAULT = whole(
    [source(), gain()], [connection("a.y", "b.u")], {"b.y": "Real"}, annotated=annotation(0.1, BIAS)
)
N = "(t/0.1)"
PHI = "acos(1 - 0.005)"

CASES: tuple[Case, ...] = (
    *cases(
        "oscillator",
        "two FMUs that drive each other, with steps of 0.01 s",
        _oscillator(0.01),
        expect={"x.y": "cos(t)"},
        tolerance=0.02,
        step_s=0.01,
    ),
    *cases(
        "jacobi",
        "all components step on the values of the step's begin",
        _oscillator(algorithm="jacobi"),
        expect={"x.y": f"1.01**({N}/2)*cos({N}*atan(0.1))"},
        own=True,
    ),
    *cases(
        "gauss-seidel",
        "components step one after the other, on the newest values",
        _oscillator(algorithm="gauss-seidel"),
        expect={"x.y": f"cos({N}*{PHI}) + tan({PHI}/2)*sin({N}*{PHI})"},
        own=True,
    ),
    *cases(
        "iterate",
        "steps are repeated until inputs and outputs agree: the trapezoidal rule",
        _oscillator(algorithm="iterate", tolerance="1e-12"),
        expect={"x.y": f"cos({N}*2*atan(0.05))"},
        own=True,
    ),
    *cases(
        "adaptive",
        "steps are halved until their error is small",
        _oscillator(algorithm="adaptive", tolerance="1e-5"),
        expect={"x.y": "cos(t)"},
        tolerance=2e-3,
        own=True,
    ),
    *cases(
        "two-rates",
        "a component that steps once in four steps",
        _slow(),
        expect={"b.y": "pick(whole(t/0.4), 0, 2, 4.016)"},
        own=True,
    ),
    *cases(
        "loop",
        "an algebraic loop that repetition solves",
        loop("gain_half", "gain_minus"),
        expect={"a.y": "2/3 + 0*t"},
        tolerance=1e-3,
        stop_s=2.0,
        times=(2.0,),
    ),
    *cases(
        "loop-initial",
        "the same loop, solved at the start",
        loop("gain_half", "gain_minus", 0.1),
        expect={"a.y": "2/3 + 0*t"},
        tolerance=1e-5,
        times=(0.0,),
        stop_s=0.1,
    ),
    *cases(
        "loop-steep",
        "an algebraic loop that repetition does not solve, at the start",
        loop("gain_half", "gain_steep", 0.1),
        expect={"a.y": "0.4 + 0*t"},
        tolerance=1e-5,
        times=(0.0,),
        stop_s=0.1,
    ),
    *cases(
        "counter",
        "an FMU that counts by itself",
        _alone("counter", COUNTS[0]),
        (2,),
        expect={"b.count": "whole(t/0.25)"},
    ),
    *cases(
        "events",
        "FMI 3 event mode: events between the steps are counted",
        _alone("counter", COUNTS[0]),
        (3,),
        expect={"b.count": "whole(t/0.25)"},
    ),
    *cases(
        "early-return",
        "an FMU returns early at each event, which then has its exact time (importers need not allow it)",
        _alone("counter", *COUNTS),
        (3,),
        expect={"b.last": "0.25*whole(t/0.25)"},
        own=True,
    ),
    *cases(
        "clock",
        "a periodic input clock ticks in every second step",
        SAMPLER,
        (3,),
        expect={"b.count": "whole(t/0.2) + 1", "b.sampled": U},
        tolerance=HOP,
        times=(0.1, 0.3, 0.5, 0.7),
    ),
    *(
        case
        for ticks in ("fixed", "tunable")
        for case in cases(
            f"clock-{ticks}",
            f"a periodic input clock whose interval is {ticks}",
            SAMPLER.replace("sampler.fmu", f"sampler_{ticks}.fmu"),
            (3,),
            expect={"b.count": "whole(t/0.2) + 1", "b.sampled": U},
            tolerance=HOP,
            times=(0.1, 0.3, 0.5, 0.7),
        )
    ),
    *cases(
        "warnings",
        "an FMU that returns Warning goes on",
        _alone("trouble_warns", ("y", "Real")),
        expect={"b.y": "t"},
    ),
    *cases(
        "discarded-half",
        "an FMU discards steps of which it did a half: the rest is done from the last successful time",
        _alone("trouble_discards", ("y", "Real")),
        expect={"b.y": "t"},
    ),
    *cases(
        "discarded-whole",
        "an FMU discards steps that are too long without beginning them: shorter ones are tried",
        _alone("trouble_refuses", ("y", "Real")),
        expect={"b.y": "t"},
    ),
    *cases(
        "terminates",
        "an FMU asks to end the simulation",
        _alone("trouble_terminates", ("y", "Real")),
        kind="ends",
        names=("component b", "0.5 s"),
    ),
    *cases(
        "clock-shift",
        "a periodic input clock that ticks for the first time in the second step",
        SAMPLER.replace("sampler.fmu", "sampler_later.fmu"),
        (3,),
        expect={"b.count": "whole((t + 0.1)/0.2)", "b.sampled": f"{U}*(t > 0.15)"},
        tolerance=HOP,
        times=(0.2, 0.4, 0.6, 0.8),
    ),
    *cases(
        "clock-inside",
        "a periodic input clock ticks inside steps, which are divided there",
        SAMPLER.replace("sampler.fmu", "sampler_odd.fmu"),
        (3,),
        expect={"b.count": "whole(t/0.25) + 1"},
        times=(0.1, 0.3, 0.4, 0.6, 0.8),
        own=True,
    ),
    *(
        case
        for ticks in ("changing", "countdown")
        for case in cases(
            f"clock-{ticks}",
            f"an input clock whose interval is {ticks}: its FMU tells when it ticks next",
            SAMPLER.replace("sampler.fmu", f"sampler_{ticks}.fmu"),
            (3,),
            expect={"b.count": "whole(t/0.2)", "b.sampled": f"{U}*(t > 0.2)"},
            tolerance=HOP,
            times=(0.1, 0.3, 0.5, 0.7),
        )
    ),
    *(
        case
        for algorithm in ALGORITHMS
        for case in (
            *cases(
                f"events-{algorithm}",
                f"events are counted once each, under the algorithm {algorithm}",
                _alone("counter", COUNTS[0], algorithm=algorithm),
                (3,),
                expect={"b.count": "whole(t/0.25)"},
                own=True,
            ),
            *cases(
                f"clock-{algorithm}",
                f"a clock ticks once each time, under the algorithm {algorithm}",
                _sampler(algorithm),
                (3,),
                expect={"b.count": "whole(t/0.2) + 1", "b.sampled": U},
                tolerance=HOP,
                times=(0.1, 0.3, 0.5, 0.7),
                own=True,
            ),
            *cases(
                f"discarded-{algorithm}",
                f"an FMU discards half of its steps, under the algorithm {algorithm}",
                _alone("trouble_discards", ("y", "Real"), algorithm=algorithm),
                expect={"b.y": "t"},
                own=True,
            ),
            *cases(
                f"two-rates-{algorithm}",
                f"a component that steps once in four steps, under the algorithm {algorithm}",
                _slow(algorithm=algorithm),
                expect={"b.y": "pick(whole(t/0.4), 0, 2, 4.016)"},
                tolerance=0.02,
                own=True,
            ),
        )
    ),
    *cases(
        "events-slow",
        "events of a component that steps once in four steps",
        _alone("counter", COUNTS[0], inner='<slw:Component name="b" stepSize="0.4"/>'),
        expect={"b.count": "pick(whole(t/0.4), 0, 1, 3)"},
        own=True,
    ),
    *cases(
        "fault",
        "a bias on a connection from 0.4 s on",
        FAULT,
        expect={"b.y": f"{U} + 10*(t > 0.45)"},
        tolerance=HOP,
        own=True,
    ),
)
