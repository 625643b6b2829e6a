"""Owns what a node meets below a fold of a master: the edge between two faces, beside both of which it lies."""

import warp as wp

from warp_mca.kernels.contact.nearest import Master, Nearest
from warp_mca.kernels.contact.projection import coordinates_at, nearest_point

_ROUND_OFF = 1e-12  # of shape functions


@wp.func
def place(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), i: int) -> wp.vec3d:
    """Where node i is [m]."""
    return X[i] + u[i]


@wp.func
def shared_weights(face: wp.array2d(dtype=wp.int32), f: int, g: int, weight: wp.vec4d):
    """Shape functions of face f at the point of face g where those of g are `weight`; whether f has this point."""
    own = wp.vec4d()
    other = wp.vec4i(face[g, 0], face[g, 1], face[g, 2], face[g, 3])
    for b in range(4):
        i = face[f, b]
        for a in range(4):
            if i == other[a]:
                own[b] += weight[a]
    if face[f, 2] == face[f, 3]:
        own[3] = wp.float64(0.0)
    return own, own[0] + own[1] + own[2] + own[3] > wp.float64(1.0) - wp.float64(_ROUND_OFF)


@wp.func
def edge_normal(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    f: int,
    weight: wp.vec4d,
):
    """Unit normal of face f at a point of its edges, where its shape functions are `weight`."""
    corners = wp.where(face[f, 2] == face[f, 3], 3, 4)
    normal = wp.vec3d()
    for b in range(4):
        if weight[b] > wp.float64(0.0):
            p = place(X, u, face[f, b])
            ahead = place(X, u, face[f, (b + 1) % corners]) - p
            behind = place(X, u, face[f, (b + corners - 1) % corners]) - p
            normal += weight[b] * wp.cross(ahead, behind)
    return wp.normalize(normal)


@wp.func
def on_fold(
    X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), master: Master, s: int, x: wp.vec3d, near: Nearest
) -> Nearest:
    """What the node of spring s meets: of the nearest face, the edge where the node lies below a fold.

    Such a node lies beside both faces, and the edge between them is nearer than either. Its force points to that edge,
    so that it turns from one normal to the other as the node moves across. A force that jumps between them makes energy
    where the jumps are in step with the vibration of the node.
    """
    if near.beside:
        weight, foot = nearest_point(X, u, master.face, near.face, x, near.at)
        depth = wp.length(foot)
        normal = foot / depth
        cosine = wp.dot(normal, near.normal)
        folds = bool(False)
        for c in range(master.count[s]):
            f = master.candidate[s, c]
            its_weight, shared = shared_weights(master.face, f, near.face, weight)
            if shared and f != near.face:
                other = edge_normal(X, u, master.face, f, its_weight)
                below = wp.dot(normal, other)
                between = wp.min(cosine, below) >= wp.dot(near.normal, other)
                folds = folds or (below > wp.float64(0.0) and between)
        if folds:
            near.at = coordinates_at(weight, master.face[near.face, 2] == master.face[near.face, 3])
            near.gap = -depth
            near.normal = normal
    return near
