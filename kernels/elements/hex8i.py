"""Owns the hexahedron of 2 x 2 x 2 points that bends right with one element across: `internal_modes` says how.

Strain is measured in the rotated frame of the mean deformation, from reference coordinates, as in `hex8`.
"""

from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_mca.kernels.elements import hex8i_points, hex8i_vectors
from warp_mca.kernels.elements.failure import failure_kernel
from warp_mca.kernels.elements.formulation import OWN, SPLIT, Formulation, own_modulus_function
from warp_mca.kernels.elements.hex8i_small import elastic_function, plastic_tractions_function, stress_function
from warp_mca.kernels.elements.hexahedron import load_function, store_function
from warp_mca.kernels.elements.internal_modes import mode_functions, place_functions
from warp_mca.kernels.elements.patterns import (
    balance_function,
    corner_force_function,
    pattern_functions,
    pattern_strain_function,
)
from warp_mca.kernels.elements.readings import energy_kernel, stress_kernel
from warp_mca.kernels.elements.viscosity import viscosity_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.kinematics import kinematics
from warp_mca.kernels.materials.laws import Law, law_functions
from warp_mca.kernels.records.extremes import LAG_LOSS, keep_functions

wp.set_module_options({"enable_backward": False})


def keeps_vectors(law: Law, finite: bool) -> bool:
    """Whether the internal vectors are part of the history: where they have no closed form."""
    return finite or law.by_points


def lags(law: Law, finite: bool) -> bool:
    """Whether the internal vectors lag behind: where not all of the stress is elastic, at small strain."""
    return finite or law.general or bool(law.history)


@cache
def force_kernel(points: int, precision: str, law_name: str, finite: bool = False, viscous: int = 0) -> Any:
    """Kernel: forces of each element on its nodes [N], and the history."""
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    load_element, store_force = load_function(precision), store_function(precision)
    to_patterns, _ = pattern_functions(precision)
    shape_and_strain, corner_forces = pattern_strain_function(precision, finite), corner_force_function(precision)
    frame, balanced = mode_functions(precision).frame, balance_function(precision)
    keep_strain, keep_volume, strain_square = keep_functions(R)
    by_points, plastic = keeps_vectors(law_functions(law_name, precision), finite), bool(law_name)
    points_stress = hex8i_points.stress_function(precision, law_name, finite, points)
    elastic_stress = elastic_function(precision, points)
    flow_stress = stress_function(precision, law_name, points) if plastic else None
    k, viscous_pressure = kinematics(precision, finite), viscosity_function(precision, finite, viscous or 1)
    dilatation_of, nominal = k.dilatation, k.nominal

    # fast math would lose the digits of ln(1 + x) of small x
    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": not finite})
    def hex8i_force(
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
        x = to_patterns(load_element(X, conn, e))
        du = to_patterns(load_element(u, conn, e))
        b, volume, W, H, J, q = shape_and_strain(x, du)
        y = frame(x)
        m = material[e]
        if wp.static(by_points):
            P, Q, largest, lost = points_stress(x, volume, H, q, y, e, m, law, dt, yielded_out, history_out)
            extreme_out[LAG_LOSS, e] = extreme_out[LAG_LOSS, e] + lost
            keep_strain(e, largest, extreme_out)
        else:
            if wp.static(plastic):
                flag = yielded_out[e]
                P, Q, largest, flows, lost = flow_stress(
                    x, volume, H, q, y, law[m, 0], law[m, 1], e, m, flag, law, history_out
                )
                if flows:
                    extreme_out[LAG_LOSS, e] = extreme_out[LAG_LOSS, e] + lost
                    if flag == 0:
                        yielded_out[e] = 1
            else:
                P, Q, largest = elastic_stress(x, volume, H, q, y, law[m, 0], law[m, 1])
            keep_strain(e, strain_square(largest, law[m, 1]), extreme_out)
        keep_volume(e, R(1.0) - J, extreme_out)
        if wp.static(viscous):
            pressure = viscous_pressure(e, dilatation_of(H), volume, dt, True, extreme_out)
            P = P + nominal(H, mat33(), mat33(), vec3(), pressure)
        if wp.static(not finite):
            P = balanced(P, H, q, Q, volume)
        f = corner_forces(x, b, volume, W, P, Q)
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, a)

    return hex8i_force


