"""Takes the distances to things from a trained policy that sees them, which stays as it is otherwise.

    python -m learning.policy.unseeing POLICY --out FILE

It then drives as it would where nothing is near: what the distances are worth is the difference in scenes.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from learning.policy.export import Policy, read, write
from learning.policy.features import features
from learning.policy.limit import Parser
from records.figures_file import check_target
from specs.ahead import Ahead
from specs.errors import InputError
from specs.policy import layout
from specs.version import VERSION


def without_things(policy: Policy) -> Policy:
    """The policy without the inputs of distances, which are 0 where nothing is near and come last."""
    c = policy.contract
    seen = Ahead(c.waypoints_s)
    (first, bias), *others = policy.weights
    kept = first[:, : features(c.task, c.history, seen).numel_out(0)]
    made = {**c.made, "after": f"distances taken away by learning.policy.unseeing, version {VERSION}"}
    told = replace(c, field_m=0.0, layout=layout(c.history, seen), made=made)
    return Policy(told, [(kept, bias), *others])


def unsee(policy: Path, out: Path) -> Path:
    """Write the policy without distances; InputError for one that sees none."""
    check_target(out)
    found = read(policy)
    if not found.contract.field_m:
        raise InputError(f"{policy} sees no distances (field_m is 0 in its contract)")
    return write(without_things(found), out)


def main(words: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = Parser(prog="python -m learning.policy.unseeing")
    parser.add_argument("policy", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    told = parser.parse_args(words)
    try:
        unsee(told.policy, told.out)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
