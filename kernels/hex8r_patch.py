"""Owns the force kernel of `hex8r` on a GPU, at small strain: one thread for each element of a patch."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hex8r import element_functions
from warp_mca.kernels.patch import (
    Patches,
    barrier,
    corners_of,
    load_functions,
    load_patch,
    node_pool,
    shared_functions,
    sum_functions,
)
from warp_mca.kernels.patterns import pattern_functions
from warp_mca.kernels.scalars import scalars
from warp_mca.patches import PATCH, SLOTS

wp.set_module_options({"enable_backward": False})


@cache
def force_kernel(precision: str, plastic: bool) -> Any:
    """Kernel: forces of each patch on its nodes, and the plastic history where `plastic`."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    force_pool, _ = shared_functions(precision)
    load_element, _ = load_functions(precision)
    keep_forces, sum_patch = sum_functions(precision)
    to_patterns, _ = pattern_functions(precision)
    shape_and_strain, stress_and_flow, corner_forces = element_functions(precision, plastic, False)

    bounds = (PATCH, 4 if plastic else 5) if precision == "mixed" else None

    @wp.kernel(
        enable_backward=False,
        module="unique",
        grid_stride=False,
        launch_bounds=bounds,
        module_options={"fast_math": True},
    )
    def hex8r_patch_force(
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
        forces = wp.array(ptr=force_pool(), shape=(24 * PATCH,), dtype=R)
        pool = wp.array(ptr=node_pool(), shape=(2 * SLOTS,), dtype=wp.vec3d)
        e = patches.start[patch] + lane
        end = patches.start[patch + 1]
        corners = corners_of(patches, wp.min(e, end - 1))
        load_patch(X, u, patches, patch, lane, pool)
        barrier()
        if e < end:
            x = to_patterns(load_element(pool, 0, corners))
            du = to_patterns(load_element(pool, wp.static(SLOTS), corners))
            b, volume, W, H, q = shape_and_strain(x, du)
            P, Q = stress_and_flow(x, volume, H, q, e, material[e], law, yielded_out, history_out)
            keep_forces(forces, lane, corner_forces(x, b, volume, W, P, Q))
        sum_patch(forces, patches, patch, lane, slot, force_out)

    return hex8r_patch_force
