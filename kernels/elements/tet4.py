"""Owns the 4-node tetrahedron with averaged nodal pressure.

The volume change is averaged over the elements of one material around each node, so that neither nearly incompressible
elasticity nor plastic flow locks: Bonet and Burton, Commun. Numer. Meth. Engng 14 (1998) 437. Three kernels run in
turn: volume changes of elements, their means at nodes, forces.
"""

from functools import cache, partial
from typing import Any

import warp as wp

from warp_mca.kernels.elements.failure import failure_kernel as failure_of
from warp_mca.kernels.elements.formulation import NODAL, Formulation
from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.elements.patterns import mean_frame
from warp_mca.kernels.elements.readings import energy_kernel as energy_of
from warp_mca.kernels.elements.readings import stress_kernel as stress_of
from warp_mca.kernels.elements.viscosity import viscosity_function
from warp_mca.kernels.hardware.early_launch import begins_early, wait_for_previous
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.isochoric import law_kinematics
from warp_mca.kernels.materials.kinematics import kinematics
from warp_mca.kernels.materials.point import material_point
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def gradient_function(precision: str, finite: bool) -> Any:
    """The function (X, conn, u, e) -> (W, H, cofactors of the edges as rows, volume, J): rotation W = Q - I."""
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    rotated = mean_frame(precision, finite)

    @wp.func
    def edge(field: wp.array(dtype=wp.vec3d), i: int, j: int):
        d = field[j] - field[i]
        return vec3(R(d[0]), R(d[1]), R(d[2]))

    @wp.func
    def tet_gradient(
        X: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), u: wp.array(dtype=wp.vec3d), e: int
    ):
        n = conn[0, e]
        d0 = edge(X, n, conn[1, e])
        d1 = edge(X, n, conn[2, e])
        d2 = edge(X, n, conn[3, e])
        l0 = edge(u, n, conn[1, e])
        l1 = edge(u, n, conn[2, e])
        l2 = edge(u, n, conn[3, e])
        c0 = wp.cross(d1, d2)
        c1 = wp.cross(d2, d0)
        c2 = wp.cross(d0, d1)
        det = wp.dot(d0, c0)
        inverse = R(1.0) / det
        H = inverse * (wp.outer(l0, c0) + wp.outer(l1, c1) + wp.outer(l2, c2))
        J = wp.determinant(wp.identity(n=3, dtype=R) + H)
        W, H = rotated(H)
        rows = mat33(c0[0], c0[1], c0[2], c1[0], c1[1], c1[2], c2[0], c2[1], c2[2])
        return W, H, rows, det / R(6.0), J

    return tet_gradient


@cache
def dilatation_kernel(precision: str, finite: bool) -> Any:
    """Kernel: change of volume of each element [m^3]."""
    R = scalars(precision).real
    tet_gradient = gradient_function(precision, finite)
    dilatation_of = kinematics(precision, finite).dilatation

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def tet4_dilatation(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        u: wp.array(dtype=wp.vec3d),
        growth_out: wp.array(dtype=R),
    ):
        wait_for_previous()
        e = wp.tid()
        _W, H, _c, volume, _J = tet_gradient(X, conn, u, e)
        growth_out[e] = volume * dilatation_of(H)

    return begins_early(tet4_dilatation)


@cache
def average_kernel(precision: str) -> Any:
    """Kernel: mean dilatation J - 1 [-] of the elements around each pressure node."""
    R = scalars(precision).real

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def tet4_average(
        offset: wp.array(dtype=wp.int32),
        element: wp.array(dtype=wp.int32),
        inverse_volume: wp.array(dtype=R),
        growth: wp.array(dtype=R),
        dilatation_out: wp.array(dtype=R),
    ):
        wait_for_previous()
        i = wp.tid()
        total = R(0.0)
        for j in range(offset[i], offset[i + 1]):
            total += growth[element[j]]
        dilatation_out[i] = inverse_volume[i] * total

    return begins_early(tet4_average)


