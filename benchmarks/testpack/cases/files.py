"""Archives and files that must be refused."""

from benchmarks.testpack.case import Case, Package, cases
from benchmarks.testpack.cases.common import gain, pair, whole
from benchmarks.testpack.render import (
    XML,
    binding,
    bindings,
    component,
    connection,
    gives,
    ssd,
    system,
    takes,
)

PAIR = Package(pair())
SSD = ("SystemStructure.ssd",)


def _bad(name: str, about: str, damage: str, *names: str) -> list[Case]:
    return cases(name, about, PAIR, (2,), kind="refused", damage=damage, names=names)


def _text(name: str, about: str, text: str, *names: str, at: str = "") -> list[Case]:
    return cases(name, about, text, (2,), kind="refused", names=names, at=at)


DTD = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
SELF = ssd(
    system(
        "inner",
        [component("again", "resources/inner.ssd", type="application/x-ssp-definition")],
        [],
        [takes("in"), gives("out")],
    )
)


def _with_values(source: str) -> str:
    return whole([gain("b", bindings=bindings(binding(source=source)))], [], {"b.y": "Real"})


CASES: tuple[Case, ...] = (
    *_bad("truncated", "the .ssp is cut in half", "truncated"),
    *_bad("not-a-zip", "the .ssp is no zip archive", "not a zip"),
    *_bad("no-description", "the .ssp holds no SystemStructure.ssd", "no description", *SSD),
    *_bad("escapes", "an entry of the archive leaves its folder", "escapes", "escaped.txt"),
    *_bad("links", "an entry of the archive is a symbolic link", "links", "link.txt"),
    *_text(
        "source-escapes",
        "a component's source leaves the package",
        whole([component("b", "../../outside.fmu", takes("u"), gives("y"))], [], {"b.y": "Real"}),
        "outside.fmu",
        at="outside.fmu",
    ),
    *_text(
        "malformed", "the description is not well-formed XML", pair().replace("</ssd:Elements>", ""), *SSD
    ),
    *_text("expands", "the description has a DTD with entities", pair().replace(XML, f"{XML}\n{DTD}"), *SSD),
    *_text("other-root", "the description is another kind of file", f"{XML}\n<html/>\n", *SSD),
    *_text(
        "values-missing",
        "an .ssv file is missing",
        _with_values("resources/absent.ssv"),
        "absent.ssv",
    ),
    *cases(
        "values-malformed",
        "an .ssv file is not well-formed XML",
        Package(_with_values("resources/values.ssv"), {"resources/values.ssv": "<values>"}),
        (2,),
        kind="refused",
        names=("values.ssv",),
    ),
    *_text(
        "ssd-missing",
        "an .ssd file is missing",
        whole(
            [component("b", "resources/absent.ssd", takes("u"), type="application/x-ssp-definition")], [], {}
        ),
        "absent.ssd",
        at="absent.ssd",
    ),
    *cases(
        "contains-itself",
        "a system contains itself",
        Package(
            whole(
                [
                    component(
                        "b",
                        "resources/inner.ssd",
                        takes("in"),
                        gives("out"),
                        type="application/x-ssp-definition",
                    ),
                    gain("c"),
                ],
                [connection("b.out", "c.u")],
                {"c.y": "Real"},
            ),
            {"resources/inner.ssd": SELF.replace('"resources/', '"')},
        ),
        (2,),
        kind="refused",
        names=("inner.ssd",),
    ),
)
