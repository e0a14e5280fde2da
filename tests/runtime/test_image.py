"""The process image: one layout for C and Python, from specs/signals.toml."""

import re

import numpy as np
import pytest

from runtime import image
from runtime.image import INPUT, OUTPUT, Status
from specs.errors import InputError
from specs.signals import definition, select, signal


def test_header_in_the_repository_is_up_to_date() -> None:
    assert image.write(check=True) == []


def test_input_holds_what_the_controller_receives_and_output_what_it_sends() -> None:
    messages = definition().bus.messages
    for s in select("command", "target", "sensor", "status"):
        assert s.can is not None
        message = messages[s.can.message]
        assert (s.name in INPUT.index) == ("Controller" in message.receivers), s.name
        assert (s.name in OUTPUT.index) == (message.sender == "Controller"), s.name


def test_every_holding_register_signal_is_an_input() -> None:
    holding = [s.name for s in definition().signals.values() if s.modbus and s.modbus.table == "holding"]
    assert holding
    assert set(holding) <= set(INPUT.index)


@pytest.mark.parametrize("layout", [INPUT, OUTPUT], ids=lambda layout: layout.side)
def test_layout_is_dense_and_a_whole_number_of_words(layout: image.Layout) -> None:
    assert layout.dtype.itemsize % 8 == 0
    fields = layout.dtype.fields
    assert fields is not None
    end = 0
    for name, (kind, offset, *_) in fields.items():
        assert offset == end, name
        assert offset % kind.base.alignment == 0, name
        end = offset + kind.itemsize
    assert end == layout.dtype.itemsize


def test_new_images_say_that_nothing_came_yet() -> None:
    fresh = INPUT.new()
    assert set(fresh["status"].tolist()) == {Status.NEVER}
    assert set(fresh["age"].tolist()) == {-1}
    assert fresh["value"][INPUT.at("pace")] == signal("pace").start == 1.0
    assert OUTPUT.new()["status"].tolist() == [0] * len(OUTPUT.signals)
    assert INPUT.new().tobytes() == np.copy(fresh).tobytes()


def test_header_counts_from_nothing_but_the_layout() -> None:
    text = image.header()
    found = {n: int(i) for n, i in re.findall(r"SLR_IN_(\w+) = (\d+)", text)}
    assert found.pop("COUNT") == len(INPUT.signals)
    assert found == INPUT.index


def test_unknown_signal_is_named_with_its_neighbours() -> None:
    with pytest.raises(InputError, match=r"no input signal 'q_slow'; did you mean q_slew"):
        INPUT.at("q_slow")
