"""A limit put into a trained policy: slow changes pass, fast ones do not, and it can be taken out again."""

from pathlib import Path

import numpy as np
import pytest

from learning.policy.export import read
from learning.policy.limit import limit, main
from specs.errors import InputError
from tests.learning.policy.test_features import observations

POLICY = Path(__file__).resolve().parents[3] / "learning" / "policies" / "slew.onnx"


def test_a_limit_bounds_each_change_and_leaves_the_rest(tmp_path):
    before = read(POLICY)
    after = read(limit(POLICY, 0.15, tmp_path / "limited.onnx"))
    held = after.contract.layout.index("u_slew[0]")
    for seen in observations(50):
        u, free = after(seen), before(seen)
        assert abs(u[0] - seen[held]) <= 0.15 + 1e-9
        np.testing.assert_array_equal(u[1:], free[1:])
        seen[held] = free[0]  # what it wants is what it has
        if abs(before(seen)[0] - seen[held]) < 0.02:
            assert after(seen)[0] == pytest.approx(before(seen)[0], abs=1e-3)
    again = read(limit(tmp_path / "limited.onnx", before.contract.change, tmp_path / "again.onnx"))
    for (w, b), (v, c) in zip(before.weights, again.weights, strict=True):
        np.testing.assert_array_equal(w, v)
        np.testing.assert_array_equal(b, c)


@pytest.mark.parametrize("change", [-0.1, 99.0])
def test_a_limit_out_of_range_is_refused(tmp_path, change):
    with pytest.raises(InputError, match="valid: 0 to"):
        limit(POLICY, change, tmp_path / "x.onnx")
    with pytest.raises(SystemExit, match="2"):
        main([str(POLICY), "--change", str(change), "--out", str(tmp_path / "x.onnx")])
    assert not (tmp_path / "x.onnx").exists()


def test_the_command_line_says_in_one_line_what_is_wrong(tmp_path, capsys):
    for words, said in (
        ([str(POLICY), "--change", "99", "--out", str(tmp_path / "x.onnx")], "change 99; valid: 0 to"),
        ([str(POLICY), "--change", "much", "--out", "x"], "invalid float value: 'much'"),
        ([str(POLICY)], "required: --change, --out"),
    ):
        with pytest.raises(SystemExit, match="2"):
            main(words)
        (line,) = capsys.readouterr().err.splitlines()
        assert said in line


def test_a_place_that_cannot_be_written_is_named_and_nothing_left(tmp_path):
    (tmp_path / "folder").mkdir()
    for out, message in ((tmp_path / "folder", "is a folder"), (tmp_path / "none" / "x.onnx", "no folder")):
        with pytest.raises(InputError, match=message):
            limit(POLICY, 0.15, out)
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]
