"""Owns how the laws of flow act at a point of an element: its history is read, the law computed, the history kept."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import law_functions

wp.set_module_options({"enable_backward": False})


@cache
def history_functions(precision: str, law_name: str, points: int = 0) -> tuple[Any, Any]:
    """Functions that read and write the history of a point of a law as a vector of its rows.

    Points lie one after the other. A point that the block's history has no rows for reads as NaN, so that a guard stops
    the run, and is not written. With so many `points` for certain, loops that are unrolled need not ask for the rows,
    which costs `hex8` 15 % of a plastic step on a CPU.
    """
    R, size = scalars(precision).real, law_functions(law_name, precision).size
    vector = wp.types.vector(max(1, size), R)

    @wp.func
    def kept(history: wp.array2d(dtype=R), point: int):
        if wp.static(points > 0):
            return point >= 0 and point < wp.static(points)
        return point >= 0 and (point + 1) * wp.static(size) <= history.shape[0]

    @wp.func
    def read_history(history: wp.array2d(dtype=R), point: int, e: int):
        if wp.static(size > 0):
            if not kept(history, point):
                return vector(R(wp.nan))
        h = vector()
        for i in range(wp.static(size)):
            h[i] = history[point * wp.static(size) + i, e]
        return h

    @wp.func
    def write_history(history_out: wp.array2d(dtype=R), point: int, e: int, h: vector):
        if kept(history_out, point):
            for i in range(wp.static(size)):
                history_out[point * wp.static(size) + i, e] = h[i]

    return read_history, write_history


@cache
def plastic_strain_functions(precision: str, law_name: str) -> tuple[Any, Any]:
    """Functions of the history of a law of flow: history -> (eps_p, p), and back."""
    t = scalars(precision)
    R, mat33, vector = t.real, t.mat33, wp.types.vector(law_functions(law_name, precision).size or 6, t.real)

    @wp.func
    def plastic_strain(h: vector):
        return mat33(h[0], h[2], h[4], h[2], h[1], h[3], h[4], h[3], -h[0] - h[1]), h[5]

    @wp.func
    def history_of(eps_p: mat33, p: R):
        return vector(eps_p[0, 0], eps_p[1, 1], eps_p[0, 1], eps_p[1, 2], eps_p[0, 2], p)

    return plastic_strain, history_of


@cache
def flow_function(precision: str, law_name: str, points: int = 0, scale: float = 1.0) -> Any:
    """The function (elastic, G, g, e, m, flag, law, history_out) -> (S, dp) of a law of flow at point g of element e.

    `elastic` is the deviatoric stress without plastic strain; stresses and G are those of the material times `scale`.
    """
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    read_history, write_history = history_functions(precision, law_name, points)
    plastic_strain, history_of = plastic_strain_functions(precision, law_name)
    functions = law_functions(law_name, precision)
    read_parameters, return_map = functions.parameters, functions.return_map

    @wp.func
    def flow_at(
        elastic: mat33,
        G: R,
        g: int,
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        history_out: wp.array2d(dtype=R),
    ):
        eps_p = mat33()
        p = R(0.0)
        if flag != 0:
            eps_p, p = plastic_strain(read_history(history_out, g, e))
        S, eps_new, p_new = return_map(elastic, eps_p, p, G, read_parameters(law, m, R(scale)))
        if p_new > p:
            write_history(history_out, g, e, history_of(eps_new, p_new))
        return S, p_new - p

    return flow_at


@cache
def rated_function(precision: str, law_name: str, points: int) -> Any:
    """As `flow_function`, of a rated law, with the time step before history_out; its scale is 1."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    functions = law_functions(law_name, precision)
    vector = wp.types.vector(functions.size or 6, R)
    read_history, write_history = history_functions(precision, law_name, points)
    plastic_strain, _ = plastic_strain_functions(precision, law_name)
    read_parameters, law_flow = functions.parameters, functions.flow

    @wp.func
    def rated_at(
        elastic: mat33,
        G: R,
        g: int,
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        dt: R,
        history_out: wp.array2d(dtype=R),
    ):
        h = vector()
        if flag != 0:
            h = read_history(history_out, g, e)
        eps_p, _p = plastic_strain(h)
        S = elastic - R(2.0) * G * eps_p
        dp = R(0.0)
        first = law[m, 2]  # yield stress
        if dt > R(0.0) and (flag != 0 or R(1.5) * wp.ddot(S, S) > first * first):
            S, h, dp = law_flow(elastic, h, dt, G, read_parameters(law, m, R(1.0)))
            if dp > R(0.0):
                write_history(history_out, g, e, h)
        return S, dp

    return rated_at
