"""What reading a large table in text and writing it as MF4 cost: peak memory, and how cost grows with rows
and with columns.

Each reading is a process of its own, whose peak the system tells.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
ROWS = (1_000_000, 10_000_000)
COLUMNS = (2_000, 20_000)  # of numbers, in 20 rows
LIMIT_MB = 500.0  # of the process that reads the most rows
SUPERLINEAR = 2.0  # so many times what growth with size would be, at most
PART = 100_000
WRITE = "import sys; from slewright.__main__ import main; main(['convert', *sys.argv[1:]])"
READ = "import sys; from records.formats import read_measurement as r; print(len(r(sys.argv[1]).channels))"


def measure() -> dict[str, Any]:
    """Peak memory [MB] and processor time [s] by rows and by columns; growth, 1 where it is proportional."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        rows = {str(n): _read(_long(path, n)) for n in ROWS}
        written = {str(ROWS[-1]): _used(WRITE, path, path.with_suffix(".mf4"))}
        columns = {str(n): _read(_wide(path, n)) for n in COLUMNS}
    return {
        "rows": rows,
        "written": written,
        "columns": columns,
        "growth": {"rows": _growth(rows), "columns": _growth(columns)},
    }


def missed(figures: dict[str, Any]) -> list[str]:
    """Which of the limits were not kept."""
    peaks = {kind: figures[kind][str(ROWS[-1])]["peak_mb"] for kind in ("rows", "written")}
    found = [
        f"{kind}: {peak:.0f} MB, more than {LIMIT_MB:.0f}" for kind, peak in peaks.items() if peak > LIMIT_MB
    ]
    return found + [
        f"cost by {name} grows {growth:.1f} times as much as they do"
        for name, growth in figures["growth"].items()
        if growth > SUPERLINEAR
    ]


def _long(path: Path, count: int) -> Path:
    with path.open("w") as file:
        file.write("time [s],p [bar],q [deg]\n")
        for first in range(0, count, PART):
            numbers = range(first, min(count, first + PART))
            file.writelines(
                f"{k * 1e-3:.3f},{k % 977 * 0.25:.2f},{k * 7 % 3601 * 0.1 - 180:.1f}\n" for k in numbers
            )
    return path


def _wide(path: Path, count: int) -> Path:
    with path.open("w") as file:
        file.write(",".join(["time [s]", *(f"c{i}" for i in range(count))]) + "\n")
        for k in range(20):
            file.write(
                ",".join([f"{k * 0.02:.2f}", *(f"{(k + i) % 97 * 0.5:.1f}" for i in range(count))]) + "\n"
            )
    return path


def _read(path: Path) -> dict[str, float]:
    """What a process that reads the file takes."""
    return _used(READ, path)


def _used(code: str, *paths: Path) -> dict[str, float]:
    """Peak [MB = 10^6 bytes] and processor time of a process."""
    command = [sys.executable, "-c", code, *map(str, paths)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"what was done with {paths[0]} ended with {process.returncode}")
    return {"peak_mb": used.ru_maxrss * 1024 / 1e6, "cpu_s": used.ru_utime + used.ru_stime}


def _growth(by_size: dict[str, dict[str, float]]) -> float:
    """Processor time of the larger one over that of the smaller one, over how much larger it is."""
    (small, a), (large, b) = by_size.items()
    return b["cpu_s"] / a["cpu_s"] / (int(large) / int(small))
