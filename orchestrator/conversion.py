"""What happens to a value on a connection: units and LinearTransformation, or a table of whole numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from orchestrator.units import IDENTITY, Affine


@dataclass(frozen=True)
class Conversion:
    """y = affine(x) for reals; y = table[x] for Booleans (0, 1), integers and enumerations.

    An empty table and the identity leave the value as it is.  A value that a table does not hold is an error
    of the run for enumerations and Booleans, and passes unchanged for integers (SSP 1.0, 5.4.6).
    """

    affine: Affine = IDENTITY
    table: Mapping[int, int] = field(default_factory=dict)

    @property
    def is_identity(self) -> bool:
        """Whether the value passes unchanged."""
        return self.affine == IDENTITY and not self.table


UNCHANGED = Conversion()
