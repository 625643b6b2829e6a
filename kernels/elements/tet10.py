"""Owns the ten-node tetrahedron: quadratic displacements, four points.

Zienkiewicz, Taylor and Zhu, The Finite Element Method, 7th ed. (2013), section 6.2; points of Hammer, Marlowe and
Stroud (1956). The pressure is that of each point (`tet10`), or that of the mean dilatation (`tet10_mean`), which nearly
incompressible material in two layers of elements or more needs (Nagtegaal, Parks and Rice, Comput. Meth. Appl. Mech.
Engng 4 (1974) 153).
"""

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import warp as wp

from warp_mca.kernels.elements.failure import failure_kernel
from warp_mca.kernels.elements.formulation import MEAN, OWN, Formulation, Maker, parts_of
from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.kernels.elements.readings import energy_kernel, stress_kernel
from warp_mca.kernels.elements.tet10_points import BESIDE, FAR, POINT, between, centre_function, tet10_functions
from warp_mca.kernels.elements.viscosity import viscosity_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.isochoric import law_kinematics
from warp_mca.kernels.materials.kinematics import kinematics
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})

BLOCKS = 4  # of threads on a multiprocessor, at small strain in mixed precision: with 128 registers for each thread


@cache
def formulation(precision: str, law_name: str, finite: bool, name: str, pressure: str) -> Formulation:
    """Its points; each shows its stress at its corner and in middles of edges beside it."""
    TenNodes, load_tet10, point_gradient = tet10_functions(precision, finite)

    @wp.func
    def load_shape(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        return load_tet10(X, u, conn, e)

    @wp.func
    def gradient(it: TenNodes, g: int):
        H, _cofactors, volume = point_gradient(it, g)
        return volume, H

    @wp.func
    def rotation(it: TenNodes):
        return it.W

    @wp.func
    def corner_of(g: int, j: int):
        if j == 0:
            return g
        if g < 3:
            return 4 + g
        return 6 + j

    return Formulation(name, 10, 4, pressure, TenNodes, load_shape, gradient, rotation, 4, corner_of)


@cache
def spin_functions(precision: str) -> tuple[Any, Any]:
    """Functions: axial vector of the skew part of P H^T; skew matrix of an axial vector.

    At small strain the rotation Q of the centroid turns with the nodes, too. Its part of the slope of the energy is
    that of a skew stress at the centroid, minus the sum of the skew parts of P H^T there, but for terms of the third
    order. Without it an element that turns by 0.05 rad within itself lost 0.4 % of its energy.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def spin_of(P: mat33, H: mat33):
        M = P * wp.transpose(H)
        half = R(0.5)
        return vec3(half * (M[2, 1] - M[1, 2]), half * (M[0, 2] - M[2, 0]), half * (M[1, 0] - M[0, 1]))

    @wp.func
    def skew(a: vec3):
        zero = R(0.0)
        return mat33(zero, -a[2], a[1], a[2], zero, -a[0], -a[1], a[0], zero)

    return spin_of, skew


@cache
def spread_functions(precision: str) -> tuple[Any, Any, Any]:
    """The functions of forces on nodes f and of sums over the points, for corners 1 to 3: the transpose of
    `tet10_points`.

    (f, sums, spin, nominal stress P, H, weight, cofactors, W, g) -> f, sums and spin with those of point g; f and sums
    with a stress at the centroid; (f, sums, first entry, entries to the next node, force_out) stores f with the forces
    that all points cause alike.
    """
    t = scalars(precision)
    R, vec3, mat33, mat103 = t.real, t.vec3, t.mat33, t.mat103
    spin_of, _skew = spin_functions(precision)

    @wp.func
    def add_point(
        f: mat103, sums: mat33, spin: vec3, P: mat33, H: mat33, weight: R, cofactors: mat33, W: mat33, g: int
    ):
        world = R(POINT) * (P + W * P)
        for i in range(3):
            t = world * cofactors[i]
            sums[i] = sums[i] + t
            f[between(i + 1, g)] = f[between(i + 1, g)] - R(BESIDE) * t
            f[between(0, g)] = f[between(0, g)] + R(BESIDE) * t
        return f, sums, spin + weight * spin_of(P, H)

    @wp.func
    def add_centre(f: mat103, sums: mat33, B: mat33, cofactors: mat33, det: R, W: mat33):
        """With what a stress times volume B [N m] at the centroid adds, where differences have all of s_i."""
        world = (R(1.0) / det) * (B + W * B)
        t1 = world * cofactors[0]
        t2 = world * cofactors[1]
        t3 = world * cofactors[2]
        t0 = -(t1 + t2 + t3)
        rest = R(1.0) - R(FAR)
        f[4] = f[4] - rest * (t0 + t1)
        f[5] = f[5] - rest * (t1 + t2)
        f[6] = f[6] - rest * (t0 + t2)
        f[7] = f[7] - rest * (t0 + t3)
        f[8] = f[8] - rest * (t1 + t3)
        f[9] = f[9] - rest * (t2 + t3)
        sums[0] = sums[0] + t1
        sums[1] = sums[1] + t2
        sums[2] = sums[2] + t3
        return f, sums

    @wp.func
    def store_forces(f: mat103, sums: mat33, first: int, count: int, force_out: wp.array(dtype=vec3)):
        s0 = -(sums[0] + sums[1] + sums[2])
        f[4] = f[4] - R(FAR) * (s0 + sums[0])
        f[5] = f[5] - R(FAR) * (sums[0] + sums[1])
        f[6] = f[6] - R(FAR) * (s0 + sums[1])
        f[7] = f[7] - R(FAR) * (s0 + sums[2])
        f[8] = f[8] - R(FAR) * (sums[0] + sums[2])
        f[9] = f[9] - R(FAR) * (sums[1] + sums[2])
        f[0] = R(-0.5) * (f[4] + f[6] + f[7]) - s0
        f[1] = R(-0.5) * (f[4] + f[5] + f[8]) - sums[0]
        f[2] = R(-0.5) * (f[5] + f[6] + f[9]) - sums[1]
        f[3] = R(-0.5) * (f[7] + f[8] + f[9]) - sums[2]
        for a in range(10):
            for i in range(3):  # by components, as in `hexahedron.store_function`
                force_out[first + a * count][i] = f[a, i]

    return add_point, add_centre, store_forces


@cache
def pressure_function(precision: str, finite: bool, mean: bool, viscous: int) -> Any:
    """The function (struct, K, e, dt, extreme_out) -> mean dilatation [-], its pressure [Pa], volume [m^3], q [Pa].

    The first three are 0 without need of them.
    """
    TenNodes, _load_tet10, point_gradient = tet10_functions(precision, finite)
    R, k = scalars(precision).real, kinematics(precision, finite)
    dilatation_of, pressure_of, viscous_pressure = (
        k.dilatation,
        k.pressure,
        viscosity_function(precision, finite, viscous),
    )

    @wp.func
    def mean_pressure(it: TenNodes, K: R, e: int, dt: R, extreme_out: wp.array2d(dtype=R)):
        theta = R(0.0)
        volume = R(0.0)
        pressure = R(0.0)
        if wp.static(mean or viscous):
            for g in range(4):
                H, _cofactors, weight = point_gradient(it, g)
                theta += dilatation_of(H) * weight
                volume += weight
            theta = theta / volume
            pressure = pressure_of(K, theta)
        return theta, pressure, volume, viscous_pressure(e, theta, volume, dt, True, extreme_out)

    return mean_pressure


@cache
def tet10_force_kernel(maker: Maker, precision: str, law_name: str, finite: bool = False, viscous: int = 0) -> Any:
    """Kernel: forces of each element on its nodes, and the plastic history where there is a law.

    A general law gives the pressure of each point; its mean, which is conjugate to the mean dilatation, is known behind
    them.
    """
    form, point, _place = parts_of(maker, precision, law_name, finite)
    t = scalars(precision)
    R, vec3, mat33, mat103 = t.real, t.vec3, t.mat33, t.mat103
    _TenNodes, load_tet10, point_gradient = tet10_functions(precision, finite)
    add_point, add_centre, store_forces = spread_functions(precision)
    _spin_of, skew = spin_functions(precision)
    centre = centre_function(precision)
    plastic, mean, update = bool(law_name), form.pressure == MEAN, point.update
    own, later = not mean, point.general and mean  # pressures of points, known by themselves or behind them
    by_law = point.general
    mean_pressure = pressure_function(precision, finite, mean, viscous)
    keep_strain, keep_volume, _ = keep_functions(R)
    k = law_kinematics(precision, law_name, finite)
    dilatation_of, deviator, pressure_of, nominal = k.dilatation, k.deviator, k.pressure, k.nominal

    bounds = (PATCH, BLOCKS) if precision == "mixed" and not (finite or by_law) else None

    # fast math would lose the digits of ln(1 + x) of small x
    @wp.kernel(
        enable_backward=False,
        module="unique",
        grid_stride=False,
        launch_bounds=bounds,
        module_options={"fast_math": not finite},
    )
    def tet10_force(
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
        it = load_tet10(X, u, conn, e)
        m = material[e]
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
        flows = int(flag)
        theta, pressure, volume, q = mean_pressure(it, law[m, 0], e, dt, extreme_out)
        largest = R(0.0)
        smallest = R(1.0)
        behind = R(0.0)
        spin = vec3()
        f = mat103()
        sums = mat33()
        for g in range(4):
            H, cofactors, weight = point_gradient(it, g)
            strain, N, d = deviator(H)
            largest = wp.max(largest, wp.ddot(strain, strain))
            smallest = wp.min(smallest, wp.determinant(wp.identity(n=3, dtype=R) + H))
            if wp.static(own):
                theta = dilatation_of(H)
                pressure = pressure_of(law[m, 0], theta)
            S, pressure_by_law, dp = update(strain, theta, law[m, 1], g, e, m, flag, law, dt, history_out)
            if dp > R(0.0):
                flows = int(1)
            if wp.static(by_law):
                pressure = pressure_by_law
            if wp.static(later):
                behind += pressure * weight / volume
                pressure = R(0.0)
            f, sums, spin = add_point(f, sums, spin, nominal(H, S, N, d, pressure + q), H, weight, cofactors, it.W, g)
        if wp.static(later):
            for g in range(4):
                H, cofactors, weight = point_gradient(it, g)
                P = nominal(H, mat33(), mat33(), vec3(), behind)
                f, sums, spin = add_point(f, sums, spin, P, H, weight, cofactors, it.W, g)
        if wp.static(not finite):
            cofactors, det = centre(it)
            f, sums = add_centre(f, sums, skew(-spin), cofactors, det, it.W)
        if wp.static(plastic):
            if flows != flag:
                yielded_out[e] = flows
        keep_strain(e, largest, extreme_out)
        turned = wp.determinant(wp.identity(n=3, dtype=R) + it.W)  # -1 of elements turned inside out
        keep_volume(e, R(1.0) - smallest * turned, extreme_out)
        store_forces(f, sums, slot + e, count, force_out)

    return tet10_force


@dataclass(frozen=True)
class Kernels:
    """Makers of the kernels of one element, for `ElementStage`."""

    force_kernel: Any
    energy_kernel: Any
    stress_kernel: Any
    failure_kernel: Any


@cache
def kernels(name: str, mean: bool) -> Kernels:
    """Those of an element of this name, with the pressure of the `mean` dilatation or of each point."""
    maker = partial(formulation, name=name, pressure=MEAN if mean else OWN)
    makers = (tet10_force_kernel, energy_kernel, stress_kernel, failure_kernel)
    return Kernels(*(partial(make, maker) for make in makers))
