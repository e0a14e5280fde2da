"""A slew network as a CasADi function: the same numbers as SlewNetwork.predict, from weights as tables."""

import casadi as ca
import numpy as np

from fmus.models.slew_nn.network import HISTORY, Mlp, SlewNetwork


def predict(network: SlewNetwork) -> ca.Function:
    """(u [10], p_l [10], p_r [10], omega [10], inertia) -> (p_l, p_r, omega) one period later, SI units.

    A symmetric network is evaluated on both images at once, as two columns, so that each weight is read once.
    """
    u, p_l, p_r, omega = (ca.MX.sym(n, HISTORY) for n in ("u", "p_l", "p_r", "omega"))
    inertia = ca.MX.sym("inertia")
    columns = [(u, p_l, p_r, omega)]
    if network.symmetric:
        columns.append((-u, p_r, p_l, -omega))
    us, lefts, rights, omegas = (ca.horzcat(*rows) for rows in zip(*columns, strict=True))
    inertias = ca.repmat(inertia, 1, len(columns))

    known = ca.vertcat(us, lefts, rights, omegas, inertias)
    p = _mean(network.pressure, known, ca.vertcat(lefts[-1, :], rights[-1, :]))
    left, right = ca.vertcat(lefts[1:, :], p[0, :]), ca.vertcat(rights[1:, :], p[1, :])
    w = _mean(network.velocity, ca.vertcat(us, left, right, omegas, inertias), omegas[-1, :])
    results = [p[0, 0], p[1, 0], w[0, 0]]
    if network.symmetric:
        results = [(p[0, 0] + p[1, 1]) / 2, (p[1, 0] + p[0, 1]) / 2, (w[0, 0] - w[0, 1]) / 2]
    return ca.Function("slew_network", [u, p_l, p_r, omega, inertia], results)


def _mean(members: tuple[Mlp, ...], x: ca.MX, last: ca.MX) -> ca.MX:
    """Mean of the members' outputs [outputs, columns] for raw inputs x [inputs, columns]."""
    total = sum(_outputs(net, x) + float(net.residual) * last for net in members)
    return total / len(members)  # pyright: ignore[reportReturnType]


def _outputs(net: Mlp, x: ca.MX) -> ca.MX:
    columns = x.shape[1]
    y = (x - _table(net.mean_in, columns)) / _table(net.std_in, columns)
    for number, (w, b) in enumerate(zip(net.weights, net.biases, strict=True)):
        y = ca.mtimes(ca.MX(ca.DM(w.astype(np.float64))), y) + _table(b, columns)
        if number + 1 < len(net.weights):
            y = ca.fmax(y, 0.0)
    return _table(net.mean_out, columns) + _table(net.std_out, columns) * y


def _table(values: np.ndarray, columns: int) -> ca.MX:
    column = np.asarray(values, np.float64).reshape(-1, 1)
    return ca.MX(ca.DM(np.tile(column, (1, columns))))
