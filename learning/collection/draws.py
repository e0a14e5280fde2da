"""Random numbers of a recording, from keys: the same on every platform and in every version."""

from statistics import NormalDist

from specs import keys


class Draws:
    """A stream of random numbers that belongs to a key."""

    def __init__(self, *key: object) -> None:
        self.key, self.count = key, 0

    def uniform(self) -> float:
        """The next number in [0, 1)."""
        self.count += 1
        return keys.uniform(*self.key, self.count)

    def between(self, low: float, high: float) -> float:
        """The next number between `low` and `high`."""
        return low + (high - low) * self.uniform()

    def sign(self) -> float:
        """-1 or 1."""
        return 1.0 if self.uniform() < 0.5 else -1.0

    def normal(self) -> float:
        """The next number of a standard normal distribution, cut off at about 5 standard deviations."""
        return NormalDist().inv_cdf(min(max(self.uniform(), 2.5e-7), 1.0 - 2.5e-7))

    def seed(self) -> int:
        """A seed for a noise source: 1 … 2^31 - 1."""
        return 1 + int(self.uniform() * (2**31 - 2))
