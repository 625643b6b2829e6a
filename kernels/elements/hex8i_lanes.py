"""Owns how two lanes of a GPU compute an element of `hex8i` that yields, each two columns of its points.

The columns of a lane do not depend on each other, so that one fills the time that the other waits.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hex8_lanes import HISTORY_SIZE
from warp_mca.kernels.elements.hex8i_exchange import corner_functions, lane_functions
from warp_mca.kernels.elements.hex8i_small import conjugate_function, settled_function, stress_modes_function
from warp_mca.kernels.elements.internal_modes import PLANE, mode_functions, place_functions
from warp_mca.kernels.elements.patch import POINT, Patches
from warp_mca.kernels.elements.patch_element import material_of
from warp_mca.kernels.elements.patterns import VOLUME_SCALE, balance_function, mean_functions
from warp_mca.kernels.elements.viscosity import kept_pressure_function
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.hardware.shared_memory import ROW, row_functions, warp_barrier
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.records.extremes import LAG_LOSS, keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def kept_function(precision: str) -> Any:
    """The function (lane, pool) -> (H, q, W) that `hex8i_patch.keep_function` kept; of H the symmetric part."""
    t = scalars(precision)
    R, vec3, mat33, mat43 = t.real, t.vec3, t.mat33, t.mat43

    @wp.func
    def kept(lane: int, pool: wp.array(dtype=R)):
        q = mat43()
        for i in range(12):
            q[i // 3, i % 3] = pool[i * wp.static(ROW) + lane]
        first = 12 * wp.static(ROW) + lane
        xy = R(0.5) * pool[first + 3 * wp.static(ROW)]
        yz = R(0.5) * pool[first + 4 * wp.static(ROW)]
        xz = R(0.5) * pool[first + 5 * wp.static(ROW)]
        H = mat33(
            R(0.5) * pool[first], xy, xz,
            xy, R(0.5) * pool[first + wp.static(ROW)], yz,
            xz, yz, R(0.5) * pool[first + 2 * wp.static(ROW)],
        )  # fmt: skip
        first = 18 * wp.static(ROW) + lane
        a = vec3(pool[first], pool[first + wp.static(ROW)], pool[first + 2 * wp.static(ROW)])
        b = vec3(pool[first + 3 * wp.static(ROW)], pool[first + 4 * wp.static(ROW)], pool[first + 5 * wp.static(ROW)])
        # (e_x + a) x (e_y + b) - e_z, with rounding as small as W
        c = wp.cross(a, b) + vec3(-a[2], -b[2], a[0] + b[1])
        W = mat33(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2])
        return H, q, W

    return kept


@cache
def column_functions(points: int, precision: str, law_name: str) -> tuple[Any, Any]:
    """Functions of a column of points.

    (History rows of the near and the far column, y, xi, eta of the far one) -> their part of the tractions of plastic
    strain; (elastic stress at the middle and its slope, history row, G, law, m) -> sum and moment of the stress, new
    history row, greatest elastic S : S / 2, flow.
    """
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    tensor, count = wp.types.vector(6, R), points // 4
    row = wp.types.vector(count * HISTORY_SIZE, R)
    modes = mode_functions(precision)
    invariant, product, whole = modes.invariant, modes.product, modes.whole
    _, layer_place = place_functions(precision, points)
    functions = law_functions(law_name, precision)
    read_parameters, return_map = functions.parameters, functions.return_map
    size = HISTORY_SIZE

    @wp.func
    def plastic_strain(history: row, first: int):
        h0 = history[first]
        h1 = history[first + 1]
        return tensor(h0, h1, -h0 - h1, history[first + 2], history[first + 3], history[first + 4])

    @wp.func
    def plastic_parts(near: row, far: row, y: mat33, xi: R, eta: R):
        total = tensor()
        across = tensor()
        moment = tensor()
        for k in range(wp.static(count)):
            zeta, share = layer_place(k)
            strain = plastic_strain(near, wp.static(size) * k)
            other = plastic_strain(far, wp.static(size) * k)
            both = strain + other
            total = total + (R(6.0) * share) * both
            across = across + (R(6.0) * share) * (other - strain)
            moment = moment + (R(6.0) * share * zeta) * both
        return xi * product(total, y[0]), eta * product(across, y[1]), product(moment, y[2])

    @wp.func
    def flow_column(middle: tensor, slope: tensor, history: row, G: R, law: wp.array2d(dtype=R), m: int):
        total = tensor()
        moment = tensor()
        largest = R(0.0)
        flows = bool(False)
        for k in range(wp.static(count)):
            zeta, share = layer_place(k)
            first = wp.static(size) * k
            T = middle + zeta * slope
            largest = wp.max(largest, invariant(T))
            p = history[first + 5]
            eps_p = whole(plastic_strain(history, first), R(0.0))
            S, eps_new, p_new = return_map(whole(T, R(0.0)), eps_p, p, G, read_parameters(law, m, R(1.0)))
            flows = flows or p_new > p
            history[first] = eps_new[0, 0]
            history[first + 1] = eps_new[1, 1]
            history[first + 2] = eps_new[0, 1]
            history[first + 3] = eps_new[1, 2]
            history[first + 4] = eps_new[0, 2]
            history[first + 5] = p_new
            flowing = tensor(S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[1, 2], S[0, 2])
            total = total + share * flowing
            moment = moment + (share * zeta) * flowing
        return total, moment, history, largest, flows

    return plastic_parts, flow_column


@cache
def sums_function(precision: str) -> Any:
    """The function that sums the stress over the lanes.

    (Sums and moments of the stress of the lane's columns, pressures that are linear in the coordinates, y, xi of the
    lane's corners, K, G) -> (mean; parts of the stress that are linear in a coordinate, what `settled_function` leaves
    of them; their pressures; w of `conjugate_function`; energy that the lag of the vectors takes, per volume).
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    tensor = wp.types.vector(6, R)
    _, sums, _, _ = lane_functions(precision)
    settled, product = settled_function(precision), mode_functions(precision).product

    @wp.func
    def lane_sums(
        near: tensor, near_moment: tensor, far: tensor, far_moment: tensor, p: vec3, y: mat33, xi: R, K: R, G: R
    ):
        plane = R(PLANE)
        mean, R0, R1, M2 = sums(near, far, xi)
        R2, M1, M0, _both = sums(near_moment, far_moment, xi)
        third = R(THIRD)
        R0, p0, work0 = settled(plane * R0, third * p[0], y[0], K, G)
        R1, p1, work1 = settled(plane * R1, third * p[1], y[1], K, G)
        R2, p2, work2 = settled(R2, third * p[2], y[2], K, G)
        w = vec3(
            plane * wp.dot(y[0], product(M0, y[0])),
            plane * wp.dot(y[1], product(M1, y[1])),
            third * wp.dot(y[2], product(M2, y[2])),
        )
        return mean, R0, R1, R2, vec3(p0, p1, p2), w, work0 + work1 + work2

    return lane_sums


