"""A short sample of the variants of recordings: none is read wrong without a word."""

import pytest

from tests.records.variants import run


def test_no_variant_is_read_wrong_in_silence():
    figures = run(220, 7)
    assert figures["silent"] == []
    assert all(of.get("right", 0) > of.get("refused", 0) for of in figures["kinds"].values())


@pytest.mark.long
def test_no_variant_of_thousands_is_read_wrong_in_silence():
    assert run(10_000, 1)["silent"] == []
