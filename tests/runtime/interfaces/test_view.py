"""The images as interfaces read them, alarms as lines, and what is said when a library is missing."""

import time
from pathlib import Path

import numpy as np
import pytest

from runtime.image import INPUT, OUTPUT, Status
from runtime.interfaces.beside import library
from runtime.interfaces.news import News
from runtime.interfaces.publish import ImagePort, create
from runtime.interfaces.view import INDEX, SIGNALS, View
from specs.errors import InputError
from tests.runtime.interfaces.beside import drawn, value


@pytest.fixture
def view(tmp_path: Path):
    port = ImagePort(create(tmp_path))

    def publish(images: tuple[np.ndarray, np.ndarray]) -> None:
        port.receive(images[0], 1)
        port.send(images[1], 1)

    return View.join(tmp_path), publish


def test_values_ages_and_what_is_not_known(view):
    seen, publish = view
    assert seen.new() is None
    assert seen.stale
    images = drawn(1)
    images[0]["status"][INPUT.at("q_boom")] = Status.TIMEOUT
    images[0]["status"][INPUT.at("q_stick")] = Status.CHECKSUM
    images[0]["age"][INPUT.at("q_stick")] = 3
    publish(images)
    found = seen.new()
    assert found
    assert seen.new() is None
    assert not seen.stale
    for s in SIGNALS:
        if s.name != "q_boom":
            assert found.of(s.name) == value(images, s.name)
    assert np.isnan(found.of("q_boom"))
    assert found.time_ns - found.source_ns(INDEX["q_stick"]) == 60_000_000
    assert abs(time.time_ns() - found.time_ns) < 60e9


def test_an_alarm_is_told_when_it_comes_and_when_it_goes(view):
    seen, publish = view
    news, images = News(), (INPUT.new(), OUTPUT.new())
    images[0]["status"] = Status.OK

    def lines() -> list[tuple[str, bool]]:
        publish(images)
        return [(line.text.split(":")[0], line.active) for line in news.of(seen.new())]

    assert lines() == [("mode", True)]
    images[0]["value"][INPUT.at("emergency_stop")] = 1.0
    assert lines() == [("Emergency stop is open", True)]
    assert lines() == []
    images[0]["value"][INPUT.at("emergency_stop")] = 0.0
    assert lines() == [("over", False)]


def test_a_library_that_is_missing_is_named_with_the_way_to_it():
    with pytest.raises(InputError, match=r"opcua: asyncua .* pip install 'slewright\[interfaces\]'"):
        library("no_such_library", "asyncua", "opcua")
