"""Owns where edges of one closed skin cross the faces of another, or other faces of its own."""

import warp as wp

MOST = 32  # faces through which an edge is followed at most
AHEAD = 1.0e-5  # distance behind a face at which the next ray starts, as a share of the edge's length


@wp.kernel(enable_backward=False)
def add_normals(
    point: wp.array(dtype=wp.vec3f), triangle: wp.array2d(dtype=wp.int32), normal_out: wp.array(dtype=wp.vec3f)
):
    """Add the normal of each triangle, whose length is twice its area, to its nodes."""
    k = wp.tid()
    a = point[triangle[k, 0]]
    normal = wp.cross(point[triangle[k, 1]] - a, point[triangle[k, 2]] - a)
    for corner in range(3):
        wp.atomic_add(normal_out, triangle[k, corner], normal)


@wp.kernel(enable_backward=False)
def move_inside(
    point: wp.array(dtype=wp.vec3f),
    normal: wp.array(dtype=wp.vec3f),
    distance: wp.array(dtype=wp.float32),
    inner_out: wp.array(dtype=wp.vec3f),
):
    """Nodes of a skin, moved into its body by a small distance: skins that only touch do not cross then."""
    i = wp.tid()
    inner_out[i] = point[i] - distance[i] * wp.normalize(normal[i])


@wp.kernel(enable_backward=False)
def ray_lengths(
    mesh: wp.uint64, start: wp.array(dtype=wp.vec3f), direction: wp.array(dtype=wp.vec3f), reach: float,
    length_out: wp.array(dtype=wp.float32),
):  # fmt: skip
    """Distance from each point to the first face in a direction [m], `reach` where there is none."""
    i = wp.tid()
    hit = wp.mesh_query_ray(mesh, start[i], direction[i], reach)
    length_out[i] = wp.where(hit.result, hit.t, reach)


@wp.func
def shares_node(triangle: wp.array2d(dtype=wp.int32), face: int, a: int, b: int) -> bool:
    """Whether a triangle has one of two nodes."""
    found = bool(False)
    for corner in range(3):
        found = found or triangle[face, corner] == a or triangle[face, corner] == b
    return found


@wp.func
def part_inside(entered: float, slope: float, t: float, cosine: float):
    """Depth of a part of an edge behind the planes of the faces at its ends [m], and where along the edge [m].

    Args:
        entered: length along the edge at which it went in [m]; negative if its first end lies inside.
        slope: cosine between the edge and the normal there.
        t: length along the edge at which it comes out [m]; `cosine` is that of the face there.
    """
    if entered < 0.0:
        return t * cosine, float(0.0)
    return 0.5 * (t - entered) * wp.min(slope, cosine), 0.5 * (t + entered)


@wp.kernel(enable_backward=False)
def edges_inside(
    mesh: wp.uint64,
    inner: wp.array(dtype=wp.vec3f),
    edge: wp.array2d(dtype=wp.int32),
    triangle: wp.array2d(dtype=wp.int32),
    depth_out: wp.array(dtype=wp.float32),
    at_out: wp.array(dtype=wp.vec3f),
):
    """Greatest depth of each edge behind faces of a mesh that it crosses [m] (0 if it crosses none), and its place.

    The depth of a part between two faces is that of its middle; the depth of a part that holds an end of the edge is
    that of the end. Distances are measured to the planes of the faces, which bounds the depth below the mesh from
    above. If the edges belong to the mesh itself, `triangle` has its faces, and those around the edge's nodes are
    skipped; otherwise it is empty.
    """
    k = wp.tid()
    i = edge[k, 0]
    j = edge[k, 1]
    a = inner[i]
    length = wp.length(inner[j] - a)
    along = wp.normalize(inner[j] - a)
    start = float(0.0)
    entered = float(-1.0)
    slope = float(0.0)
    outside = bool(False)  # known to be outside, because it came out
    depth = float(0.0)
    at = float(0.0)
    for _query in range(MOST):
        hit = wp.mesh_query_ray(mesh, a + start * along, along, length - start)
        if not hit.result:
            break
        t = start + hit.t
        start = t + AHEAD * length
        counts = bool(True)
        if triangle.shape[0] > 0:
            counts = not shares_node(triangle, hit.face, i, j)
        cosine = wp.dot(hit.normal, along)
        if counts and cosine < 0.0:
            entered = t
            slope = -cosine
        if counts and cosine >= 0.0:
            part, middle = part_inside(entered, slope, t, cosine)
            if part > depth and (entered >= 0.0 or not outside):
                depth = part
                at = middle
            entered = float(-1.0)
            outside = True
        if start >= length:
            break
    if entered >= 0.0 and (length - entered) * slope > depth:
        depth = (length - entered) * slope
        at = length
    depth_out[k] = depth
    at_out[k] = a + at * along
