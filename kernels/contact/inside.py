"""Owns how deep points lie inside a closed surface."""

import warp as wp


@wp.kernel(enable_backward=False)
def depths_inside(
    mesh: wp.uint64, point: wp.array(dtype=wp.vec3f), reach: float, depth_out: wp.array(dtype=wp.float32)
):
    """Depth of each point below the surface [m]: negative outside, and `reach` at most."""
    i = wp.tid()
    found = wp.mesh_query_point_sign_winding_number(mesh, point[i], reach)
    at = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
    depth_out[i] = wp.where(found.result, -found.sign * wp.length(point[i] - at), -reach)
