"""Owns the material point: (strain, history, dt, parameters) -> (stress, history), for every element and every law.

Elements split the strain into its deviator and the change of volume, which several points may share. A law of flow
takes the deviator alone; the pressure of a general law is a third of the trace of its stress.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.kinematics import kinematics
from warp_mca.kernels.materials.laws import law_functions

wp.set_module_options({"enable_backward": False})


@dataclass(frozen=True)
class MaterialPoint:
    """Functions of a material point in the history of element e, whose rows begin at `size` times its number.

    Attributes:
        size: rows of the history of a point; none where nothing is kept.
        general: whether the law gives the pressure too, which is 0 below otherwise.
        update: (strain, theta, G, g, e, m, flag, law, dt, history_out) -> (S, pressure, dp) of point g: the deviatoric
            stress conjugate to the deviatoric `strain`, the pressure conjugate to J = 1 + theta, both in Pa, and the
            growth of the equivalent plastic strain. The history is kept; `flag` says whether there is any yet.
        read: (strain, theta, G, g, e, m, flag, law, history) -> (S, pressure, p, stored, dissipated) of the history as
            it stands; energies [J/m^3], without that of the pressure where the law is not general.
    """

    size: int
    general: bool
    update: Any
    read: Any


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
def material_point(precision: str, law_name: str, finite: bool, points: int = 0) -> MaterialPoint:
    """The point of a law, elastic where that is "", with the strain measure of `kinematics`; `points` as above."""
    functions = law_functions(law_name, precision)
    if functions.general:
        return _general_point(precision, law_name, finite, points)
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    flow_at, plastic = flow_function(precision, law_name, points), bool(law_name)
    read_history, _ = history_functions(precision, law_name, points)
    plastic_strain, _ = plastic_strain_functions(precision, law_name)
    read_parameters, plastic_energy = functions.parameters, functions.plastic_energy

    @wp.func
    def update(
        strain: mat33,
        theta: R,
        G: R,
        g: int,
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        dt: R,
        history_out: wp.array2d(dtype=R),
    ):
        S = R(2.0) * G * strain
        dp = R(0.0)
        if wp.static(plastic):
            S, dp = flow_at(S, G, g, e, m, flag, law, history_out)
        return S, R(0.0), dp

    @wp.func
    def read(
        strain: mat33,
        theta: R,
        G: R,
        g: int,
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        history: wp.array2d(dtype=R),
    ):
        eps_p = mat33()
        p = R(0.0)
        dissipated = R(0.0)
        if wp.static(plastic):
            if flag != 0:
                eps_p, p = plastic_strain(read_history(history, g, e))
                dissipated = plastic_energy(eps_p, p, read_parameters(law, m, R(1.0)))
        stored = G * wp.ddot(strain - eps_p, strain - eps_p)
        return R(2.0) * G * (strain - eps_p), R(0.0), p, stored, dissipated

    return MaterialPoint(functions.size, False, update, read)


def _general_point(precision: str, law_name: str, finite: bool, points: int) -> MaterialPoint:
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    functions = law_functions(law_name, precision)
    read_parameters, law_stress, law_energies = functions.parameters, functions.stress, functions.energies
    row, vector = functions.plastic_row, wp.types.vector(max(1, functions.size), R)
    read_history, write_history = history_functions(precision, law_name, points)
    k = kinematics(precision, finite)
    volume_strain, conjugate_pressure = k.volume_strain, k.conjugate_pressure

    @wp.func
    def whole(strain: mat33, theta: R):
        mean = R(THIRD) * volume_strain(theta)
        found = strain
        for i in range(3):
            found[i, i] = found[i, i] + mean
        return found

    @wp.func
    def split(T: mat33, theta: R):
        mean = R(THIRD) * wp.trace(T)
        S = T
        for i in range(3):
            S[i, i] = S[i, i] - mean
        return S, conjugate_pressure(mean, theta)

    @wp.func
    def plastic_strain_of(h: vector):
        if wp.static(row >= 0):
            return h[wp.static(max(row, 0))]
        return R(0.0)

    @wp.func
    def update(
        strain: mat33,
        theta: R,
        G: R,
        g: int,
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        dt: R,
        history_out: wp.array2d(dtype=R),
    ):
        h = read_history(history_out, g, e)
        T, h_new = law_stress(whole(strain, theta), h, dt, read_parameters(law, m, R(1.0)))
        write_history(history_out, g, e, h_new)
        S, pressure = split(T, theta)
        return S, pressure, plastic_strain_of(h_new) - plastic_strain_of(h)

    @wp.func
    def read(
        strain: mat33,
        theta: R,
        G: R,
        g: int,
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        history: wp.array2d(dtype=R),
    ):
        h = read_history(history, g, e)
        c = read_parameters(law, m, R(1.0))
        T, _h = law_stress(whole(strain, theta), h, R(0.0), c)
        S, pressure = split(T, theta)
        stored, dissipated = law_energies(whole(strain, theta), h, c)
        return S, pressure, plastic_strain_of(h), stored, dissipated

    return MaterialPoint(functions.size, True, update, read)
