"""Owns how four lanes of a GPU compute an element of `hex8` that yields, two Gauss points each.

They exchange the values that the points of an element share.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.elements.hex8_small import stress_functions
from warp_mca.kernels.elements.hexahedron import LINE_RATIO, LINE_SCALE
from warp_mca.kernels.elements.patch import POINT, Patches
from warp_mca.kernels.elements.patch_element import load_functions, material_of
from warp_mca.kernels.elements.viscosity import viscosity_function
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.hardware.shared_memory import ROW, row_functions, shared_functions, warp_barrier
from warp_mca.kernels.materials.laws import FLOW_HISTORY, law_functions, row_count
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})

HISTORY_SIZE = row_count(FLOW_HISTORY)


@cache
def lane_functions(precision: str) -> tuple[Any, Any, Any, Any]:
    """Functions over the four lanes of an element, whose bits 0 and 1 are xi and eta of corners and Gauss points.

    A lane has the lower and the upper of both. The functions take corner values to edge vectors on the Gauss lines
    through the lane's points (see `line_functions`; along zeta both points share one), edge forces at the points to
    corner forces by the transpose, and a scalar to its sum and its maximum over the lanes.
    """
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    _, exchange = shared_functions(precision)

    @wp.func
    def other(x: vec3, mask: int):
        return vec3(exchange(x[0], mask), exchange(x[1], mask), exchange(x[2], mask))

    @wp.func
    def to_point_lines(lower: vec3, upper: vec3, xi: R, eta: R):
        r = R(LINE_RATIO)
        x0 = other(lower, 1)  # across xi
        x1 = other(upper, 1)
        y0 = other(lower, 2)  # across eta
        y1 = other(upper, 2)
        z0 = other(x0, 2)  # across both
        z1 = other(x1, 2)
        # differences of corners first, which are exact, then their means
        a0 = xi * ((lower - x0) + r * (y0 - z0))
        a1 = xi * ((upper - x1) + r * (y1 - z1))
        b0 = eta * ((lower - y0) + r * (x0 - z0))
        b1 = eta * ((upper - y1) + r * (x1 - z1))
        c = (upper - lower) + r * (y1 - y0) + r * ((x1 - x0) + r * (z1 - z0))
        return a0 + r * a1, a1 + r * a0, b0 + r * b1, b1 + r * b0, c

    @wp.func
    def to_corners(Fx0: vec3, Fx1: vec3, Fy0: vec3, Fy1: vec3, Fz: vec3, xi: R, eta: R):
        r = R(LINE_RATIO)
        x0 = -xi * (Fx0 + other(Fx0, 1))  # forces pull the ends of an edge together
        x1 = -xi * (Fx1 + other(Fx1, 1))
        y0 = eta * (Fy0 + r * other(Fy0, 1))
        y1 = eta * (Fy1 + r * other(Fy1, 1))
        z = Fz + r * other(Fz, 1)
        # each lane sends what its partner on the other side adds
        s0 = (x0 - y0) + other(r * x0 + y0, 2)
        s1 = (x1 - y1) + other(r * x1 + y1, 2)
        z = z + r * other(z, 2)
        return (s0 + r * s1) + z, (s1 + r * s0) - z

    @wp.func
    def lane_sum(value: R):
        value += exchange(value, 1)
        return value + exchange(value, 2)

    @wp.func
    def lane_max(value: R):
        value = wp.max(value, exchange(value, 1))
        return wp.max(value, exchange(value, 2))

    return to_point_lines, to_corners, lane_sum, lane_max


@cache
def point_functions(precision: str, law_name: str) -> tuple[Any, Any, Any, Any]:
    """Functions of one Gauss point.

    They take edge vectors of position and local displacement to cofactors, determinant and six sums of products; give
    the deviatoric stress and plastic strain of a point, and J2 of its stress without plastic flow; read the history of
    two points; and give the forces of the edges.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    add_traction, symmetric_gradient, deviator, invariant = stress_functions(precision)
    functions = law_functions(law_name, precision)
    read_parameters, return_map = functions.parameters, functions.return_map
    pair = wp.types.vector(2 * HISTORY_SIZE, R)
    scale = LINE_SCALE**3

    @wp.func
    def shape_of_point(gx: vec3, gy: vec3, gz: vec3, lx: vec3, ly: vec3, lz: vec3):
        b0 = wp.cross(gy, gz)
        b1 = wp.cross(gz, gx)
        b2 = wp.cross(gx, gy)
        xx, yy, zz, xy, yz, xz = symmetric_gradient(lx, ly, lz, b0, b1, b2)
        return b0, b1, b2, wp.dot(gx, b0), mat33(xx, xy, xz, xy, yy, yz, xz, yz, zz)

    @wp.func
    def stress_of_point(
        sums: mat33,
        det: R,
        law: wp.array2d(dtype=R),
        m: int,
        history: pair,
        first: int,
    ):
        """Direct `sums` are strains times det, the others twice that; the history of the point begins at `first`."""
        G = R(scale) * law[m, 1]
        shear = G / det
        direct = shear + shear
        mean = R(THIRD) * (sums[0, 0] + sums[1, 1] + sums[2, 2])
        elastic = deviator(direct, shear, mean, sums[0, 0], sums[1, 1], sums[2, 2], sums[0, 1], sums[1, 2], sums[0, 2])
        p_xx = history[first]
        p_yy = history[first + 1]
        p_xy = history[first + 2]
        p_yz = history[first + 3]
        p_xz = history[first + 4]
        eps_p = mat33(p_xx, p_xy, p_xz, p_xy, p_yy, p_yz, p_xz, p_yz, -p_xx - p_yy)
        S, eps_new, p_new = return_map(elastic, eps_p, history[first + 5], G, read_parameters(law, m, R(scale)))
        return S, eps_new, p_new, invariant(elastic)

    @wp.func
    def force_of_edge(S: mat33, pressure: R, b: vec3):
        return add_traction(S, b, pressure * b)

    @wp.func
    def history_of_points(eps0: mat33, p0: R, eps1: mat33, p1: R):
        # fmt: off
        return pair(
            eps0[0, 0], eps0[1, 1], eps0[0, 1], eps0[1, 2], eps0[0, 2], p0,
            eps1[0, 0], eps1[1, 1], eps1[0, 1], eps1[1, 2], eps1[0, 2], p1,
        )
        # fmt: on

    return shape_of_point, stress_of_point, history_of_points, force_of_edge


