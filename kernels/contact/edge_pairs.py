"""Owns the geometry of two edges of skins that cross: where they are nearest, along which normal, and whether they may
press there."""

import warp as wp

SLOTS = 4  # springs of each edge of a slave: as many edges of the master as may press it at once
REACH = 0.5  # greatest depth, as a share of the size of the smaller faces beside the two edges

_PARALLEL = 1e-4  # square of the sine between edges that do not cross, at most
_OUTSIDE = 0.05  # sine by which the normal may lie outside those of the faces beside an edge; twice that once pressed
_SLACK = 1e-4  # growth of the depth in a step allowed beyond the motion, as a share of an edge
_BEGUN = 2e-3  # depth to which edges may lie in each other when their crossing begins, as a share of an edge
_MORE = 0.02  # depth by which a crossing that goes on between other edges may be deeper, as a share of an edge
_NEAR = 0.1  # distance along an edge from a crossing within which an end may meet a face, as a share of an edge
_CLEAR = 1e-3  # distance in front of a face at which such an end does not, as a share of an edge, at least
_AMID = 0.1  # of the sine between the faces beside an edge, by which a normal between them lies off either
_END, _MOST_END = 0.01, 0.5  # shares of an edge by which a crossing that presses may lie off its ends: shallow, deep


@wp.struct
class SkinEdges:
    """Edges of a surface that may press those of another.

    Attributes:
        node: both ends of each, shape (edge_count, 2), int32.
        beside: corners of the two faces that meet there, shape (edge_count, 8), int32.
        size: edge of a square face as large as those [m], shape (edge_count,), float64.
        stiffness: penalty stiffness of each [N/m], shape (edge_count,), float64.
        body: in a general contact, body of each edge of the master, and row of `factor` for each of the slave, shape
            (edge_count,), int32; else empty.
        factor: of the stiffness between two bodies, 0 where they do not meet; else empty.
    """

    node: wp.array2d(dtype=wp.int32)
    beside: wp.array2d(dtype=wp.int32)
    size: wp.array(dtype=wp.float64)
    stiffness: wp.array(dtype=wp.float64)
    body: wp.array(dtype=wp.int32)
    factor: wp.array(dtype=wp.float64)


@wp.struct
class Crossing:
    """Where an edge of the slave crosses one of the master.

    Attributes:
        touches: whether the edges press each other.
        within: whether they do so between their ends.
        amid: whether the normal is far from those of all faces beside both, so that none bears a node there.
        weight: share of each end of the slave's edge, then of the master's, in its point [-].
        normal: unit normal, out of the master.
        gap: between the points along the normal, negative where the bodies overlap [m].
        approach: motion along the normal towards each other in this step [m].
        du: motion of the slave's point relative to the master's in this step [m].
    """

    touches: wp.bool
    within: wp.bool
    amid: wp.bool
    weight: wp.vec4d
    normal: wp.vec3d
    gap: wp.float64
    approach: wp.float64
    du: wp.vec3d


@wp.func
def side_normal(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), edges: SkinEdges, e: int, first: int):
    """Unit normal of the face whose corners begin at `first` in `edges.beside`."""
    a = edges.beside[e, first]
    b = edges.beside[e, first + 1]
    c = edges.beside[e, first + 2]
    d = edges.beside[e, first + 3]
    return wp.normalize(wp.cross(X[c] - X[a] + u[c] - u[a], X[d] - X[b] + u[d] - u[b]))


@wp.func
def lies_between(first: wp.vec3d, second: wp.vec3d, normal: wp.vec3d, outside: wp.float64) -> bool:
    """Whether a normal across an edge lies between those of the faces beside it, or outside by this sine at most."""
    axis = wp.normalize(wp.cross(first, second))
    enters = wp.dot(wp.cross(first, normal), axis) >= -outside
    leaves = wp.dot(wp.cross(normal, second), axis) >= -outside
    return enters and leaves and wp.dot(normal, first + second) > wp.float64(0.0)


@wp.func
def lies_amid(first: wp.vec3d, second: wp.vec3d, normal: wp.vec3d) -> bool:
    """Whether a normal across an edge lies well between those of the faces beside it."""
    most = wp.length(wp.cross(first, second))
    return lies_between(first, second, normal, wp.float64(-_AMID) * most)


