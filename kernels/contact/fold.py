"""Owns what a node meets below a fold of a master: the edge between two faces, beside both of which it lies."""

import warp as wp

from warp_mca.kernels.contact.nearest import Master, Nearest
from warp_mca.kernels.contact.projection import edge_beyond, nearest_on_edge, place

AROUND = 8  # faces around a node that are looked at


@wp.func
def corner_of(face: wp.array2d(dtype=wp.int32), f: int, i: int) -> int:
    """Which corner of face f is node i."""
    return wp.where(face[f, 0] == i, 0, wp.where(face[f, 1] == i, 1, wp.where(face[f, 2] == i, 2, 3)))


@wp.func
def normal_at_edge(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    f: int,
    c: int,
    share: wp.float64,
    point: wp.vec3d,
):
    """Vector along the normal of face f at a point of its edge to corner c, that share of the way back [m^2]."""
    corners = wp.where(face[f, 2] == face[f, 3], 3, 4)
    ahead = place(X, u, face[f, (c + 1) % corners])
    before = place(X, u, face[f, (c + corners - 1) % corners])
    beyond = place(X, u, face[f, (c + corners - 2) % corners])
    inward = (wp.float64(1.0) - share) * (ahead - point) + share * (beyond - point)
    return wp.cross(inward, before - place(X, u, face[f, c]))


@wp.func
def coordinates_on_edge(k: int, share: wp.float64, triangle: bool) -> wp.vec2d:
    """Natural coordinates of a point of the edge from corner k, that share of the way."""
    one = wp.float64(1.0)
    if triangle:
        ahead = wp.where(k == 0, share, wp.where(k == 1, one - share, wp.float64(0.0)))
        return wp.vec2d(ahead, wp.where(k == 0, wp.float64(0.0), wp.where(k == 1, share, one - share)))
    along = wp.where(k < 2, one, -one) * (share + share - one)
    across = wp.where(k == 1 or k == 2, one, -one)
    return wp.where(k % 2 == 0, wp.vec2d(along, across), wp.vec2d(across, along))


@wp.func
def on_fold(
    X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), master: Master, x: wp.vec3d, near: Nearest
) -> Nearest:
    """What a node at x meets: of the nearest face, the edge where the node lies below a fold.

    Such a node lies beside both faces, and the edge between them is nearer than either. Its force points to that edge,
    so that it turns from one normal to the other as the node moves across. A force that jumps between them makes energy
    where the jumps are in step with the vibration of the node.
    """
    if near.beside:
        f = near.face
        triangle = master.face[f, 2] == master.face[f, 3]
        k = edge_beyond(near.at, triangle)
        share, foot = nearest_on_edge(X, u, master.face, f, k, x)
        if share == wp.float64(1.0):  # the end of an edge is the start of the next
            k = wp.where(k == 3 or (triangle and k == 2), 0, k + 1)
            share = wp.float64(0.0)
        i = master.face[f, k]
        square, turned = wp.length_sq(foot), wp.dot(foot, near.normal)
        g = int(f)
        edge = int(k)
        folds = bool(False)
        most = wp.where(share > wp.float64(0.0), 1, AROUND)  # the face beyond the edge, or all around a corner
        for _ in range(most):
            g = master.across[g, edge]
            if folds or g < 0 or g == f:
                break
            edge = corner_of(master.face, g, i)
            normal = normal_at_edge(X, u, master.face, g, edge, share, x + foot)
            below, least = wp.dot(foot, normal), wp.dot(near.normal, normal)
            between = wp.min(below * below, turned * turned * wp.length_sq(normal)) >= square * least * least
            folds = below > wp.float64(0.0) and (least < wp.float64(0.0) or between)
        if folds:
            depth = wp.sqrt(square)
            near.at = coordinates_on_edge(k, share, triangle)
            near.gap = -depth
            near.normal = (wp.float64(1.0) / depth) * foot
    return near
