"""An FMU from any slew network: a model folder made for the occasion, built like every other."""

import re
import tempfile
from pathlib import Path

from fmus.models.slew_nn.network import SlewNetwork
from fmus.toolchain.build import build_fmu
from specs.errors import InputError

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
MODEL = '''"""A slew network of its own; written by fmus/models/slew_nn/fmu.py."""

from pathlib import Path

from fmus.models.slew_nn.model import of_network
from fmus.models.slew_nn.network import SlewNetwork

MODEL = of_network(SlewNetwork.load(Path(__file__).with_name("weights.npz")), "{name}", {ahead})
'''


def build_from(network: SlewNetwork, name: str, out: Path, fmi_version: int = 2) -> Path:
    """Build `out`/`name`.fmu with this network's weights; returns its path.

    `name` becomes the model identifier: letters, digits and underscores.  Raises InputError for another name,
    or a network that lacks an input.
    """
    check_name(name)
    network.check_whole()
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        folder = write_folder(network, name, Path(scratch) / "models")
        built = build_fmu(folder, fmi_version, out=Path(scratch) / "fmus")
        part = out / f".{name}.fmu.part"
        part.write_bytes(built.read_bytes())
    return part.replace(out / f"{name}.fmu")


def check_name(name: str) -> None:
    """Raise InputError unless `name` can be a model identifier (a C name)."""
    if not NAME.fullmatch(name):
        raise InputError(f"'{name}' cannot name an FMU; valid: letters, digits and _, no digit first")


def write_folder(network: SlewNetwork, name: str, parent: Path, ahead: int = 0) -> Path:
    """Write a model folder `parent`/`name` (model.py, weights.npz, README.md) and return it."""
    folder = parent / name
    folder.mkdir(parents=True)
    (folder / "model.py").write_text(MODEL.format(name=name, ahead=ahead))
    network.save(folder / "weights.npz")
    readme = Path(__file__).with_name("README.md")
    (folder / "README.md").write_text(readme.read_text())
    return folder
