"""Owns the wedge that bends right: mean gradient, assumed transverse shear, an internal vector of its thickness.

`wedge_strain` has its equations.
"""

from functools import cache, partial
from typing import Any

import warp as wp

from warp_mca.kernels.elements.failure import failure_kernel as failure_of
from warp_mca.kernels.elements.formulation import OWN, Formulation
from warp_mca.kernels.elements.readings import energy_kernel as energy_of
from warp_mca.kernels.elements.readings import stress_kernel as stress_of
from warp_mca.kernels.elements.viscosity import viscosity_function
from warp_mca.kernels.elements.wedge_shape import CORNERS, POINTS, SIXTH, pattern_functions, place_function
from warp_mca.kernels.elements.wedge_strain import force_function, shape_functions
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.isochoric import law_kinematics
from warp_mca.kernels.materials.kinematics import kinematics
from warp_mca.kernels.materials.laws import Law, law_functions
from warp_mca.kernels.materials.point import material_point
from warp_mca.kernels.records.extremes import LAG_LOSS, keep_functions

wp.set_module_options({"enable_backward": False})

__all__ = ["energy_kernel", "failure_kernel", "force_kernel", "kept", "lags", "stress_kernel"]


def kept(law: Law, finite: bool) -> tuple[str, ...]:
    """Covariant components of the inelastic part of the internal vector."""
    return ("scalar",) * 3 if lags(law, finite) else ()


def lags(law: Law, finite: bool) -> bool:
    """Whether the internal vector has an inelastic part."""
    return law.always or bool(law.history)


@cache
def formulation(precision: str, law_name: str, finite: bool) -> Formulation:
    """Its six points, of which each shows its stress at the nearest corner."""
    R = scalars(precision).real
    Wedge6, load_shape, enriched, strain_at = shape_functions(precision, law_name, finite)

    @wp.func
    def gradient(shape: Wedge6, g: int):
        Y = strain_at(shape, g)
        if wp.static(finite):
            Y = Y + Y * shape.H
        return R(SIXTH) * shape.volume, shape.H + Y

    @wp.func
    def rotation(shape: Wedge6):
        return shape.W

    @wp.func
    def corner_of(g: int, j: int):
        return g

    given = (OWN, Wedge6, load_shape, gradient, rotation, 1, corner_of)
    return Formulation(
        "wedge6", CORNERS, POINTS, *given, enriched=enriched, lags=lags(law_functions(law_name, precision), finite)
    )


@cache
def viscous_function(precision: str, law_name: str, finite: bool, viscous: int) -> Any:
    """The function (f, shape, e, dt, extreme_out) -> forces on the corners [N] with those of bulk viscosity, if any."""
    t, k = scalars(precision), kinematics(precision, finite)
    R, vec3, mat33, mat53, mat63 = t.real, t.vec3, t.mat33, wp.types.matrix((5, 3), t.real), t.mat63
    Wedge6, _, _, _ = shape_functions(precision, law_name, finite)
    _, to_corners = pattern_functions(precision)
    dilatation_of, nominal, viscous_pressure = (
        k.dilatation,
        k.nominal,
        viscosity_function(precision, finite, viscous or 1),
    )

    @wp.func
    def with_viscosity(f: mat63, shape: Wedge6, e: int, dt: R, extreme_out: wp.array2d(dtype=R)):
        if wp.static(viscous):
            q = viscous_pressure(e, dilatation_of(shape.H), shape.volume, dt, True, extreme_out)
            P = nominal(shape.H, mat33(), mat33(), vec3(), q)
            P = P + shape.W * P
            more = mat53()
            for p in range(5):
                more[p] = -P * shape.b[p]
            f = f + to_corners(more)
        return f

    return with_viscosity


