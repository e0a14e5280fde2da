"""The recorder process, `python -m runtime.recorder JSON`: records until it is told to end."""

import json
import signal
from pathlib import Path

from runtime.helpers import end_with, run, told_to_end
from runtime.recorder.recorder import Recorder
from runtime.recorder.segments import Folder
from runtime.ring import Ring


def main(text: str) -> None:
    """Record what comes until SIGTERM; a Ctrl-C is the parent's affair."""
    told = json.loads(text)
    end_with(signal.SIGTERM)
    folder = Folder(Path(told["folder"]), int(told["limit"]))
    Recorder(Ring.attach(Path(told["ring"])), folder, told["metadata"], int(told["segment_ticks"])).run(
        told_to_end
    )


if __name__ == "__main__":
    run(main)