@cache
def formulation(points: int, precision: str, law_name: str, finite: bool) -> Formulation:
    """Its points, of which the outermost show their stress at the corners that lie nearest."""
    t = scalars(precision)
    R, mat33, mat43, mat73 = t.real, t.mat33, t.mat43, t.mat73
    to_patterns, _ = pattern_functions(precision)
    load_element, shape_and_strain = load_function(precision), pattern_strain_function(precision, finite)
    modes, varying = mode_functions(precision), hex8i_points.varying_function(precision, finite)
    frame, solve = modes.frame, modes.solve
    column_place, layer_place, layer_count = *place_functions(precision, points), points // 4
    by_points, plastic = keeps_vectors(law_functions(law_name, precision), finite), bool(law_name)
    read_vectors, _ = hex8i_vectors.vector_functions(precision, law_name, points)
    plastic_tractions = plastic_tractions_function(precision, law_name, points)
    splits = hex8i_points.splits(precision, law_name, finite)
    own_modulus = own_modulus_function(precision)

    @wp.struct
    class Hex8i:
        """A loaded element.

        Attributes:
            x, q: patterns of the positions [m], amplitudes of the displacements, see `patterns`.
            volume: [m^3].
            W, H: rotation less I, mean displacement gradient [-].
            L0, L1, L2: parts of the gradient that are linear in a natural coordinate [-].
            N0, N1, N2: parts with the product of the two others [-].
            share: what is left of the internal vectors [-].
        """

        x: mat73
        q: mat43
        volume: R
        W: mat33
        H: mat33
        L0: mat33
        L1: mat33
        L2: mat33
        N0: mat33
        N1: mat33
        N2: mat33
        share: R

    @wp.func
    def load_shape(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        shape = Hex8i()
        x = to_patterns(load_element(X, conn, e))
        _b, volume, W, H, _J, q = shape_and_strain(x, to_patterns(load_element(u, conn, e)))
        shape.x = x
        shape.q = q
        shape.volume = volume
        shape.W = W
        shape.H = H
        return shape

    @wp.func
    def enriched(shape: Hex8i, e: int, m: int, flag: int, law: wp.array2d(dtype=R), history: wp.array2d(dtype=R)):
        y = frame(shape.x)
        G = law[m, 1]
        K = R(law[m, 0])
        c = mat33()
        share = R(1.0)
        if wp.static(by_points):
            c, share = read_vectors(history, e)
        if wp.static(splits):
            K = own_modulus(law[m, 0], G, R(1.0))
        if wp.static(plastic and not by_points):
            n0, n1, n2 = plastic_tractions(y, e, history)
            c[0] = solve(G * n0, y[0], K, G)
            c[1] = solve(G * n1, y[1], K, G)
            c[2] = solve(G * n2, y[2], K, G)
        _F, _i, _Y, _a, L0, L1, L2, N0, N1, N2, _l, _z = varying(shape.x, shape.H, shape.q, y, c, share, K, G)
        shape.L0 = L0
        shape.L1 = L1
        shape.L2 = L2
        shape.N0 = N0
        shape.N1 = N1
        shape.N2 = N2
        shape.share = share
        return shape

    @wp.func
    def split(shape: Hex8i, K: R, G: R):
        return own_modulus(K, G, shape.share)

    @wp.func
    def gradient(shape: Hex8i, g: int):
        xi, eta = column_place(g // wp.static(layer_count))
        zeta, weight = layer_place(g % wp.static(layer_count))
        middle = (shape.H + xi * shape.L0) + eta * (shape.L1 + xi * shape.N2)
        return weight * shape.volume, middle + zeta * ((shape.L2 + xi * shape.N1) + eta * shape.N0)

    @wp.func
    def rotation(shape: Hex8i):
        return shape.W

    @wp.func
    def corner_of(g: int, j: int):
        """Outer points come last in each half of a column, so that they are the ones shown."""
        column = g // wp.static(layer_count)
        return (column ^ (column >> 1)) + 4 * ((g % wp.static(layer_count)) // wp.static(layer_count // 2))

    given = (SPLIT if splits else OWN, Hex8i, load_shape, gradient, rotation, 1, corner_of)
    lag = lags(law_functions(law_name, precision), finite)
    return Formulation("hex8i", 8, points, *given, enriched=enriched, lags=lag, split=split)


@cache  # makers keep kernels by what they are called with: these parts of them are the same each time
def kernels(points: int) -> SimpleNamespace:
    """What `ElementStage` asks of a module of kernels, for elements of so many points."""
    maker = partial(formulation, points)
    return SimpleNamespace(
        force_kernel=partial(force_kernel, points),
        energy_kernel=partial(energy_kernel, maker),
        stress_kernel=partial(stress_kernel, maker),
        failure_kernel=partial(failure_kernel, maker),
        kept=lambda law, finite: hex8i_vectors.KEPT if keeps_vectors(law, finite) else (),
        lags=lags,
    )