@cache
def vector_function(precision: str, law_name: str, finite: bool) -> Any:
    """The function that changes the kept part of the internal vector by -`loose` / 2, see `force_function`.

    The sum of zeta^2 over the points is 2. The energy falls by half of the work of the tractions `left` in that, and
    the flow that they drove while the vector lagged took as much.
    """
    R, vec3 = scalars(precision).real, scalars(precision).vec3
    Wedge6, _, _, _ = shape_functions(precision, law_name, finite)
    law = law_functions(law_name, precision)
    always, first = law.always, POINTS * law.size

    @wp.func
    def keep_vector(
        shape: Wedge6,
        left: vec3,
        loose: vec3,
        e: int,
        flows: int,
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
    ):
        if wp.static(always) or flows != 0:
            change = R(0.5) * (shape.G * loose)
            for i in range(3):
                history_out[wp.static(first) + i, e] = history_out[wp.static(first) + i, e] - change[i]
            work = R(0.5) * R(SIXTH) * shape.volume * wp.dot(left, loose)
            extreme_out[LAG_LOSS, e] = extreme_out[LAG_LOSS, e] + work

    return keep_vector


@cache
def force_kernel(precision: str, law_name: str, finite: bool = False, viscous: int = 0) -> Any:
    """Kernel: forces of each element on its nodes, plastic history, and the inelastic part of the internal vector."""
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    _, load_shape, enriched, strain_at = shape_functions(precision, law_name, finite)
    gradient, place_of = formulation(precision, law_name, finite).gradient, place_function(precision)
    forces, keep_vector = force_function(precision, law_name, finite), vector_function(precision, law_name, finite)
    point, k = material_point(precision, law_name, finite), law_kinematics(precision, law_name, finite)
    plastic, general, update = bool(law_name), point.general, point.update
    keeps = lags(law_functions(law_name, precision), finite)
    dilatation_of, deviator, pressure_of, nominal = k.dilatation, k.deviator, k.pressure, k.nominal
    keep_strain, keep_volume, _ = keep_functions(R)
    with_viscosity = viscous_function(precision, law_name, finite, viscous)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def wedge6_force(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        count: int,
        dt: R,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
    ):
        e = wp.tid()
        m = material[e]
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
        shape = enriched(load_shape(X, u, conn, e), e, m, flag, law, history_out)
        flows = int(flag)
        identity = wp.identity(n=3, dtype=R)
        largest = R(0.0)
        smallest = wp.determinant(identity + shape.H_world)
        A = mat33()
        M = mat33()
        Mz = mat33()
        Mr = mat33()
        Ms = mat33()
        for g in range(wp.static(POINTS)):
            _weight, H = gradient(shape, g)
            strain, N, d = deviator(H)
            theta = dilatation_of(H)
            largest = wp.max(largest, wp.ddot(strain, strain))
            smallest = wp.min(smallest, wp.determinant(identity + H))
            S, pressure, dp = update(strain, theta, law[m, 1], g, e, m, flag, law, dt, history_out)
            if dp > R(0.0):
                flows = int(1)
            if wp.static(not general):
                pressure = pressure_of(law[m, 0], theta)
            P = nominal(H, S, N, d, pressure)
            zeta, r, s = place_of(g)
            M = M + P
            Mz = Mz + zeta * P
            Mr = Mr + r * P
            Ms = Ms + s * P
            if wp.static(finite):
                A = A + strain_at(shape, g) * P
        f, left, loose = forces(shape, law[m, 0], law[m, 1], A, M, Mz, Mr, Ms)
        f = with_viscosity(f, shape, e, dt, extreme_out)
        if wp.static(keeps):
            keep_vector(shape, left, loose, e, flows, history_out, extreme_out)
        if wp.static(plastic):
            if flows != flag:
                yielded_out[e] = flows
        keep_strain(e, largest, extreme_out)
        keep_volume(e, R(1.0) - smallest, extreme_out)
        for a in range(wp.static(CORNERS)):
            for i in range(3):  # by components, as in `hexahedron.store_function`
                force_out[slot + a * count + e][i] = f[a, i]

    return wedge6_force


energy_kernel, stress_kernel = partial(energy_of, formulation), partial(stress_of, formulation)
failure_kernel = partial(failure_of, formulation)
