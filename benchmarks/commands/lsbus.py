"""`python -m benchmarks lsbus`: the virtual controller over the bus FMU."""

from typing import Annotated

import typer

from benchmarks.lsbus import measure, missed
from records.figures_file import write
from slewright.figures import JsonOption, exit_if_missed
from slewright.tables import show


def lsbus(
    duration: Annotated[float, typer.Option(metavar="S", min=1.0, help="Simulated time.")] = 1000.0,
    controller: Annotated[str, typer.Option(metavar="NAME", help="Which controller.")] = "pd",
    json: JsonOption = None,
) -> None:
    """Simulate the reference machine under the virtual controller over the bus FMU, and by plain signals."""
    f = measure(duration, controller)
    rows = [
        ("times real time, over the bus", f"{f['times_real_time']:.1f}"),
        ("times the time by plain signals", f"{f['over_plain']:.2f}"),
        ("share of time in automatic operation", f"{100 * f['automatic']:.1f} %"),
        ("frames", f"{f['frames']:,}"),
        ("load of the bus", f"{100 * f['load']:.1f} %"),
        ("longest wait of a frame", f"{1e3 * f['longest_wait_s']:.2f} ms"),
        ("a second run is the same to the bit", "yes" if f["replayed"] else "no"),
        ("the machine did the same as by plain signals, to the bit", "yes" if f["equal"] else "no"),
    ]
    show(f"{f['simulated_s']:g} s of the reference machine, controller {f['controller']}", ["", ""], rows)
    write(json, f)
    exit_if_missed(missed(f))
