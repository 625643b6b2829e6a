"""Owns the forces of loads on nodes, which all loads of a kind give in one launch, and the work that they do."""

import warp as wp

from warp_mca.kernels.loads.amplitude import Tables, mean_of_step

wp.set_module_options({"enable_backward": False})

PRESSURE, FOLLOWS, DEAD = 0, 1, 2  # what a load on faces does with its traction


@wp.struct
class LoadedFaces:
    """Faces under loads, and the loads.

    Attributes:
        face: corners, of which triangles have the last one twice, shape (face_count,), vec4i.
        alone: corner of the triangle that is no node within an edge, of parts of a face of six nodes, else -1, shape
            (face_count,), int32.
        load: number of the load, shape (face_count,), int32.
        mode: PRESSURE, FOLLOWS or DEAD of each load, shape (load_count,), int32.
        traction: of each load [Pa], with the pressure along -z for PRESSURE, shape (load_count,), vec3d.
    """

    face: wp.array(dtype=wp.vec4i)
    alone: wp.array(dtype=wp.int32)
    load: wp.array(dtype=wp.int32)
    mode: wp.array(dtype=wp.int32)
    traction: wp.array(dtype=wp.vec3d)


@wp.func
def share_of_face(k: int, alone: int, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d):
    """Integrals over a bilinear face of N n and of N for its corner k [m^2], by 2 x 2 points, exact for the first.

    Of a part of a face of six nodes, nodes within edges take what the whole face gives them: a third of its area each,
    and its corners none.
    """
    one = wp.float64(1.0)
    quarter = wp.float64(0.25)
    vector = wp.vec3d()
    size = wp.float64(0.0)
    if alone >= 0:
        if k < 3 and k != alone:
            vector = quarter * wp.cross(b - a, c - a)
            size = wp.length(vector)
        return vector, size
    x_sign = wp.where(k == 1 or k == 2, one, -one)
    y_sign = wp.where(k > 1, one, -one)
    for j in range(4):
        xi = wp.float64(wp.static(3.0**-0.5)) * wp.float64(2 * (j % 2) - 1)
        eta = wp.float64(wp.static(3.0**-0.5)) * wp.float64(2 * (j // 2) - 1)
        along = quarter * ((one - eta) * (b - a) + (one + eta) * (c - d))
        across = quarter * ((one - xi) * (d - a) + (one + xi) * (c - b))
        normal = wp.cross(along, across)
        weight = quarter * (one + x_sign * xi) * (one + y_sign * eta)
        vector += weight * normal
        size += weight * wp.length(normal)
    return vector, size


@wp.func
def frame_of_face(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d):
    """Axes of a face as columns: along its middle from the edge a d to the edge b c, across, and its normal."""
    along = wp.normalize((b - a) + (c - d))
    normal = wp.normalize(wp.cross(along, (d - a) + (c - b)))
    return wp.matrix_from_cols(along, wp.cross(normal, along), normal)


@wp.func
def keep_work(
    k: int,
    force: wp.vec3d,
    v: wp.vec3d,
    dt: wp.float64,
    force_out: wp.array(dtype=wp.vec3d),
    work_out: wp.array(dtype=wp.float64),
    clock_out: wp.array(dtype=wp.int32),
):
    """Work of a force at a node up to t(n): between two steps that of the mean of both, (f(n-1) + f(n)) / 2 . dt v."""
    if clock_out[k] > 0:
        work_out[k] = work_out[k] + wp.float64(0.5) * dt * wp.dot(force_out[k] + force, v)
    force_out[k] = force
    clock_out[k] = clock_out[k] + 1


@wp.kernel(enable_backward=False)
def push_faces(
    node: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.int32),
    corner: wp.array(dtype=wp.int32),
    faces: LoadedFaces,
    tables: Tables,
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    start: bool,
    nodal_force_out: wp.array(dtype=wp.vec3d),
    force_out: wp.array(dtype=wp.vec3d),
    work_out: wp.array(dtype=wp.float64),
    clock_out: wp.array(dtype=wp.int32),
):
    """f_i = integral of N_i t over the faces around each node, with t = -p n for a pressure.

    `corner` lists 4 face + corner of each node's faces, from `first` on. Factors are means over the step, so that the
    kicks add up to their integrals.
    """
    k = wp.tid()
    i = node[k]
    total = wp.vec3d()
    for j in range(first[k], first[k + 1]):
        f = corner[j] // 4
        load = faces.load[f]
        mode = faces.mode[load]
        q = faces.face[f]
        x0 = X[q[0]]
        x1 = X[q[1]]
        x2 = X[q[2]]
        x3 = X[q[3]]
        y0 = x0
        y1 = x1
        y2 = x2
        y3 = x3
        if mode != wp.static(DEAD):
            y0 = x0 + u[q[0]]
            y1 = x1 + u[q[1]]
            y2 = x2 + u[q[2]]
            y3 = x3 + u[q[3]]
        vector, size = share_of_face(corner[j] % 4, faces.alone[f], y0, y1, y2, y3)
        force = size * faces.traction[load]
        if mode == wp.static(PRESSURE):
            force = faces.traction[load][2] * vector
        if mode == wp.static(FOLLOWS):
            turn = frame_of_face(y0, y1, y2, y3) * wp.transpose(frame_of_face(x0, x1, x2, x3))
            force = turn * force
        total += mean_of_step(tables, load, clock_out[k], dt, start) * force
    nodal_force_out[i] = nodal_force_out[i] + total
    if not start:
        keep_work(k, total, v[i], dt, force_out, work_out, clock_out)


@wp.kernel(enable_backward=False)
def push_nodes(
    node: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.int32),
    load: wp.array(dtype=wp.int32),
    share: wp.array(dtype=wp.float64),
    vector: wp.array(dtype=wp.vec3d),
    tables: Tables,
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    start: bool,
    nodal_force_out: wp.array(dtype=wp.vec3d),
    force_out: wp.array(dtype=wp.vec3d),
    work_out: wp.array(dtype=wp.float64),
    clock_out: wp.array(dtype=wp.int32),
):
    """f_i = sum of share times vector times factor of the loads on each node, which are listed from `first` on."""
    k = wp.tid()
    i = node[k]
    total = wp.vec3d()
    for j in range(first[k], first[k + 1]):
        total += share[j] * mean_of_step(tables, load[j], clock_out[k], dt, start) * vector[load[j]]
    nodal_force_out[i] = nodal_force_out[i] + total
    if not start:
        keep_work(k, total, v[i], dt, force_out, work_out, clock_out)
