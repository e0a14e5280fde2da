"""Tables generated from `specs/signals.toml`: the Modbus register map, the FMI variables, a table to read."""

import csv
import io
import json
from collections.abc import Iterable, Iterator

from specs.markdown import number
from specs.signals import Kind, Signal, definition, select
from specs.units import unit
from specs.wire import MODBUS_HEADER, REGISTERS, ModbusPlace, ModbusTable, ServiceRegister

MADE = "Generated from specs/signals.toml by slewright generate; do not edit."
SIGNALS = (
    "Every signal that crosses the machine's wires, and every signal of its simulation. Values are in SI",
    "units. *vr* is the FMI value reference. CAN: message, first bit + number of bits, scale, offset.",
    "Modbus: table, address, type.",
)
COLUMNS = (
    *("table", "address", "registers", "type", "word_order", "scale", "name", "unit", "min", "max", "start"),
    *("rate_hz", "timeout_s", "access", "values", "description"),
)


def modbus_csv() -> str:
    """The register map, tables in the order of function codes, registers in the order of addresses."""
    modbus = definition().modbus
    text = io.StringIO()
    text.write(f"# {MADE}\n# unit id {modbus.unit_id}; addresses count from 0; input: function 4,")
    text.write(f" holding: functions 3, 6 and 16; float32 is two registers, {modbus.word_order}\n")
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for name, table in modbus.tables.items():
        rows = [_signal_row(s, place) for s, place in _placed(name)]
        rows += [_service_row(key, place) for key, place in modbus.services.items() if place.table == name]
        writer.writerows(_header_rows(name, table))
        writer.writerows(sorted(rows, key=lambda row: int(str(row["address"]))))
    return text.getvalue()


def _placed(table: str) -> list[tuple[Signal, ModbusPlace]]:
    """Signals of one table by address."""
    found = [(s, s.modbus) for s in definition().signals.values() if s.modbus and s.modbus.table == table]
    return sorted(found, key=lambda pair: pair[1].address)


def header_values(table: ModbusTable) -> list[int]:
    """The numbers in a table's first registers: magic (2), model id, version of the map, body length."""
    modbus = definition().modbus
    letters = modbus.magic.encode("ascii")
    magic = [letters[0] << 8 | letters[1], letters[2] << 8 | letters[3]]
    return [*magic, table.model_id, modbus.version, table.length]


def _header_rows(name: str, table: ModbusTable) -> Iterator[dict[str, object]]:
    for address, (key, value) in enumerate(zip(MODBUS_HEADER, header_values(table), strict=True)):
        yield {"table": name, "address": address, "registers": 1, "type": "uint16", "scale": "1", "name": key,
               "unit": "1", "min": value, "max": value, "start": value, "access": "r",
               "description": f"header; {table.description}" if address == 0 else "header"}  # fmt: skip


def _signal_row(s: Signal, place: ModbusPlace) -> dict[str, object]:
    return {
        "table": place.table,
        "address": place.address,
        "registers": REGISTERS[place.type],
        "type": place.type,
        "word_order": place.word_order if REGISTERS[place.type] > 1 else "",
        "scale": number(place.scale),
        "name": s.name,
        "unit": s.unit,
        "min": number(s.min),
        "max": number(s.max),
        "start": number(s.start),
        "rate_hz": number(s.rate_hz),
        "timeout_s": number(s.timeout_s),
        "access": "rw" if place.table == "holding" else "r",
        "values": " ".join(f"{number}={text}" for number, text in s.values.items()),
        "description": s.description,
    }


def _service_row(name: str, place: ServiceRegister) -> dict[str, object]:
    return {"table": place.table, "address": place.address, "registers": 1, "type": "uint16", "scale": "1",
            "name": name, "unit": "1", "min": 0, "max": 0xFFFF, "start": 0,
            "access": "rw" if place.table == "holding" else "r",
            "description": f"server; {place.description}"}  # fmt: skip


def fmi_variables() -> str:
    """Units (as FMI writes them) and variables: value reference, range and causality on either side."""
    found = definition()
    lines = [f"# {MADE}", "# causality: in an FMU of the machine, in an FMU of a controller", ""]
    for name in sorted({s.unit for s in found.signals.values()}):
        u = unit(name)
        base = ", ".join(f"{key} = {n}" for key, n in u.exponents.items())
        lines.append(
            f"unit.{_key(name)} = {{ factor = {u.factor!r}, offset = {u.offset!r}, base = {{ {base} }} }}"
        )
    for s in sorted(found.signals.values(), key=lambda s: s.vr):
        lines += ["", *_fmi_variable(s)]
    return "\n".join(lines) + "\n"


def _fmi_variable(s: Signal) -> Iterator[str]:
    yield f"[variable.{s.name}]"
    yield f"vr = {s.vr}"
    yield f"unit = {_key(s.unit)}"
    for key in ("min", "max", "nominal", "start"):
        if (value := getattr(s, key)) is not None:
            yield f"{key} = {value!r}"
    for side in ("machine", "controller"):
        if causality := s.causality(side):
            yield f'{side} = "{causality}"'
    yield f"description = {_key(s.description)}"


def signals_markdown() -> str:
    """Every signal in one table to read, kind by kind."""
    lines = [f"<!-- {MADE} -->", "", "# Signals", "", *SIGNALS, ""]
    kinds: dict[Kind, None] = dict.fromkeys(s.kind for s in definition().signals.values())
    for kind in kinds:
        lines += [f"## {kind}", "", *_markdown_table(select(kind)), ""]
    return "\n".join(lines).rstrip("\n") + "\n"


def _markdown_table(found: Iterable[Signal]) -> Iterator[str]:
    yield "| name | unit | range | Hz | vr | CAN (message, bits, scale, offset) | Modbus | meaning |"
    yield "|---|---|---|---|---|---|---|---|"
    for s in found:
        can = s.can
        frame = ""
        if can:
            frame = f"{can.message} {can.start}+{can.length}, {number(can.scale)}, {number(can.offset)}"
        register = f"{s.modbus.table} {s.modbus.address} {s.modbus.type}" if s.modbus else ""
        spread = f"{number(s.min)} … {number(s.max)}"
        cells = (f"`{s.name}`", s.unit, spread, number(s.rate_hz), s.vr, frame, register, s.description)
        yield f"| {' | '.join(map(str, cells))} |"


def _key(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
