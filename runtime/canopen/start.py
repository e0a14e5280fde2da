"""What a start of the devices needs from files: the commissioning record's zeros, the makers' EDS files."""

import json
from collections.abc import Mapping
from pathlib import Path

from runtime.canopen import eds
from runtime.canopen.eds import Identity
from specs.canopen import definition
from specs.errors import InputError

RECORD = "commissioning.json"  # in a bundle (deployment/bundling/commissioned.py)


def zeros(bundle: Path) -> dict[str, float]:
    """What each sensor shows at its zero [SI], as the bundle's commissioning record says; empty without one.

    The bundle was checked before: its core has the same numbers.
    """
    path = bundle / RECORD
    if not path.is_file():
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))["zeros"]
        return {str(name): float(value) for name, value in found.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: no commissioning record ({error})") from None


def identities(files: Mapping[str, Path]) -> dict[str, Identity]:
    """Who each node is to be: as the EDS in `files` says, else as the specs do.

    Raises InputError for an unknown node, and for an EDS that is none or does not fit its node.
    """
    spec = definition()
    found = {n.name: Identity.of(n.device) for n in spec.nodes}
    for name, path in files.items():
        node = spec.node(name)
        od = eds.read(path, node.id)
        wrong = eds.mismatches(od, node)
        if wrong:
            more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
            raise InputError(f"{path}: does not fit {name}: {'; '.join(wrong[:3])}{more}")
        found[name] = eds.identity(od)
    return found
