"""What a caller states about a text file, so that nothing has to be decided from the file itself."""

import codecs
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

from specs.errors import InputError

DECIMALS = (".", ",")
THOUSANDS = (".", ",", "'", " ", "_", "\u2019", "\u00a0", "\u202f", "\u2009", "none")


@dataclass(frozen=True)
class TextOptions:
    """Marks, encoding, lines to skip, clock and words for missing values; None or empty: decided
    from the file.
    """

    decimal: str | None = None
    thousands: str | None = None
    encoding: str | None = None
    skip: int = 0
    clock: str | None = None
    missing: Sequence[str] = ()

    def __post_init__(self) -> None:
        if self.decimal is not None and self.decimal not in DECIMALS:
            raise InputError(f"--decimal '{self.decimal}': valid are . and ,")
        if self.thousands is not None and self.thousands not in THOUSANDS:
            raise InputError(f"--thousands '{self.thousands}': valid are . , ' _ a blank, and none")
        if self.decimal is not None and self.decimal == self.thousands:
            raise InputError(f"--decimal and --thousands are both '{self.decimal}'")
        if self.skip < 0:
            raise InputError(f"--skip {self.skip}: a number of lines, 0 or more")
        if self.encoding is not None:
            try:
                codecs.lookup(self.encoding)
            except LookupError:
                raise InputError(
                    f"--encoding '{self.encoding}' is not known; valid: utf-8, cp1252, utf-16 …"
                ) from None

    @property
    def stated(self) -> list[str]:
        """The options that are stated, as they are written on the command line."""
        return [f"--{name}" for name, value in vars(self).items() if value not in (None, 0, (), [])]

    def without(self, options: Sequence[str]) -> Self:
        """The same but for `options`, named as on the command line: about them nothing is stated."""
        plain = {f.name: f.default for f in fields(self) if f"--{f.name}" in options}
        return replace(self, **plain)  # type: ignore[arg-type]
