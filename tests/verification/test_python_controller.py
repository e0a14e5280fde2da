"""A controller in Python runs exactly as the same equations do as an FMU; what it returns is checked."""

import numpy as np
import pytest

from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.loader import load_model, model_folders
from orchestrator.system.assembly import assemble
from specs import scenario, systems
from specs.errors import InputError
from verification.python_controller import COMMANDS, drive, verify_python
from verification.verify import Controller, verify

SCENARIO = "four_targets_empty"


class Stepped:
    """The equations of a model folder, in plain Python."""

    def __init__(self) -> None:
        self.model = DiscreteStepper(load_model("pd"))
        self.names = [v.name for v in load_model("pd").inputs]

    def step(self, sensors):
        self.model.set(**{name: sensors[name] for name in self.names})
        self.model.advance()
        return {name: float(self.model.outputs()[name]) for name in COMMANDS}


@pytest.mark.long
def test_it_makes_the_record_that_the_same_controller_as_fmu_makes(tmp_path):
    python = verify_python("pd", Stepped, [SCENARIO], out=tmp_path / "python")
    folder = model_folders()["pd"]
    fmu = verify([SCENARIO], out=tmp_path / "fmu", controller=Controller("pd", [folder]))
    for system in ("nominal", "reference"):
        found, wanted = python.own.runs[SCENARIO][system], fmu.own.runs[SCENARIO][system]
        assert len(found) == len(wanted)
        for name in (*COMMANDS, "q_slew", "q_boom", "true_tool_x", "target_x"):
            np.testing.assert_allclose(found.column(name), wanted.column(name), rtol=0, atol=1e-8)
    assert [v.passed for v in python.own.verdicts] == [v.passed for v in fmu.own.verdicts]
    assert python.report.is_file()


@pytest.mark.parametrize(
    ("commands", "said"),
    [
        ({"u_slew": 0.0}, "controller mine returns u_slew; wanted: u_slew, qd_boom_ref, qd_stick_ref"),
        (dict.fromkeys(COMMANDS, float("nan")), "u_slew = nan.*not finite"),
    ],
)
def test_wrong_commands_are_named(commands, said):
    class Wrong:
        def step(self, sensors):
            return commands

    system = assemble(systems.load("nominal").without("pi"))
    with pytest.raises(InputError, match=said):
        drive(Wrong(), "mine", scenario.load(SCENARIO), system, "nominal")