@cache
def flow_function(precision: str, law_name: str, viscous: int = 0) -> Any:
    """The function by which four lanes compute an element of a patch, of which the first keeps bulk viscosity."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    point = POINT[precision]
    _, _, load_corners = load_functions(precision)
    add_product, add_transposed = fused(precision).add_product, fused(precision).add_transposed
    to_point_lines, to_corners, lane_sum, lane_max = lane_functions(precision)
    shape_of_point, stress_of_point, history_of_points, force_of_edge = point_functions(precision, law_name)
    size, last = HISTORY_SIZE, HISTORY_SIZE - 1
    read_row, write_row = row_functions(precision, 2 * size)
    keep_strain, _, strain_square = keep_functions(R)
    scale, viscous_pressure = LINE_SCALE**3, viscosity_function(precision, False, viscous or 1)

    @wp.func
    def pressure_of(K: R, dilatation: R, volume: R, e: int, first: bool, dt: R, extreme_out: wp.array2d(dtype=R)):
        pressure = R(scale) * K * dilatation / volume
        if wp.static(viscous):
            own = R(0.0)
            if first:  # of the lanes
                own = viscous_pressure(e, dilatation / volume, R(scale) * volume, dt, True, extreme_out)
            pressure = pressure + R(scale) * lane_sum(own)
        return pressure

    @wp.func
    def flow(
        points: wp.array(dtype=point),
        pool: wp.array(dtype=wp.vec3d),
        first: int,
        exponent: int,
        patches: Patches,
        e: int,
        law: wp.array2d(dtype=R),
        dt: R,
        thread: int,
        q: int,
        valid: bool,
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=R),
    ):
        """Four lanes, q = 0 to 3, compute the element of a thread; its rotation W is stored in the place of its forces.

        Returns whether a lane's points flow.
        """
        a = q ^ (q >> 1)  # corners run around the faces
        x0, d0, x1, d1 = load_corners(points, pool, patches, e, a, first, exponent)
        m = material_of(patches.corner[0, e], patches.corner[1, e])
        W = mat33()
        for k in range(9):
            W[k // 3, k % 3] = force_out[k * wp.static(ROW) + thread]
        warp_barrier()
        history = read_row(history_out, 2 * size * q, e)
        xi = wp.where((q & 1) != 0, R(1.0), R(-1.0))
        eta = wp.where(q > 1, R(1.0), R(-1.0))
        gx0, gx1, gy0, gy1, gz = to_point_lines(x0, x1, xi, eta)
        lx0, lx1, ly0, ly1, lz = to_point_lines(add_transposed(d0, W, x0 + d0), add_transposed(d1, W, x1 + d1), xi, eta)
        b00, b01, b02, det0, sums0 = shape_of_point(gx0, gy0, gz, lx0, ly0, lz)
        b10, b11, b12, det1, sums1 = shape_of_point(gx1, gy1, gz, lx1, ly1, lz)
        dilatation = lane_sum(wp.trace(sums0) + wp.trace(sums1))
        pressure = pressure_of(law[m, 0], dilatation, lane_sum(det0 + det1), e, valid and q == 0, dt, extreme_out)
        S0, eps0, p0, trial0 = stress_of_point(sums0, det0, law, m, history, 0)
        S1, eps1, p1, trial1 = stress_of_point(sums1, det1, law, m, history, size)
        largest = lane_max(wp.max(trial0, trial1))
        if valid and q == 0:
            keep_strain(e, strain_square(largest, R(scale) * law[m, 1]), extreme_out)
        flows = valid and (p0 > history[last] or p1 > history[size + last])
        if flows:
            write_row(history_of_points(eps0, p0, eps1, p1), 2 * size * q, e, history_out)
        Fz = force_of_edge(S0, pressure, b02) + force_of_edge(S1, pressure, b12)
        Fx0, Fx1 = force_of_edge(S0, pressure, b00), force_of_edge(S1, pressure, b10)
        Fy0, Fy1 = force_of_edge(S0, pressure, b01), force_of_edge(S1, pressure, b11)
        f0, f1 = to_corners(Fx0, Fx1, Fy0, Fy1, Fz, xi, eta)
        f0 = add_product(f0, W, f0)
        f1 = add_product(f1, W, f1)
        if valid:
            for i in range(3):
                force_out[(3 * a + i) * wp.static(ROW) + thread] = f0[i]
                force_out[(3 * (a + 4) + i) * wp.static(ROW) + thread] = f1[i]
        return flows

    return flow
