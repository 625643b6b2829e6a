"""Owns the material point: (strain, history, dt, parameters) -> (stress, history), for every element and every law.

Elements split the strain into its deviator and the change of volume, which several points may share. A law of flow,
rated or not, takes the deviator alone; the pressure of a general law is a third of the trace of its stress.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from warp_mca.base.errors import bad_value
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.flow import flow_function, history_functions, plastic_strain_functions, rated_function
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
            stress conjugate to the deviatoric `strain` (Mandel's of hyperelastic laws, see `isochoric`), the pressure
            conjugate to J = 1 + theta, both in Pa, and the growth of the equivalent plastic strain. The history is
            kept; `flag` says whether there is any yet.
        read: (strain, theta, G, g, e, m, flag, law, history) -> (S, pressure, p, stored, dissipated) of the history as
            it stands; energies [J/m^3], without that of the pressure where the law is not general.
    """

    size: int
    general: bool
    update: Any
    read: Any


@cache
def whole_functions(precision: str, finite: bool) -> tuple[Any, Any]:
    """Functions (deviatoric strain, J - 1) -> whole strain; (its stress, J - 1) -> (deviator, pressure as above)."""
    R, mat33 = scalars(precision).real, scalars(precision).mat33
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

    return whole, split


@cache
def material_point(precision: str, law_name: str, finite: bool, points: int = 0) -> MaterialPoint:
    """The point of a law, elastic where that is "", with the strain of `law_kinematics`; `points` as above.

    Raises:
        RequestError: a hyperelastic law is to take small strain.
    """
    functions = law_functions(law_name, precision)
    t = scalars(precision)
    R, mat33, vector = t.real, t.mat33, wp.types.vector(max(1, functions.size), t.real)
    if functions.hyperelastic and not finite:
        raise bad_value("Body.kinematics", "corotational", "a hyperelastic law needs kinematics='finite'")
    general, viscous, hyperelastic, rated = (
        functions.general,
        functions.viscous,
        functions.hyperelastic,
        functions.rated,
    )
    plastic, row = bool(law_name), functions.plastic_row
    flow_at, rated_at = (make(precision, law_name, points) for make in (flow_function, rated_function))
    read_history, write_history = history_functions(precision, law_name, points)
    plastic_strain, _ = plastic_strain_functions(precision, law_name)
    whole, split = whole_functions(precision, finite)
    read_parameters, law_energies = functions.parameters, functions.energies
    law_stress, deviatoric, mandel = functions.stress, functions.deviatoric, functions.mandel
    stored_energy, plastic_energy, plastic_work = functions.stored, functions.plastic_energy, functions.plastic_work

    @wp.func
    def kept_plastic_strain(h: vector):
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
        pressure = R(0.0)
        dp = R(0.0)
        if wp.static(general):
            h = read_history(history_out, g, e)
            T, h_new = law_stress(whole(strain, theta), h, dt, read_parameters(law, m, R(1.0)))
            write_history(history_out, g, e, h_new)
            S, pressure = split(T, theta)
            dp = kept_plastic_strain(h_new) - kept_plastic_strain(h)
        elif wp.static(viscous):
            S, h = deviatoric(strain, read_history(history_out, g, e), dt, read_parameters(law, m, R(1.0)))
            write_history(history_out, g, e, h)
        elif wp.static(hyperelastic):
            S = mandel(strain, read_parameters(law, m, R(1.0)))
        elif wp.static(rated):
            S, dp = rated_at(R(2.0) * G * strain, G, g, e, m, flag, law, dt, history_out)
        elif wp.static(plastic):
            S, dp = flow_at(R(2.0) * G * strain, G, g, e, m, flag, law, history_out)
        else:
            S = R(2.0) * G * strain
        return S, pressure, dp

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
        pressure = R(0.0)
        p = R(0.0)
        dissipated = R(0.0)
        if wp.static(general):
            h = read_history(history, g, e)
            c = read_parameters(law, m, R(1.0))
            T, _h = law_stress(whole(strain, theta), h, R(0.0), c)
            S, pressure = split(T, theta)
            p = kept_plastic_strain(h)
            stored, dissipated = law_energies(whole(strain, theta), h, c)
        elif wp.static(viscous):
            h = read_history(history, g, e)
            c = read_parameters(law, m, R(1.0))
            S, _h = deviatoric(strain, h, R(0.0), c)
            stored, dissipated = law_energies(strain, h, c)
        elif wp.static(hyperelastic):
            c = read_parameters(law, m, R(1.0))
            S = mandel(strain, c)
            stored = stored_energy(strain, c)
        else:
            eps_p = mat33()
            if wp.static(plastic):
                if flag != 0:
                    h = read_history(history, g, e)
                    eps_p, p = plastic_strain(h)
                    if wp.static(rated):
                        dissipated = plastic_work(h, read_parameters(law, m, R(1.0)))
                    else:
                        dissipated = plastic_energy(eps_p, p, read_parameters(law, m, R(1.0)))
            stored = G * wp.ddot(strain - eps_p, strain - eps_p)
            S = R(2.0) * G * (strain - eps_p)
        return S, pressure, p, stored, dissipated

    return MaterialPoint(functions.size, general, update, read)
