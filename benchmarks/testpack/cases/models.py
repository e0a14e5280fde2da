"""FMUs that must be refused."""

from benchmarks.testpack.case import Case, Package, cases
from benchmarks.testpack.cases.common import gain, whole

GAIN = Package(whole([gain("culprit")], [], {"culprit.y": "Real"}))
NAME = ("gain.fmu",)


def _bad(name: str, about: str, damage: str, *names: str, kind: str = "refused") -> list[Case]:
    return cases(name, about, GAIN, (2,), kind=kind, damage=damage, names=(*NAME, *names))


CASES: tuple[Case, ...] = (
    *_bad("fmu-missing", "the .ssp lacks an FMU", "FMU missing"),
    *_bad("fmu-truncated", "an FMU is cut in half", "FMU truncated"),
    *_bad("fmu-escapes", "an FMU holds a file that leaves its folder", "FMU escapes", "escaped.txt"),
    *_bad("fmu-platform", "an FMU is for another platform", "FMU of another platform", "riscv64-none"),
    *_bad(
        "fmu-no-description",
        "an FMU lacks modelDescription.xml",
        "FMU without description",
        "modelDescription.xml",
    ),
    *_bad("fmu-malformed", "modelDescription.xml is not well-formed", "FMU's description is cut"),
    *_bad("fmu-expands", "modelDescription.xml has a DTD with entities", "FMU expands"),
    *_bad("fmu-version", "an FMU of FMI 1.0", "FMU of version 1", "1.0"),
    *_bad("fmu-exchange", "an FMU for model exchange whose library lacks it", "FMU without co-simulation"),
    *_bad("fmu-tool", "an FMU that needs a tool", "FMU needs a tool", "tool"),
    *_bad("fmu-names", "two variables of one name", "FMU's name twice", "'k'"),
    *cases(
        "fmu-library",
        "an FMU's library is no library",
        GAIN,
        (2,),
        kind="fails",
        damage="FMU's library is text",
        names=("culprit",),
    ),
    *cases(
        "fmu-token",
        "an FMU does not instantiate",
        GAIN,
        (2,),
        kind="fails",
        damage="FMU's token is another",
        names=("culprit",),
    ),
)
