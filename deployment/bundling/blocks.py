"""The C sources of one block: the model's FMU code under names of its own, and which signals it has.

A core holds several models, whose FMU code has the same symbols (slw_f ...).  Every file of the shim and the
generated model.c is copied with `slw_` and `model_` as `NAME_slw_` and `NAME_model_`: it is the same code
otherwise, and gives the same bits.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from fmus.definition import Model
from fmus.paths import SHIM
from fmus.toolchain import codegen
from fmus.toolchain.build import SHIM_FILES
from runtime.image import INPUT, OUTPUT, TICK_S
from runtime.interfaces.outside import HEARTBEAT, PREFIX
from specs.errors import InputError

CORE = Path(__file__).parents[2] / "runtime" / "core"
SYMBOLS = re.compile(r"\b(slw|model)_(?!math|config)")
COMPILED = ("core.c", "integrator.c", "model.c", "block.c")


@dataclass(frozen=True)
class Block:
    """A discrete model as a block of the core, and the prefix of its symbols."""

    model: Model
    name: str

    def __post_init__(self) -> None:
        _check(self.model)

    @property
    def symbol(self) -> str:
        """What the core calls it."""
        return f"{self.name}_block"

    @property
    def inputs(self) -> list[str]:
        """Signals that it reads off the input image."""
        return [v.name for v in self.model.inputs if v.name in INPUT.index]

    def write(self, folder: Path) -> None:
        """Write its sources into `folder`."""
        folder.mkdir(parents=True, exist_ok=True)
        code = codegen.model_c(self.model)
        files = {name: (SHIM / name).read_text() for name in SHIM_FILES}
        token = codegen.token(self.model, code, "".join(files.values()))
        files |= {"model.c": code, "model_config.h": codegen.model_config_h(self.model, token)}
        files |= {"block.c": (CORE / "block.c").read_text(), "block_map.h": self._map()}
        for name, text in files.items():
            (folder / name).write_text(SYMBOLS.sub(rf"{self.name}_\1_", text))

    def _map(self) -> str:
        inputs = ", ".join(_place(v.name) for v in self.model.inputs)
        outputs = ", ".join(_place(v.name) for v in self.model.outputs)
        return (
            f"/* Signals of the block {self.name}, generated. */\n"
            f'#define SLR_BLOCK {self.symbol}\n#define SLR_BLOCK_NAME "{self.name}"\n'
            f"#define SLR_BLOCK_PERIOD {_period(self.model)}\n"
            f"#define SLR_BLOCK_INPUTS {{{inputs}}}\n#define SLR_BLOCK_OUTPUTS {{{outputs}}}\n"
            f"extern const SlrBlock {self.symbol};\n"
        )


@dataclass(frozen=True)
class External:
    """In a controller's place: what is offered from outside (runtime/core/external.c)."""

    inputs: list[str]
    symbol: str = "external_block"
    outputs: tuple[str, str, str] = ("u_slew", "qd_boom_ref", "qd_stick_ref")  # of a policy, specs/policy.py
    period: int = 5  # ticks: 10 Hz


@dataclass(frozen=True)
class Outside:
    """In a controller's place: inputs handed on that a policy outside gives (runtime/core/outside.c)."""

    symbol: str = "outside_block"
    outputs: tuple[str, ...] = ("u_slew", "qd_boom_ref", "qd_stick_ref")  # of a policy, specs/policy.py

    @property
    def inputs(self) -> list[str]:
        """The signals that it reads off the input image: all that the policy says, its heartbeat too."""
        return [*self.commands, HEARTBEAT.name]

    @property
    def commands(self) -> list[str]:
        """Those that it hands on, in the order of `outputs`."""
        return [f"{PREFIX}{name}" for name in self.outputs]


def _period(model: Model) -> int:
    return codegen.whole(model.step, TICK_S, f"model {model.name}: period")


def _place(name: str) -> str:
    return f"SLR_IN_{name}" if name in INPUT.index else f"SLR_OWN(SLR_OUT_{name})"


def _check(model: Model) -> None:
    """InputError for a model that cannot be a block, naming what is wrong with it."""
    if model.kind != "discrete":
        raise InputError(f"model {model.name} is continuous: a control core takes discrete models only")
    _period(model)
    known = {*INPUT.index, *OUTPUT.index}
    if missing := [v.name for v in model.inputs if v.name not in known]:
        raise InputError(f"model {model.name} reads {', '.join(missing)}: no signal of the process image")
    if missing := [v.name for v in model.outputs if v.name not in OUTPUT.index]:
        raise InputError(f"model {model.name} writes {', '.join(missing)}: no output of the process image")
