"""Progress goes to stderr, one line for each new thing where there is no terminal."""

from slewright.progress import progress


def test_each_new_thing_is_one_line_on_stderr(capsys):
    with progress("verify") as report:
        report("building", 0, 2)
        report("building", 1, 2)
        report("four_targets_empty [nominal]", 2, 2)
        report("report")
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.splitlines() == [
        "verify: building (0/2)",
        "verify: four_targets_empty [nominal] (2/2)",
        "verify: report",
    ]
