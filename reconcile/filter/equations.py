"""The equations of an extended model as the filter steps them: inputs, motion, dry friction, sensors.

Beside the model's inputs, `u` holds the time, the disturbances w, the length of a step and for every
output by how much its sample is earlier than the step (s).  The last disturbances are noise with a memory,
which pushes nothing: it is added to what outputs show.
"""

from collections.abc import Sequence
from functools import cached_property

import casadi as ca

from fmus.toolchain.codegen import CASADI_OPTIONS, with_our_mathematics
from reconcile.equations.assembly import Assembly
from reconcile.equations.extended import Extended

BENDS = 4000  # operations of a second derivative by time above which it is left out
ROOM = 4096  # numbers of scratch space
LIMITED = ("NX", "NU", "NW", "NY", "NI", "AXES")  # sizes of the arrays of filter.c


class Stepped(Assembly):
    """An extended model taken apart for the filter; arguments of all functions are (x, u, m, p)."""

    stops = True
    sensors_move = False  # whether memories of sensors move on now, or have done so already

    def __init__(
        self,
        extended: Extended,
        outputs: Sequence[str],
        pushed_states: Sequence[str] = (),
        correlated: Sequence[str] = (),
    ):
        super().__init__(extended)
        self.recorded = [self.model.index("outputs", n) for n in outputs]
        self.memories = [a for a in extended.attached if a.effect.place == "input" and a.effect.hidden]
        names = {a.name(h) for a in self.memories for h in a.effect.hidden}
        self.memory_names = [n for n in extended.state_names if n in names]
        self.state_names = [n for n in extended.state_names if n not in names]
        self.shown = [a for a in extended.attached if a.effect.place == "output" and a.effect.hidden]
        self.pushed_states = tuple(pushed_states)
        self.correlated = [list(outputs).index(n) for n in correlated]
        axes = extended.folder.ports.axes
        self.dt = ca.SX.sym("dt")
        self.early = ca.SX.sym("early", len(self.recorded))
        self.more = ca.SX.sym("push", len(self.pushed_states) + len(self.correlated))
        # one by one: a slice beyond a vector of one element is a row
        pushes = [self.u[i] for i in range(extended.clock + 1, self.u.numel())]
        self.w = ca.vertcat(*pushes, self.more)
        self.arguments = [
            ca.vertcat(*[self.x[extended.state_names.index(n)] for n in self.state_names]),
            ca.vertcat(self.u, self.more, self.dt, self.early),
            self.m,
            self.p,
        ]
        self.memory = ca.vertcat(
            *[self.x[extended.state_names.index(n)] for n in self.memory_names], ca.SX(0, 1)
        )
        self.w0, self.axes = extended.clock + 1, axes
        self.dt_at = self.u.numel() + self.more.numel()

    @cached_property
    def stages(self) -> dict[str, ca.Function]:
        """All functions of filter.c but the derivatives."""
        # memories of inputs step exactly; a continuous model feels their mean over the step
        step, self.step, self.averaged = self.step, self.dt, self.model.kind == "continuous"
        felt = super()._inputs()
        self.averaged = False
        moved = [self.next[n] for n in self.memory_names]
        first = [self.starts[n] for n in self.memory_names]
        self.step = step
        self.built.clear()
        self.next.clear()
        for made in (self.rates, self.starts):
            made |= dict.fromkeys(self.memory_names, ca.SX(0))  # they are no part of the motion
        f, dry, h = self._motion_parts()
        after, after_by_x = self._after(f)
        self.step = step
        _, u, m, p = self.arguments
        rest = ca.vertcat(*[u[i] for i in range(len(self.model.inputs), u.numel())])
        hidden = self.state_names[self.nx :]  # they come last
        rest_starts = [self.starts[n] for n in hidden]
        made = {
            "kf_in": ([self.memory, u, m, p], [ca.vertcat(felt, rest), ca.vertcat(*moved, ca.SX(0, 1))]),
            "kf_f": (self.arguments, [f]),
            "kf_dry": (self.arguments, [dry]),
            "kf_post": (self.arguments, [after, after_by_x]),
            "kf_h": (self.arguments, [h]),
            "kf_first": (
                [self.memory, *self.arguments],
                [ca.vertcat(*first, ca.SX(0, 1)), ca.vertcat(*rest_starts, ca.SX(0, 1))],
            ),
        }
        return {
            n: ca.Function(n, i, [ca.densify(ca.SX(r)) for r in o], {"cse": True})
            for n, (i, o) in made.items()
        }

    def _inputs(self) -> ca.SX:
        return self._recorded_inputs()  # felt already

    def _outputs(self, outputs: ca.SX) -> ca.SX:
        """What sensors show: their memories move after each step, and not once more where they are read."""
        step, self.step = self.step, self.step if self.sensors_move else None
        shown = super()._outputs(outputs)
        self.step = step
        return shown

    def _motion_parts(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        f, h, _ = Assembly.functions(self)
        whole = [self.x, self.u, self.m, self.p]
        rates, outputs = f(*whole), h(*whole)[self.recorded]
        kept = [self.e.state_names.index(n) for n in self.state_names]
        rates = ca.vertcat(*[rates[i] for i in kept])
        still = {a.name(s) for a in self.shown for s in a.effect.hidden}
        for i, n in enumerate(self.state_names):
            if n in still:
                rates[i] = 0.0 if self.model.kind == "continuous" else self.x[kept[i]]
        per = self.model.step if self.model.kind == "discrete" else 1.0
        for k, n in enumerate(self.pushed_states):
            rates[self.state_names.index(n)] += per * self.more[k]
        for k, i in enumerate(self.correlated):
            outputs[i] += self.more[len(self.pushed_states) + k]
        inputs = self._inputs()
        dry = ca.SX.zeros(2 * len(self.axes))
        for k, axis in enumerate(self.axes) if self.model.kind == "continuous" else ():
            added, _ = self._added(axis, inputs)
            for a in self._at("force", axis.name):
                levels = self._force(a, axis, inputs).dry
                for side, level in enumerate(levels or ()):
                    dry[side * len(self.axes) + k] += level / (self.inertia(axis) + added)
        return rates, dry, outputs

    def _slope(self, expression: ca.SX, rates: ca.SX) -> ca.SX:
        """An expression of the states by time; of a model in steps by its next two."""
        x = self.arguments[0]
        if self.model.kind == "continuous":
            return ca.jtimes(expression, x, rates)
        next_one = ca.substitute(expression, x, rates)
        after = ca.substitute(next_one, x, rates)
        return (4.0 * next_one - 3.0 * expression - after) / (2.0 * self.model.step)

    def _after(self, rates: ca.SX) -> tuple[ca.SX, ca.SX]:
        """States after a step, d/dx: the memories of sensors follow what they show.

        How fast that moves on is a small correction: d/dx leaves it as it is.
        """
        x = self.arguments[0]
        after = ca.SX(x)
        if not self.shown:
            return after, ca.SX.eye(x.numel())
        moves: list[tuple[ca.SX, ca.SX]] = []

        def slope(target: ca.SX) -> tuple[ca.SX, ca.SX]:
            first = self._slope(target, rates)
            second = self._slope(first, rates)
            if (
                ca.Function("bend", [*self.arguments], [second], {"allow_free": True}).n_instructions()
                > BENDS
            ):
                second = ca.SX(0)
            moves.extend([(ca.SX.sym("slope"), first), (ca.SX.sym("bend"), second)])
            return moves[-2][0], moves[-1][0]

        self.built.clear()
        # what goes in steps holds its values between them, for its sensors too
        self.step, self.slope = self.dt, slope if self.model.kind == "continuous" else None
        self.sensors_move = True
        self._outputs(ca.SX(self.model.h(self.x[: self.nx], self._inputs(), self.m, self.used_p)))
        self.slope, self.sensors_move = None, False
        for a in self.shown:
            for h in a.effect.hidden:
                after[self.state_names.index(a.name(h))] = self.next[a.name(h)]
        begun = list(self.starts)
        made = [after, ca.jacobian(after, x), *(ca.SX(self.starts[n]) for n in begun)]
        for symbol, expression in reversed(moves):  # a later one may be of what an earlier one is in
            made = ca.substitute(made, [symbol], [expression])
        self.starts |= dict(zip(begun, made[2:], strict=True))
        return made[0], made[1]

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """All functions of filter.c."""
        x, s = self.arguments[0], self.stages
        f, h = s["kf_f"](*self.arguments), s["kf_h"](*self.arguments)

        def sloped(name: str, e: ca.SX) -> ca.Function:
            slopes = [ca.densify(ca.jacobian(e, z)) for z in (x, self.w)]
            return ca.Function(name, self.arguments, [e, *slopes], {"cse": True})

        kept = {n: s[n] for n in ("kf_in", "kf_f", "kf_dry", "kf_post", "kf_first")}
        return kept | {"kf_fj": sloped("kf_fj", f), "kf_hj": sloped("kf_hj", h)}

    @cached_property
    def axis_places(self) -> list[tuple[int, int]]:
        """Of every axis the places of its speed and its position among the states; -1 without one."""
        index = self.state_names.index
        return [(index(a.velocity), index(a.position) if a.position else -1) for a in self.axes]

    @cached_property
    def sizes(self) -> dict[str, int | float]:
        """What filter.c needs to know of the model, by its names there."""
        x, u, m, _ = self.arguments
        return {
            "NX": x.numel(),
            "NU": u.numel(),
            "NM": m.numel(),
            "NW": self.w.numel(),
            "NY": len(self.recorded),
            "NI": len(self.memory_names),
            "NH": len(self.state_names) - len(self.model.states),
            "AXES": len(self.axes) if self.model.kind == "continuous" else 0,
            "POSTS": int(bool(self.shown)),
            "W0": self.w0,
            "DT": self.dt_at,
            "EARLY": self.dt_at + 1,
            "STEP": float(self.model.step) if self.model.kind == "discrete" else 1.0,
            "DISCRETE": int(self.model.kind == "discrete"),
        }

    def code(self) -> tuple[str, str]:
        """Generated C code and header for filter.c."""
        generator = ca.CodeGenerator("equations.c", CASADI_OPTIONS)
        for function in self.functions.values():
            generator.add(function)
        # in steps, so that sets of effects share the driver
        room = {
            "SZ_W": ROOM * (1 + max(g.sz_w() for g in self.functions.values()) // ROOM),
            "SZ_IW": ROOM * (1 + max(g.sz_iw() for g in self.functions.values()) // ROOM),
        }
        most = {f"MOST_{n}": n for n in LIMITED}
        header = "".join(f"#define {n} {v}\n" for n, v in (self.sizes | room | most).items())
        for column, name in enumerate(("axis_v", "axis_q")):
            listed = ", ".join(str(a[column]) for a in self.axis_places) or "-1"
            header += f"static const int {name}[] = {{{listed}}};\n"
        return with_our_mathematics(generator.dump()), header
