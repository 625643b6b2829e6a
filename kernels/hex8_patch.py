"""Owns the force kernel of `hex8` on a GPU, at small strain: one thread for each element, eight where it yields.

Elements that have not yielded need neither history nor registers for it: a thread computes one as if it were elastic.
Those that have, or that turn out to yield now, are listed; then eight lanes take each of them, a Gauss point apiece,
and exchange what the points of an element share.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels import j2
from warp_mca.kernels.hex8 import elastic_function, stress_functions
from warp_mca.kernels.hexahedron import LINE_RATIO, LINE_SCALE, frame_functions, history_functions
from warp_mca.kernels.patch import (
    Patches,
    barrier,
    corners_of,
    list_pool,
    load_functions,
    load_patch,
    node_pool,
    shared_functions,
    sum_functions,
    warp_barrier,
)
from warp_mca.kernels.scalars import scalars
from warp_mca.patches import PATCH, SLOTS

wp.set_module_options({"enable_backward": False})

_THIRD = 1.0 / 3.0


@cache
def lane_functions(precision: str) -> tuple[Any, Any, Any]:
    """Functions over the eight lanes of an element, whose bits 0, 1, 2 are xi, eta, zeta of corner and Gauss point.

    (corner value -> edge vectors on the three Gauss lines through the lane's point, as `line_functions` has them;
    edge forces at the points -> corner force, the transpose; sum of a scalar.)
    """
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    _, exchange = shared_functions(precision)

    @wp.func
    def other(x: vec3, mask: int):
        return vec3(exchange(x[0], mask), exchange(x[1], mask), exchange(x[2], mask))

    @wp.func
    def side(q: int, bit: int):
        return wp.where((q >> bit) & 1 != 0, R(1.0), R(-1.0))

    @wp.func
    def to_point_lines(x: vec3, q: int):
        r = R(LINE_RATIO)
        o = other(x, 1)
        d = side(q, 0) * (x - o)  # edge along xi
        s = x + r * o
        do = other(d, 2)
        so = other(s, 2)
        ds = d + r * do
        sd = side(q, 1) * (s - so)  # edge along eta
        ss = s + r * so
        return ds + r * other(ds, 4), sd + r * other(sd, 4), side(q, 2) * (ss - other(ss, 4))

    @wp.func
    def to_corner(Fx: vec3, Fy: vec3, Fz: vec3, q: int):
        r = R(LINE_RATIO)
        x = Fx + r * other(Fx, 4)
        y = Fy + r * other(Fy, 4)
        z = -side(q, 2) * (Fz + other(Fz, 4))  # forces pull the ends of an edge together
        mine = -side(q, 1)
        x = x + r * other(x, 2)
        # each lane sends what its partner, on the other side, adds
        y = (mine * y + z) + other(-mine * y + r * z, 2)
        mine = -side(q, 0)
        return (mine * x + y) + other(-mine * x + r * y, 1)

    @wp.func
    def lane_sum(value: R):
        value += exchange(value, 1)
        value += exchange(value, 2)
        return value + exchange(value, 4)

    return to_point_lines, to_corner, lane_sum


@cache
def force_kernel(precision: str, plastic: bool) -> Any:
    """Kernel: forces of each patch on its nodes, and the plastic history where `plastic`."""
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    force_pool, _ = shared_functions(precision)
    load_element, load_node = load_functions(precision)
    keep_forces, sum_patch = sum_functions(precision)
    element_rotation, local_displacement = frame_functions(precision)
    elastic_forces = elastic_function(precision)
    add_traction, symmetric_gradient = stress_functions(precision)
    to_point_lines, to_corner, lane_sum = lane_functions(precision)
    read_plastic_strain, write_plastic_strain = history_functions(precision)
    j2_return = j2.return_map(precision)
    scale = LINE_SCALE**3

    @wp.func
    def flow(
        pool: wp.array(dtype=wp.vec3d),
        patches: Patches,
        law: wp.array2d(dtype=R),
        e: int,
        m: int,
        thread: int,
        q: int,
        valid: bool,
        history_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=R),
    ):
        """Eight lanes, q = 0 to 7, compute element e, whose rotation W stands where its forces will."""
        a = q ^ ((q >> 1) & 1)  # corners run around the faces
        eps_p, p = read_plastic_strain(history_out, q, e)
        x = load_node(pool, 0, patches, e, a)
        d = load_node(pool, wp.static(SLOTS), patches, e, a)
        W = mat33()
        for k in range(9):
            W[k // 3, k % 3] = force_out[k * wp.static(PATCH) + thread]
        warp_barrier()
        local = d + wp.transpose(W) * (x + d)
        gx, gy, gz = to_point_lines(x, q)
        lx, ly, lz = to_point_lines(local, q)
        b0 = wp.cross(gy, gz)
        b1 = wp.cross(gz, gx)
        b2 = wp.cross(gx, gy)
        det = wp.dot(gx, b0)
        xx, yy, zz, xy, yz, xz = symmetric_gradient(lx, ly, lz, b0, b1, b2)
        trace = xx + yy + zz
        pressure = R(scale) * law[m, 0] * lane_sum(trace) / lane_sum(det)
        shear = R(0.5) / det
        direct = shear + shear
        mean = R(_THIRD) * trace
        xx = direct * (xx - mean)
        yy = direct * (yy - mean)
        zz = direct * (zz - mean)
        xy = shear * xy
        yz = shear * yz
        xz = shear * xz
        strain = mat33(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        G = R(scale) * law[m, 1]
        S, eps_new, p_new = j2_return(strain, eps_p, p, G, R(scale) * law[m, 2], R(scale) * law[m, 3], law[m, 4])
        if valid and p_new > p:
            write_plastic_strain(history_out, q, e, eps_new, p_new)
        Fx = add_traction(S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[1, 2], S[0, 2], b0, pressure * b0)
        Fy = add_traction(S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[1, 2], S[0, 2], b1, pressure * b1)
        Fz = add_traction(S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[1, 2], S[0, 2], b2, pressure * b2)
        f = to_corner(Fx, Fy, Fz, q)
        f = f + W * f
        if valid:
            for i in range(3):
                force_out[(3 * a + i) * wp.static(PATCH) + thread] = f[i]

    # in float32, a few registers spilled cost less than a quarter of the threads
    bounds = (PATCH, 4) if precision == "mixed" else None

    @wp.kernel(
        enable_backward=False,
        module="unique",
        grid_stride=False,
        launch_bounds=bounds,
        module_options={"fast_math": True},
    )
    def hex8_patch_force(
        X: wp.array(dtype=wp.vec3d),
        patches: Patches,
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
    ):
        lane = wp.tid() % wp.static(PATCH)
        patch = wp.tid() // wp.static(PATCH)
        if wp.static(plastic):
            patch = patches.order[patch]
        start = patches.start[patch]
        forces = wp.array(ptr=force_pool(), shape=(24 * PATCH,), dtype=R)
        todo = wp.array(ptr=list_pool(), shape=(PATCH + 1,), dtype=wp.int32)
        if wp.static(plastic):
            if lane == 0:
                todo[0] = 0
        pool = wp.array(ptr=node_pool(), shape=(2 * SLOTS,), dtype=wp.vec3d)
        e = start + lane
        end = patches.start[patch + 1]
        corners = corners_of(patches, wp.min(e, end - 1))
        load_patch(X, u, patches, patch, lane, pool)
        barrier()
        if e < end:
            Xl = load_element(pool, 0, corners)
            ul = load_element(pool, wp.static(SLOTS), corners)
            W = element_rotation(Xl, ul)
            m = material[e]
            flows = bool(False)
            if wp.static(plastic):
                flows = yielded_out[e] != 0
            if not flows:
                ul = local_displacement(Xl, ul, W)
                f, largest = elastic_forces(Xl, ul, W, R(scale) * law[m, 0], R(scale) * law[m, 1])
                keep_forces(forces, lane, f)
                if wp.static(plastic):
                    if R(1.5) * largest > R(scale * scale) * law[m, 2] * law[m, 2]:
                        flows = bool(True)
                        yielded_out[e] = 1
            if wp.static(plastic):
                if flows:
                    todo[1 + wp.atomic_add(todo, 0, 1)] = lane
                    for k in range(9):
                        forces[k * wp.static(PATCH) + lane] = W[k // 3, k % 3]
        barrier()
        if wp.static(plastic):
            count = todo[0]
            if lane == 0:
                patches.flowing[patch] = count
            for turn in range((8 * count + wp.static(PATCH - 1)) // wp.static(PATCH)):
                item = (turn * wp.static(PATCH) + lane) // 8
                mine = todo[1 + wp.min(item, count - 1)]
                flow(
                    pool,
                    patches,
                    law,
                    start + mine,
                    material[start + mine],
                    mine,
                    lane % 8,
                    item < count,
                    history_out,
                    forces,
                )
        sum_patch(forces, patches, patch, lane, slot, force_out)

    return hex8_patch_force
