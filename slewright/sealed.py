"""The option that opens the sealed test draws for a purpose, which is logged."""

from typing import Annotated

import typer

from specs.errors import InputError


def purpose(text: str | None) -> str | None:
    """The purpose as given; InputError for one that says nothing."""
    if text is not None and not text.strip():
        raise InputError(
            "the test draws are sealed: say what they are opened for, such as 'tables of release 2', "
            "or leave the option away and take tuning or validation draws"
        )
    return text


SealedOption = Annotated[
    str | None,
    typer.Option(
        "--sealed", metavar="PURPOSE", callback=purpose, help="On the sealed test draws; it is logged."
    ),
]


def chosen_set(draw_set: str, sealed: str | None, machines: int) -> str:
    """The set that so many machines come from; InputError where it has not so many, before it is opened."""
    from specs import draws

    if draw_set == draws.SEALED:
        raise InputError("the test draws are sealed: --sealed PURPOSE opens them, and logs it")
    draws.check_set(draw_set, 0)
    which = draws.SEALED if sealed else draw_set
    draws.check_set(which, machines)
    return which
