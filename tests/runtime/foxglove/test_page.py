"""The program on docs/how-to/foxglove.md, as it stands there."""

import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from runtime.image import INPUT, Status
from tests.conftest import ROOT
from tests.runtime.interfaces.beside import Beside, drawn, statuses, value

pytest.importorskip("foxglove")


def test_the_pages_program_reads_what_the_image_holds(tmp_path: Path):
    page = (ROOT / "docs/how-to/foxglove.md").read_text()
    (program,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert program.count("8765") == 1
    images = drawn(4)
    statuses({s.name: Status.OK for s in INPUT.signals}, images[0])
    with Beside("foxglove", tmp_path, host="127.0.0.1", port=0, name="test") as served:
        (tmp_path / "program.py").write_text(program.replace("8765", served.ready))
        command = [sys.executable, str(tmp_path / "program.py")]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as client:
            served.publish(images)
            while client.poll() is None:
                served.publish()
                time.sleep(0.005)
            assert client.stdout
            lines = client.stdout.read().splitlines()
    assert client.returncode == 0
    assert len(lines) == 50
    ticks = [int(line.split()[0]) for line in lines]
    assert ticks == sorted(ticks)
    assert lines[-1].split()[1:] == [str(value(images, "q_slew")), "0"]
