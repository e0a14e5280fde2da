"""Factors of I - gamma h J as straight-line code, with the pattern of J that is known when a model is built.

The rows are eliminated in an order that creates few new entries (Markowitz, Management Science 3 (1957) 255),
always with the diagonal as pivot: scaling the states does not change it.  ROS2 is of order two with any
matrix, so rounding here can cost stability, never order.  What is constant is not stored.
"""

import math

import casadi as ca

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)

Entries = dict[tuple[int, int], ca.SX]


def factorised(pattern: ca.Sparsity, step: float) -> tuple[ca.Function, ca.Function]:
    """(entries of J) -> factors; `slw_solve`: (factors, b) -> (I - gamma h J)^-1 b."""
    entries = ca.SX.sym("j", pattern.nnz())
    matrix = {(i, i): ca.SX(1) for i in range(pattern.size1())}
    for k, at in enumerate(zip(pattern.row(), pattern.get_col(), strict=True)):
        matrix[at] = matrix.get(at, ca.SX(0)) - GAMMA * step * entries[k]
    order = _order(set(matrix), pattern.size1())
    _eliminate(matrix, order)
    stored = [at for at in sorted(matrix) if not matrix[at].is_constant()]
    factorise = ca.Function("factorise", [entries], [ca.vertcat(*(matrix[at] for at in stored))])
    return factorise, _solve(matrix, stored, order)


def _order(pattern: set[tuple[int, int]], n: int) -> list[int]:
    """Rows in the order of their elimination: next is the one that touches the fewest entries."""
    left, order = set(range(n)), []
    pattern = set(pattern)
    while left:
        rows = {k: [i for i in left if i != k and (i, k) in pattern] for k in left}
        columns = {k: [j for j in left if j != k and (k, j) in pattern] for k in left}
        best = min(left, key=lambda k: (len(rows[k]) * len(columns[k]), k))
        pattern |= {(i, j) for i in rows[best] for j in columns[best]}
        left.remove(best)
        order.append(best)
    return order


def _eliminate(matrix: Entries, order: list[int]) -> None:
    """LU in place: L below the unit diagonal, U above, and on the diagonal the inverse of the pivot."""
    for place, k in enumerate(order):
        later = order[place + 1 :]
        matrix[k, k] = 1 / matrix[k, k]
        for i in (i for i in later if (i, k) in matrix):
            matrix[i, k] *= matrix[k, k]
            for j in (j for j in later if (k, j) in matrix):
                matrix[i, j] = matrix.get((i, j), ca.SX(0)) - matrix[i, k] * matrix[k, j]


def _solve(matrix: Entries, stored: list[tuple[int, int]], order: list[int]) -> ca.Function:
    given, b = ca.SX.sym("factors", len(stored)), ca.SX.sym("b", len(order))
    entry = dict(matrix) | {at: given[k] for k, at in enumerate(stored)}
    y = [b[i] for i in range(len(order))]
    for place, k in enumerate(order):
        for i in (i for i in order[place + 1 :] if (i, k) in entry):
            y[i] -= entry[i, k] * y[k]
    for place in reversed(range(len(order))):
        k = order[place]
        for j in (j for j in order[place + 1 :] if (k, j) in entry):
            y[k] -= entry[k, j] * y[j]
        y[k] *= entry[k, k]
    return ca.Function("slw_solve", [given, b], [ca.vertcat(*y)])
