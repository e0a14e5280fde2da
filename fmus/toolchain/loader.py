"""Finds model folders and loads their `model.py`."""

import importlib.util
import sys
from pathlib import Path

from fmus.definition import Model
from fmus.paths import ROOT
from fmus.toolchain.tried import line
from specs.errors import InputError, nearest

ROOMS = ("fmus/models", "baselines")  # the folders that hold model folders


def model_folders() -> dict[str, Path]:
    """Every model folder of the project by name."""
    found = (path.parent for room in ROOMS for path in sorted((ROOT / room).glob("*/model.py")))
    return {folder.name: folder for folder in found}


def members_of(folder: Path) -> dict[str, Path]:
    """Model folders by name in a folder that is none itself, or in its `model`; {} if there are none."""
    if (folder / "model.py").is_file():
        return {}
    found = sorted(folder.glob("*/model.py")) or sorted(folder.glob("model/*/model.py"))
    return {path.parent.name: path.parent for path in found}


def load_model(folder: Path | str) -> Model:
    """Return MODEL of `folder`/model.py; `folder` may be a path or the name of a model of the project.

    Raises InputError if there is no such folder or its model.py cannot be imported or defines no MODEL.
    """
    path = Path(folder)
    if not (path / "model.py").is_file():
        known = model_folders()
        if str(folder) not in known:
            raise InputError(
                f"no model '{folder}': not a folder with a model.py; {nearest(str(folder), known)}"
            )
        path = known[str(folder)]
    module_name = "slewright_model_" + path.name
    spec = importlib.util.spec_from_file_location(module_name, path / "model.py")
    if spec is None or spec.loader is None:
        raise InputError(f"{path / 'model.py'} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except InputError:
        raise
    except Exception as error:  # the file is the user's: whatever is wrong with it is wrong input
        raise InputError(
            f"{path / 'model.py'}{line(error, path / 'model.py')} cannot be imported: "
            f"{type(error).__name__}: {error}"
        ) from error
    model = getattr(module, "MODEL", None)
    if not isinstance(model, Model):
        raise InputError(f"{path / 'model.py'}: defines no MODEL (an instance of fmus.definition.Model)")
    return model
