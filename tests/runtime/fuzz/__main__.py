"""`python -m tests.runtime.fuzz [--minutes N] [--until-quiet MIN]`: fuzz all targets, keep the corpus."""

import argparse
import sys
import time

from tests.runtime.fuzz.native import compiled
from tests.runtime.fuzz.session import Session, keep

REPORT_S = 30.0


def main() -> int:
    """Fuzz until the time is over or nothing new came for long enough; exit 1 if anything was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.runtime.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="at most so long")
    parser.add_argument(
        "--until-quiet",
        type=float,
        metavar="MIN",
        help="stop when MIN minutes of processor time bring no edge",
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="write the corpus back")
    options = parser.parse_args()
    with compiled() as native:
        return _fuzz(Session(options.seed, native), options)


def _fuzz(session: Session, options: argparse.Namespace) -> int:
    session.begin()
    begun = reported = time.monotonic()
    quiet_s = 60.0 * (options.until_quiet or 1e9)
    while (now := time.monotonic()) - begun < 60.0 * options.minutes and session.quiet_s() < quiet_s:
        session.step()
        if now - reported > REPORT_S:
            reported = now
            print(f"{(now - begun) / 60.0:6.1f} min: {session.state()}", flush=True)
    session.sanitize()
    print(f"end: {session.state()}; {session.quiet_s() / 60.0:.1f} min of processor time without a new edge")
    if options.keep:
        keep(session)
    for problem in session.problems:
        print(problem)
    return 1 if session.problems else 0


if __name__ == "__main__":
    sys.exit(main())
