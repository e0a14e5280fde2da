"""How a system is stepped, as our annotation of a system description states it."""

from dataclasses import dataclass

ALGORITHMS = ("jacobi", "gauss-seidel", "iterate", "adaptive")


@dataclass(frozen=True)
class Settings:
    """How a system is stepped; a system description states it in our annotation.

    algorithm       one of ALGORITHMS
    tolerance       relative, of "iterate" (change between sweeps) and "adaptive" (local error of a step);
                    also that with which algebraic loops are solved at the start
    max_iterations  sweeps of "iterate" and of algebraic loops before a run fails
    max_halvings    how often "adaptive" may halve the system's step: the smallest is step_s / 2**max_halvings
    """

    algorithm: str = "jacobi"
    tolerance: float = 1e-6
    max_iterations: int = 50
    max_halvings: int = 16
