"""`--json FILE` of every command that measures something."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import check_target

JsonOption = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="FILE", callback=check_target, help="Write the figures, seed and versions here."
    ),
]
