"""In which order components are propagated, and which of them form loops."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from orchestrator.system.link import Link
from orchestrator.system.system import System

Node = TypeVar("Node", bound=Hashable)


@dataclass(frozen=True)
class Order:
    """Positions of components so that sources come before what they feed.

    `loop[i]` is 0, or the number of the group of mutually fed components that `positions[i]` belongs to; the
    members of a group stand side by side.
    """

    positions: tuple[int, ...]
    loop: tuple[int, ...]


def dependency_order(names: Sequence[str], links: Iterable[Link]) -> Order:
    """The order of components `names`.

    Within a loop the component with the fewest inputs still missing goes first; ties as declared.
    """
    feeds: dict[str, set[str]] = {name: set() for name in names}
    for link in links:
        if link.source.owner:
            feeds[link.source.owner].add(link.target.owner)
    positions: list[int] = []
    loop: list[int] = []
    number = 0
    for group in strongly_connected(feeds):
        looped = len(group) > 1 or group[0] in feeds[group[0]]
        number += looped
        ordered = _opened_loop(sorted(group, key=names.index), feeds) if looped else group
        positions += [names.index(name) for name in ordered]
        loop += [number if looped else 0] * len(group)
    return Order(tuple(positions), tuple(loop))


def algebraic_loops(system: System) -> list[list[str]]:
    """Closed chains of direct feedthrough, each as its signals `component.output`.

    An FMU that does not state its dependencies is taken to have none: what is listed is certain.
    """
    feeds: dict[str, set[str]] = {}
    for link in system.links:
        if not link.source.owner:
            continue
        target = link.target
        for output, inputs in system.components[target.owner].model.dependencies.items():
            if inputs is not None and target.name in inputs:
                feeds.setdefault(str(link.source), set()).add(f"{target.owner}.{output}")
                feeds.setdefault(f"{target.owner}.{output}", set())
    return [g for g in strongly_connected(feeds) if len(g) > 1 or g[0] in feeds[g[0]]]


def strongly_connected(feeds: Mapping[Node, set[Node]]) -> list[list[Node]]:
    """Strongly connected components in topological order, ties in the order of `feeds` (Kosaraju)."""
    finished = _finishing_order(feeds)
    fed_by: dict[Node, list[Node]] = {node: [] for node in feeds}
    for node, targets in feeds.items():
        for target in targets:
            fed_by[target].append(node)
    seen: set[Node] = set()
    groups: list[list[Node]] = []
    for root in reversed(finished):
        group, stack = [], [root]
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                group.append(node)
                stack += fed_by[node]
        if group:
            groups.append(group)
    return groups


def _finishing_order(feeds: Mapping[Node, set[Node]]) -> list[Node]:
    """Depth first, without recursion: each node after all that it feeds."""
    place = {node: i for i, node in enumerate(feeds)}
    seen: set[Node] = set()
    finished: list[Node] = []
    for root in reversed(place):  # so that the reverse of the result keeps the declared order
        stack = [(root, False)]
        while stack:
            node, done = stack.pop()
            if done:
                finished.append(node)
            elif node not in seen:
                seen.add(node)
                stack.append((node, True))
                stack += [(target, False) for target in sorted(feeds[node], key=place.__getitem__)]
    return finished


def _opened_loop(group: list[str], feeds: Mapping[str, set[str]]) -> list[str]:
    needs = {name: {other for other in group if name in feeds[other]} - {name} for name in group}
    left, ordered = list(group), []
    while left:
        first = min(left, key=lambda name: len(needs[name] & set(left)))
        left.remove(first)
        ordered.append(first)
    return ordered
