"""Systems that several subjects use: a source a, and what follows it."""

from collections.abc import Iterable, Mapping

from benchmarks.testpack.render import component, connection, gives, ssd, system, takes

U = "(5 + 0.1*t)"  # what the FMU `source` gives
HOP = 0.05  # more than a step's delay of it, and of what is made of it


def watched(outputs: Mapping[str, str]) -> tuple[list[str], list[str]]:
    """Connectors of the system and connections that show variables: "b.y" as b_y; by type.

    The type of an enumeration is "Enumeration NAME".
    """
    names = {end: end.replace(".", "_") for end in outputs}
    return (
        [_shown(names[end], type) for end, type in outputs.items()],
        [connection(end, names[end]) for end in outputs],
    )


def _shown(connector: str, type: str) -> str:
    kind, _, name = type.partition(" ")
    return gives(connector, kind, **({"name": name} if name else {}))


def whole(
    elements: Iterable[str],
    connections: Iterable[str],
    outputs: Mapping[str, str],
    connectors: Iterable[str] = (),
    bindings: str = "",
    dictionaries: str = "",
    **more: object,
) -> str:
    """A description of these elements, with the variables `outputs` (and their types) shown outside."""
    shown, shown_by = watched(outputs)
    inner = system("case", elements, [*connections, *shown_by], [*connectors, *shown], bindings, dictionaries)
    return ssd(inner, **more)  # type: ignore[arg-type]


def source(name: str = "a", output: str = "y", type: str = "Real", **more: str) -> str:
    """The source, with one output."""
    return component(name, "source", gives(output, type, **more))


def gain(name: str = "b", fmu: str = "gain", bindings: str = "", **more: str) -> str:
    """A gain, with input and output."""
    return component(name, fmu, takes("u", **more), gives("y", **more), bindings=bindings)


def pair(inner: str = "", backwards: bool = False, **more: str) -> str:
    """source a → gain b, with something on the connection."""
    ends = ("b.u", "a.y") if backwards else ("a.y", "b.u")
    return whole([source(), gain()], [connection(*ends, inner, **more)], {"b.y": "Real"})
