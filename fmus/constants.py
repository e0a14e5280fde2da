"""What equations compute from parameters alone is taken out of them, to be computed once for many steps.

A division becomes a multiplication by the inverse, formed once for each divisor: derivatives divide by the
same values again and again, and a division takes several times as long.
"""

import casadi as ca


def split(function: ca.Function) -> tuple[ca.Function, list[ca.SX], list[ca.SX]]:
    """A function of SX (x, u, m, p) in two: `slw_constants`, p -> q; and (x, u, m, q) with its results."""
    simplifying = ca.GlobalOptions.getSimplificationOnTheFly()
    ca.GlobalOptions.setSimplificationOnTheFly(False)  # which would make a / b of a * (1 / b) again
    try:
        walk = _Split(function)
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(simplifying)
    expressions, symbols = ([ca.SX(0, 1), *part] for part in (walk.expressions, walk.symbols))
    constants = ca.Function("slw_constants", [walk.given[-1]], [ca.vertcat(*expressions)])
    return constants, [*walk.given[:-1], ca.vertcat(*symbols)], walk.results


class _Split:
    """One walk along the function's instructions; `values` are expressions of x, u, m and q."""

    def __init__(self, function: ca.Function) -> None:
        self.function = function
        self.given = [ca.SX.sym(function.name_in(i), function.size1_in(i)) for i in range(function.n_in())]
        self.values: dict[int, ca.SX] = {}
        self.of_p: dict[int, ca.SX] = {}  # slot -> expression of p alone
        self.q: dict[int, tuple[ca.SX, ca.SX]] = {}  # hash -> expression of p, its symbol
        self.made: dict[tuple[int, ...], tuple[tuple[ca.SX, ...], ca.SX]] = {}
        self.results = [ca.SX(*function.size_out(i)) for i in range(function.n_out())]
        for k in range(function.n_instructions()):
            self._instruction(k)

    @property
    def expressions(self) -> list[ca.SX]:
        """Expressions of p ..."""
        return [expression for expression, _ in self.q.values()]

    @property
    def symbols(self) -> list[ca.SX]:
        """... and the symbols that stand for them."""
        return [symbol for _, symbol in self.q.values()]

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
            self._keep(outs[0], self._made(code, *(self.of_p[i] for i in ins)), True)
        elif code == ca.OP_DIV:
            self._keep(outs[0], self._quotient(*ins), False)
        else:
            self._keep(outs[0], self._made(code, *map(self._value, ins)), False)

    def _keep(self, slot: int, value: ca.SX, of_p: bool) -> None:
        """Slots are used again: what one held before is forgotten."""
        self.values.pop(slot, None)
        self.of_p.pop(slot, None)
        (self.of_p if of_p else self.values)[slot] = value

    def _made(self, code: int, *operands: ca.SX) -> ca.SX:
        """An operation's result, the earlier one where the operands are the same."""
        key = (code, *(o.element_hash() for o in operands))
        if key not in self.made:
            kind = ca.SX.unary if len(operands) == 1 else ca.SX.binary
            self.made[key] = (operands, kind(code, *operands))  # kept with the operands: a hash is an address
        return self.made[key][1]

    def _value(self, slot: int) -> ca.SX:
        return self._constant(self.of_p[slot]) if slot in self.of_p else self.values[slot]

    def _quotient(self, dividend: int, divisor: int) -> ca.SX:
        """Dividend times inverse; at a tie, the derivative of a maximum or minimum is one side's."""
        value, sum_ = self._value(dividend), self._value(divisor)
        if sum_.op() == ca.OP_ADD and all(sum_.dep(i).op() == ca.OP_LE for i in range(2)):
            first = sum_.dep(0)
            same = value.element_hash() == first.element_hash()
            return first if same else self._made(ca.OP_SUB, ca.SX(1), first)
        return self._made(ca.OP_MUL, value, self._inverse(divisor))

    def _inverse(self, slot: int) -> ca.SX:
        """One over the value of a slot."""
        if slot in self.of_p:
            return self._constant(self._made(ca.OP_INV, self.of_p[slot]))
        value = self.values[slot]
        return self._made(ca.OP_INV, value)

    def _constant(self, value: ca.SX) -> ca.SX:
        """The symbol of an expression of p; a number stands for itself."""
        if value.is_constant():
            return value
        symbol = ca.SX.sym(f"q{len(self.q)}")
        return self.q.setdefault(value.element_hash(), (value, symbol))[1]
