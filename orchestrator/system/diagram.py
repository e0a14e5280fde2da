"""A system as a picture: `slewright check --graph`: components, connections, units, delays.

A connection to the right has its value in the same step with gauss-seidel, iterate and at the start; one that
leads back goes below the boxes, dashed: with jacobi and gauss-seidel its value is that of the last step.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape

from orchestrator.fmi.component import Component
from orchestrator.ssp.description import Port
from orchestrator.system.link import Link
from orchestrator.system.order import dependency_order
from orchestrator.system.system import System

CHARACTER, LINE, HEAD, PAD, LANE = 6.7, 19, 44, 10, 11  # px
BOLD = 1.25  # a heading's characters, of other ones
COLUMN_GAP, ROW_GAP, MARGIN = 90, 34, 24
INPUTS, OUTPUTS = "\0inputs", "\0outputs"  # no component is called so
STYLE = """
text{font:12px system-ui,sans-serif;fill:#1d2730}.name{font-weight:600;font-size:13px}
.small{fill:#55606b;font-size:11px}.box{fill:#fff;stroke:#b9c1c9}
path{fill:none;stroke:#134a7c;stroke-width:1.3}.changed{stroke:#b5602a}.back{stroke-dasharray:5 3}
.dot{fill:#134a7c}
""".replace("\n", "")


@dataclass
class _Box:
    """A component, or the system's inputs or outputs: what it says and where it stands."""

    lines: tuple[str, str]
    inputs: dict[str, str]  # connected variable -> text
    outputs: dict[str, str]
    column: int = 0
    x: float = 0.0
    y: float = 0.0

    @property
    def width(self) -> float:
        """Wide enough for its texts."""
        rows = [BOLD * len(self.lines[0]), len(self.lines[1])]
        sides = [max((len(t) for t in side.values()), default=0) for side in (self.inputs, self.outputs)]
        return max([*rows, sum(sides) + 3]) * CHARACTER + 2 * PAD

    @property
    def height(self) -> float:
        return HEAD + LINE * max(len(self.inputs), len(self.outputs)) + PAD / 2

    def port(self, name: str, out: bool) -> tuple[float, float]:
        """Where a connection begins or ends."""
        rows = list(self.outputs if out else self.inputs)
        return self.x + (self.width if out else 0.0), self.y + HEAD + LINE * rows.index(name) + 4


def draw(system: System) -> str:
    """The picture as SVG, the same for the same system."""
    links = [*system.links, *(output.link for output in system.outputs.values())]
    links = [link for link in links if link.source.owner in ("", *system.components)]
    boxes = _boxes(system, links)
    _place(system, boxes, links)
    right = max(box.x + box.width for box in boxes.values())
    bottom = max(box.y + box.height for box in boxes.values())
    edges, lanes = _edges(boxes, links, bottom)
    height, width = bottom + lanes * LANE + 3 * MARGIN, right + MARGIN
    foot = escape(f"{system.name}: {system.settings.algorithm}, step {system.step_s:g} s. {_legend(links)}")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}"><style>{STYLE}</style>'
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#fff"/>\n'
        f"{''.join(edges)}{''.join(_box(box) for box in boxes.values())}"
        f'<text class="small" x="{MARGIN}" y="{height - 12:.0f}">{foot}</text></svg>\n'
    )


def _legend(links: Iterable[Link]) -> str:
    converted = any(not link.conversion.is_identity for link in links)
    text = "Dashed: leads back, the value of the last step."
    return text + " Brown: the value is converted." * converted


# ---- what there is ----


def _boxes(system: System, links: Iterable[Link]) -> dict[str, _Box]:
    boxes = {INPUTS: _Box((system.name, "inputs"), {}, {})}
    boxes |= {name: _Box(_lines(system, c), {}, {}) for name, c in system.components.items()}
    boxes[OUTPUTS] = _Box((system.name, "outputs"), {}, {})
    for link in links:
        source, target = _ends(link)
        boxes[source].outputs[link.source.name] = _port_text(link.source, link.source_form.unit_name, system)
        boxes[target].inputs[link.target.name] = _port_text(link.target, link.target_form.unit_name, system)
    empty = [n for n in (INPUTS, OUTPUTS) if not boxes[n].inputs and not boxes[n].outputs]
    return {name: box for name, box in boxes.items() if name not in empty}


def _lines(system: System, component: Component) -> tuple[str, str]:
    model = component.model
    kind = "" if model.exchange is None else ", model exchange"
    step = "" if component.multiple == 1 else f", every {system.step_s * component.multiple:g} s"
    name = "" if model.model_name == component.name else f"{model.model_name}, "
    return component.name, f"{name}FMI {model.version_text}{kind}{step}"


def _port_text(port: Port, unit: str, system: System) -> str:
    """Name, size of an array, unit."""
    own = system.components.get(port.owner)
    connector = system.inputs.get(port.name) or system.outputs.get(port.name)
    if own is not None:
        variable = own.model.variables[port.name]
        size, unit = own.size(variable), variable.unit_name or unit
    else:
        size = connector.size if connector else 1
        unit = (connector.unit_name if connector else "") or unit
    return f"{port.name}{f'[{size}]' if size > 1 else ''}{f' [{unit}]' if unit not in ('', '1') else ''}"


def _ends(link: Link) -> tuple[str, str]:
    return link.source.owner or INPUTS, link.target.owner or OUTPUTS


# ---- where it stands ----


def _place(system: System, boxes: Mapping[str, _Box], links: Iterable[Link]) -> None:
    """Columns by the longest way from the inputs, rows by where the sources stand."""
    names = list(system.components)
    ordered = [names[i] for i in dependency_order(names, system.links).positions]
    sources: dict[str, list[str]] = {name: [] for name in boxes}
    for source, target in map(_ends, links):
        sources[target].append(source)
    known = [INPUTS] if INPUTS in boxes else []
    for name in [*ordered, *(n for n in boxes if n == OUTPUTS)]:
        boxes[name].column = max((boxes[s].column + 1 for s in sources[name] if s in known), default=0)
        known.append(name)
    if OUTPUTS in boxes:
        boxes[OUTPUTS].column = max(box.column for name, box in boxes.items() if name != OUTPUTS) + 1
    x = float(MARGIN)
    for column in range(max(box.column for box in boxes.values()) + 1):
        here = [name for name in known if boxes[name].column == column]
        here.sort(key=lambda name: _middle(boxes, [s for s in sources[name] if boxes[s].column < column]))
        y = float(MARGIN)
        for name in here:
            boxes[name].x, boxes[name].y = x, y
            y += boxes[name].height + ROW_GAP
        x += max((boxes[name].width for name in here), default=0.0) + COLUMN_GAP


def _middle(boxes: Mapping[str, _Box], names: Iterable[str]) -> float:
    heights = [boxes[name].y + boxes[name].height / 2 for name in names]
    return sum(heights) / len(heights) if heights else 0.0


# ---- how it is drawn ----


def _edges(boxes: Mapping[str, _Box], links: Iterable[Link], bottom: float) -> tuple[list[str], int]:
    """Paths, and how many lanes there are below the boxes: one for each signal that takes that way."""
    lanes: dict[Port, int] = {}
    turns: Counter[int] = Counter()
    edges = []
    for link in links:
        source, target = (boxes[name] for name in _ends(link))
        start, end = source.port(link.source.name, True), target.port(link.target.name, False)
        back = target.column <= source.column
        if target.column == source.column + 1:
            path = _curve(start, end)
        else:
            lane = lanes.setdefault(link.source, len(lanes))
            turns[target.column] += 1
            path = _below(
                start, end, bottom + LANE * (lane + 1.5), 8 + lane % 6 * 5, 8 + turns[target.column] % 6 * 5
            )
        names = " ".join(
            name for name, on in (("back", back), ("changed", not link.conversion.is_identity)) if on
        )
        title = escape(f"{link.source} → {link.target}")
        edges.append(f'<path class="{names}" d="{path}"><title>{title}</title></path>\n')
    return edges, len(lanes)


def _curve(start: tuple[float, float], end: tuple[float, float]) -> str:
    bend = max(30.0, (end[0] - start[0]) / 2)
    (x0, y0), (x1, y1) = start, end
    return f"M{x0:.0f} {y0:.0f}C{x0 + bend:.0f} {y0:.0f} {x1 - bend:.0f} {y1:.0f} {x1:.0f} {y1:.0f}"


def _below(start: tuple[float, float], end: tuple[float, float], lane: float, out: float, into: float) -> str:
    """Right of the source down to the lane, along it, and up left of the target."""
    (x0, y0), (x1, y1) = start, end
    return f"M{x0:.0f} {y0:.0f}H{x0 + out:.0f}V{lane:.0f}H{x1 - into:.0f}V{y1:.0f}H{x1:.0f}"


def _box(box: _Box) -> str:
    x, y, width = box.x, box.y, box.width
    parts = [
        f'<rect class="box" x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{box.height:.0f}" rx="4"/>',
        f'<text class="name" x="{x + PAD:.0f}" y="{y + 17:.0f}">{escape(box.lines[0])}</text>',
        f'<text class="small" x="{x + PAD:.0f}" y="{y + 32:.0f}">{escape(box.lines[1])}</text>',
    ]
    for names, out, anchor, at in (
        (box.inputs, False, "start", x + PAD - 2),
        (box.outputs, True, "end", x + width - PAD + 2),
    ):
        for name, text in names.items():
            px, py = box.port(name, out)
            parts.append(f'<circle class="dot" cx="{px:.0f}" cy="{py:.0f}" r="2.5"/>')
            parts.append(f'<text x="{at:.0f}" y="{py + 4:.0f}" text-anchor="{anchor}">{escape(text)}</text>')
    return "".join(parts) + "\n"