@wp.func
def crossing(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    slave: SkinEdges,
    master: SkinEdges,
    a: int,
    b: int,
    dt: wp.float64,
    pressed: bool,
) -> Crossing:
    """How edge a of the slave crosses edge b of the master: two convex wedges overlap along the normal of both edges.

    The normal of edges that press lies between the normals of the faces beside either of them: else an edge meets a
    face, or a neighbouring edge (S. Gottschalk, Collision queries using oriented bounding boxes, 2000; D. Gregorius,
    The separating axis test between convex polyhedra, GDC 2013). `pressed`: whether they did so in the last step. Then
    they may lie off their ends by their depth, since the wedges still overlap there, until another crossing goes on.
    """
    found = Crossing()
    i = slave.node[a, 0]
    j = slave.node[a, 1]
    p = master.node[b, 0]
    q = master.node[b, 1]
    along = X[j] - X[i] + u[j] - u[i]
    across = X[q] - X[p] + u[q] - u[p]
    apart = X[i] - X[p] + u[i] - u[p]
    aa = wp.dot(along, along)
    ab = wp.dot(along, across)
    bb = wp.dot(across, across)
    det = aa * bb - ab * ab
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    if det > wp.float64(_PARALLEL) * aa * bb:
        ra = wp.dot(along, apart)
        rb = wp.dot(across, apart)
        s = (ab * rb - bb * ra) / det
        t = (aa * rb - ab * ra) / det
        off = wp.max(wp.max(-s, s - one), wp.max(-t, t - one))
        if off <= zero or (pressed and off <= wp.float64(_MOST_END)):
            outside = wp.float64(wp.where(pressed, 2.0 * _OUTSIDE, _OUTSIDE))
            n = wp.normalize(wp.cross(along, across))
            own_first = side_normal(X, u, slave, a, 0)
            own_second = side_normal(X, u, slave, a, 4)
            first = side_normal(X, u, master, b, 0)
            second = side_normal(X, u, master, b, 4)
            if wp.dot(n, first + second - own_first - own_second) < zero:
                n = -n
            gap = wp.dot(n, apart + s * along - t * across)
            end = wp.float64(_END) - gap / wp.sqrt(wp.min(aa, bb))
            if gap < zero and off <= wp.max(end, zero) and lies_between(first, second, n, outside):
                if lies_between(own_first, own_second, -n, outside):
                    found.touches = bool(True)
                    found.within = off <= zero
                    found.amid = lies_amid(first, second, n) and lies_amid(own_first, own_second, -n)
                    found.weight = wp.vec4d(one - s, s, one - t, t)
                    found.normal = n
                    found.gap = gap
                    found.du = dt * ((one - s) * v[i] + s * v[j] - (one - t) * v[p] - t * v[q])
                    found.approach = -wp.dot(found.du, n)
    return found


@wp.func
def goes_on(depth: wp.float64, held: wp.float64, moved: wp.float64, size: wp.float64) -> bool:
    """Whether edges can have come to this depth in a step from the depth `held` of a crossing that goes on here."""
    return depth <= held + wp.float64(_MORE) * size + wp.float64(2.0) * wp.abs(moved)


@wp.func
def resting_depth(depth: wp.float64, approach: wp.float64, size: wp.float64) -> wp.float64:
    """Depth at which a new crossing is free of force [m]: 0, more if edges are deeper than they move in a step, or -1.

    So are edges of which a node met a face until now. Deeper ones do not begin: they are far sides of thin bodies.
    """
    rest = wp.float64(0.0)
    if depth > wp.float64(2.0) * wp.abs(approach) + wp.float64(_SLACK) * size:
        rest = wp.where(depth < wp.float64(_BEGUN) * size, depth - wp.max(approach, rest), wp.float64(-1.0))
    return rest


@wp.func
def lies_clear(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    edges: SkinEdges,
    e: int,
    others: SkinEdges,
    o: int,
    place: wp.float64,
    size: wp.float64,
) -> bool:
    """Whether no end of edge e near a crossing, at the share `place` of the edge, lies behind both faces beside edge o.

    Such a node meets a face by itself.
    """
    first = side_normal(X, u, others, o, 0)
    second = side_normal(X, u, others, o, 4)
    at = others.node[o, 0]
    i = edges.node[e, 0]
    j = edges.node[e, 1]
    length = wp.length(X[j] - X[i] + u[j] - u[i])
    clear = bool(True)
    for end in range(2):
        way = wp.where(end == 0, place, wp.float64(1.0) - place) * length
        n = edges.node[e, end]
        away = X[n] - X[at] + u[n] - u[at]
        front = wp.max(wp.dot(away, first), wp.dot(away, second))
        if way < wp.float64(_NEAR) * size and front < wp.float64(_CLEAR) * size:
            clear = bool(False)
    return clear


@wp.func
def pair_factor(slave: SkinEdges, master: SkinEdges, a: int, b: int) -> wp.float64:
    """Factor of the stiffness between two edges; 0 if they do not meet: in a general contact each pair counts once."""
    factor = wp.float64(1.0)
    if slave.factor.shape[0] > 0:
        factor = slave.factor[slave.body[a] + master.body[b]]
        near = a >= b
        for c in range(8):
            for d in range(8):
                near = near or slave.beside[a, c] == master.beside[b, d]
        if near:
            factor = wp.float64(0.0)
    return factor


@wp.func
def share_an_end(edges: SkinEdges, a: int, b: int) -> bool:
    """Whether two edges of a surface meet at a node, or are one."""
    i = edges.node[a, 0]
    j = edges.node[a, 1]
    p = edges.node[b, 0]
    q = edges.node[b, 1]
    return i == p or i == q or j == p or j == q