@cache
def force_kernel(precision: str, law_name: str, finite: bool = False, viscous: int = 0) -> Any:
    """Kernel: forces of each element on its nodes, and the plastic history where there is a law."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    tet_gradient = gradient_function(precision, finite)
    plastic, update = bool(law_name), material_point(precision, law_name, finite, points=1).update
    add_matrices = fused(precision).add_matrices
    keep_strain, keep_volume, _ = keep_functions(R)
    k = law_kinematics(precision, law_name, finite)
    dilatation_of, deviator, nominal, pressure_of = k.dilatation, k.deviator, k.nominal, k.pressure
    viscous_pressure = viscosity_function(precision, finite, viscous)

    # fast math would lose the digits of ln(1 + x) of small x
    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": not finite})
    def tet4_force(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        count: int,
        group: wp.array2d(dtype=wp.int32),
        dilatation: wp.array(dtype=R),
        dt: R,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
    ):
        wait_for_previous()
        e = wp.tid()
        W, H, c, volume, J = tet_gradient(X, conn, u, e)
        m = material[e]
        pressure = R(0.0)
        for a in range(4):
            pressure += R(0.25) * pressure_of(law[m, 0], dilatation[group[a, e]])
        pressure += viscous_pressure(e, dilatation_of(H), volume, dt, True, extreme_out)
        strain, N, d = deviator(H)
        keep_strain(e, wp.ddot(strain, strain), extreme_out)
        keep_volume(e, R(1.0) - J, extreme_out)
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
        S, _pressure, dp = update(strain, R(0.0), law[m, 1], 0, e, m, flag, law, dt, history_out)
        if wp.static(plastic):
            if dp > R(0.0) and flag == 0:
                yielded_out[e] = int(1)
        P = nominal(H, S, N, d, pressure)
        P = R(-0.5) * R(THIRD) * add_matrices(P, W, P)
        f0 = P * c[0]
        f1 = P * c[1]
        f2 = P * c[2]
        for i in range(3):  # by components, see `hexahedron.store_function`
            force_out[slot + e][i] = -f0[i] - f1[i] - f2[i]
            force_out[slot + count + e][i] = f0[i]
            force_out[slot + 2 * count + e][i] = f1[i]
            force_out[slot + 3 * count + e][i] = f2[i]

    return begins_early(tet4_force)


@cache
def tetrahedron(precision: str, law_name: str, finite: bool, name: str, pressure: str) -> Formulation:
    """A tetrahedron of constant strain: its one point, whose stress all corners show."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    tet_gradient = gradient_function(precision, finite)

    @wp.struct
    class Tetrahedron:
        """Rotation W = Q - I, gradient H in that frame, cofactors of the edges, volume [m^3]."""

        W: mat33
        H: mat33
        cofactors: mat33
        volume: R

    @wp.func
    def load_shape(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        shape = Tetrahedron()
        W, H, cofactors, volume, _J = tet_gradient(X, conn, u, e)
        shape.W = W
        shape.H = H
        shape.cofactors = cofactors
        shape.volume = volume
        return shape

    @wp.func
    def gradient(shape: Tetrahedron, g: int):
        return shape.volume, shape.H

    @wp.func
    def rotation(shape: Tetrahedron):
        return shape.W

    @wp.func
    def slope(shape: Tetrahedron, g: int, a: int):
        c = shape.cofactors
        if a == 0:
            return R(-0.5) * R(THIRD) * (c[0] + c[1] + c[2])
        return R(0.5) * R(THIRD) * c[a - 1]

    @wp.func
    def corner_of(g: int, j: int):
        return j

    return Formulation(name, 4, 1, pressure, Tetrahedron, load_shape, gradient, rotation, 4, corner_of, slope=slope)


formulation = partial(tetrahedron, name="tet4", pressure=NODAL)
energy_kernel, stress_kernel = partial(energy_of, formulation), partial(stress_of, formulation)
failure_kernel = partial(failure_of, formulation)