@cache
def flow_function(points: int, precision: str, law_name: str, viscous: int = 0) -> Any:
    """The function by which two lanes compute an element of a patch."""
    R, point = scalars(precision).real, POINT[precision]
    _, _, vector_sum, lane_max = lane_functions(precision)
    column_place, _ = place_functions(precision, points)
    plastic_parts, flow_column = column_functions(points, precision, law_name)
    modes, kept_pressure = mode_functions(precision), kept_pressure_function(precision, viscous)
    frame, whole = modes.frame, modes.whole
    stress_modes, conjugate = stress_modes_function(precision), conjugate_function(precision)
    lane_sums, kept, (load_patterns, store_lane_forces) = (
        sums_function(precision),
        kept_function(precision),
        corner_functions(precision),
    )
    (mean_gradients, _), balanced = mean_functions(precision), balance_function(precision)
    size = points // 4 * HISTORY_SIZE
    read_row, write_row = row_functions(precision, size)
    keep_strain, _, strain_square = keep_functions(R)

    @wp.func
    def flow(
        points: wp.array(dtype=point),
        pool: wp.array(dtype=wp.vec3d),
        first: int,
        exponent: int,
        patches: Patches,
        e: int,
        law: wp.array2d(dtype=R),
        _dt: R,
        thread: int,
        lane: int,
        valid: bool,
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=R),
    ):
        """Two lanes, 0 and 1, compute the element of a thread. Returns whether a lane's points flow."""
        near_history = read_row(history_out, wp.static(size) * lane, e)  # first, because it takes longest
        far_history = read_row(history_out, wp.static(size) * (lane + 2), e)
        m = material_of(patches.corner[0, e], patches.corner[1, e])
        H, q, W = kept(thread, force_out)
        warp_barrier()
        right = wp.where(lane != 0, R(1.0), R(-1.0))
        xi, eta = column_place(lane + 2)
        x = load_patterns(points, pool, patches, e, lane, first, exponent, right)
        y = frame(x)
        K, G = law[m, 0], law[m, 1]
        n0, n1, n2 = plastic_parts(near_history, far_history, y, xi, eta)
        S, S0, S1, S2, N0, N1, N2, pressure, p = stress_modes(
            x, H, q, y, vector_sum(n0), vector_sum(n1), vector_sum(n2), K, G
        )
        S = S + xi * S0
        S1 = S1 + xi * N2
        S2 = S2 + xi * N1
        near, near_moment, near_history, near_largest, near_flows = flow_column(
            S - eta * S1, S2 - eta * N0, near_history, G, law, m
        )
        beyond, far_moment, far_history, far_largest, far_flows = flow_column(
            S + eta * S1, S2 + eta * N0, far_history, G, law, m
        )
        largest = lane_max(wp.max(near_largest, far_largest))
        if valid and lane == 0:
            keep_strain(e, strain_square(largest, G), extreme_out)
        if valid and near_flows:
            write_row(near_history, wp.static(size) * lane, e, history_out)
        if valid and far_flows:
            write_row(far_history, wp.static(size) * (lane + 2), e, history_out)
        flows = valid and (near_flows or far_flows)
        mean, R0, R1, R2, p, w, lost = lane_sums(near, near_moment, beyond, far_moment, p, y, right, K, G)
        b, scaled_volume = mean_gradients(x)
        volume = R(VOLUME_SCALE) * scaled_volume
        if lane_max(wp.where(flows, R(1.0), R(0.0))) > R(0.0) and lane == 0:
            wp.atomic_add(extreme_out, LAG_LOSS, e, volume * lost)  # which waits for nothing
        Q = conjugate(x, volume, y, R0, R1, R2, p, w)
        if wp.static(viscous):
            pressure = pressure + kept_pressure(e, extreme_out)
        if valid:
            P = balanced(whole(mean, pressure), H, q, Q, volume)
            store_lane_forces(x, b, volume, W, P, Q, right, lane, thread, force_out)
        return flows

    return flow
