"""What an equation computes from parameters alone is taken out of it, to be computed once for many steps.

Dividing by such a value becomes multiplying by its inverse, as a division takes several times as long.
"""

from collections.abc import Sequence

import casadi as ca


def split(function: ca.Function, prepare: str, rest: str) -> tuple[ca.Function, ca.Function]:
    """A function of SX (x, u, m, p) in two: `prepare`, p -> q, and `rest`, (x, u, m, q) -> the same."""
    return _Split(function).functions(prepare, rest)


class _Split:
    """One walk along the function's instructions; `values` are expressions of x, u, m and q."""

    def __init__(self, function: ca.Function) -> None:
        self.function = function
        self.given = [ca.SX.sym(function.name_in(i), function.size1_in(i)) for i in range(function.n_in())]
        self.values: dict[int, ca.SX] = {}
        self.of_p: dict[int, ca.SX] = {}  # slot -> expression of p alone
        self.q: dict[int, tuple[ca.SX, ca.SX]] = {}  # hash -> expression of p, its symbol
        self.results = [ca.SX(*function.size_out(i)) for i in range(function.n_out())]
        for k in range(function.n_instructions()):
            self._instruction(k)

    def functions(self, prepare: str, rest: str) -> tuple[ca.Function, ca.Function]:
        """Both functions, under their names."""
        expressions = ca.vertcat(ca.SX(0, 1), *(e for e, _ in self.q.values()))
        symbols = ca.vertcat(ca.SX(0, 1), *(s for _, s in self.q.values()))
        return (
            ca.Function(prepare, [self.given[-1]], [expressions]),
            ca.Function(rest, [*self.given[:-1], symbols], self.results),
        )

    def _instruction(self, k: int) -> None:
        f = self.function
        code, ins, outs = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if code == ca.OP_OUTPUT:
            self.results[outs[0]][outs[1]] = self._value(ins[0])
        elif code == ca.OP_CONST:
            self._keep(outs[0], ca.SX(f.instruction_constant(k)), True)
        elif code == ca.OP_INPUT:
            self._keep(outs[0], self.given[ins[0]][ins[1]], ins[0] == len(self.given) - 1)
        elif all(i in self.of_p for i in ins):
            self._keep(outs[0], _apply(code, [self.of_p[i] for i in ins]), True)
        elif code == ca.OP_DIV and ins[1] in self.of_p:
            self._keep(outs[0], self._value(ins[0]) * self._constant(1 / self.of_p[ins[1]]), False)
        else:
            self._keep(outs[0], _apply(code, [self._value(i) for i in ins]), False)

    def _keep(self, slot: int, value: ca.SX, of_p: bool) -> None:
        """Slots are used again: what one held before is forgotten."""
        self.values.pop(slot, None)
        self.of_p.pop(slot, None)
        (self.of_p if of_p else self.values)[slot] = value

    def _value(self, slot: int) -> ca.SX:
        return self._constant(self.of_p[slot]) if slot in self.of_p else self.values[slot]

    def _constant(self, value: ca.SX) -> ca.SX:
        """The symbol of an expression of p; a number stands for itself."""
        if value.is_constant():
            return value
        symbol = ca.SX.sym(f"c{len(self.q)}")
        return self.q.setdefault(value.element_hash(), (value, symbol))[1]


def _apply(code: int, operands: Sequence[ca.SX]) -> ca.SX:
    return ca.SX.unary(code, *operands) if len(operands) == 1 else ca.SX.binary(code, *operands)
