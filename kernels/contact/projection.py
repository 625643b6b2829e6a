"""Owns the geometry of bilinear faces: the closest point, the area, and how two of them meet."""

import warp as wp

# Faces reach this far beyond their edges: a node that leaves a face of a dented surface may project beside both.
EDGE_REACH = 1.02


@wp.func
def shape(xi: wp.float64, eta: wp.float64) -> wp.vec4d:
    """Bilinear shape functions at (xi, eta) in [-1, 1]^2."""
    one = wp.float64(1.0)
    q = wp.float64(0.25)
    return wp.vec4d(
        q * (one - xi) * (one - eta),
        q * (one + xi) * (one - eta),
        q * (one + xi) * (one + eta),
        q * (one - xi) * (one + eta),
    )


@wp.func
def weights_at(at: wp.vec2d, triangle: bool) -> wp.vec4d:
    """Shape functions of the corners at natural coordinates of a face; those of a triangle end with 0."""
    if triangle:
        return wp.vec4d(wp.float64(1.0) - at[0] - at[1], at[0], at[1], wp.float64(0.0))
    return shape(at[0], at[1])


@wp.func
def triangle_coordinates(ax: wp.vec3d, ab: wp.vec3d, ac: wp.vec3d) -> wp.vec2d:
    """Second and third area coordinate of the point of the (extended) triangle nearest to the point at `ax` from a."""
    d00 = wp.dot(ab, ab)
    d01 = wp.dot(ab, ac)
    d11 = wp.dot(ac, ac)
    d20 = wp.dot(ax, ab)
    d21 = wp.dot(ax, ac)
    inverse = wp.float64(1.0) / (d00 * d11 - d01 * d01)
    return wp.vec2d(inverse * (d11 * d20 - d01 * d21), inverse * (d00 * d21 - d01 * d20))


@wp.func
def interpolate(w: wp.vec4d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d) -> wp.vec3d:
    """Value at weights w of a field given at the four corners."""
    return w[0] * a + w[1] * b + w[2] * c + w[3] * d


@wp.func
def bilinear(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d):
    """Vectors m, e, f, t of the face m + xi e + eta f + xi eta t with these corners."""
    q = wp.float64(0.25)
    ac = a + c
    bd = b + d
    across = c - a
    other = b - d
    return q * (ac + bd), q * (across + other), q * (across - other), q * (ac - bd)


@wp.func
def closest_point(r0: wp.vec3d, e: wp.vec3d, f: wp.vec3d, t: wp.vec3d) -> wp.vec2d:
    """Natural coordinates of the point of the (extended) face nearest to the point at r0 from its middle.

    Newton's method, at most six iterations: it is quadratic, and exact in one on a parallelogram. Iterates stay within
    [-2, 2]. `e`, `f`, `t` are as `bilinear` has them.
    """
    xi = wp.float64(0.0)
    eta = wp.float64(0.0)
    for _ in range(6):
        along_xi = e + eta * t
        along_eta = f + xi * t
        r = r0 - xi * e - eta * along_eta
        g0 = wp.dot(r, along_xi)
        g1 = wp.dot(r, along_eta)
        h00 = wp.dot(along_xi, along_xi)
        h11 = wp.dot(along_eta, along_eta)
        flat = wp.dot(along_xi, along_eta)
        h01 = flat - wp.dot(r, t)
        det = h00 * h11 - h01 * h01
        if det <= wp.float64(0.0):  # far from the face the curvature term can spoil the matrix: leave it out
            h01 = flat
            det = h00 * h11 - h01 * h01
        two = wp.float64(2.0)
        inverse = wp.float64(1.0) / det
        xi_new = wp.clamp(xi + inverse * (h11 * g0 - h01 * g1), -two, two)
        eta_new = wp.clamp(eta + inverse * (h00 * g1 - h01 * g0), -two, two)
        moved = wp.abs(xi_new - xi) + wp.abs(eta_new - eta)
        xi = xi_new
        eta = eta_new
        if moved < wp.float64(1e-7):  # convergence is quadratic: the next step would be its square
            break
    return wp.vec2d(xi, eta)


@wp.func
def project(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d, triangle: bool):
    """The nearest point of a face to the origin of its corners' coordinates.

    Returns whether it lies within EDGE_REACH of the face's half size, its coordinates as `weights_at` takes them, the
    vector from it to the origin, and a quarter of the face's area vector. A triangle has its last corner twice;
    coordinates that run along its edges then have no inverse there.
    """
    reach = wp.float64(EDGE_REACH)
    if triangle:
        ab = b - a
        ac = c - a
        at = triangle_coordinates(-a, ab, ac)
        least = wp.min(at[0], wp.min(at[1], wp.float64(1.0) - at[0] - at[1]))
        inside = least >= wp.float64(0.5) * (wp.float64(1.0) - reach)
        return inside, at, -a - at[0] * ab - at[1] * ac, wp.float64(0.125) * wp.cross(ab, ac)
    m, e, f, t = bilinear(a, b, c, d)
    at = closest_point(-m, e, f, t)
    inside = wp.abs(at[0]) <= reach and wp.abs(at[1]) <= reach
    along_xi = e + at[1] * t
    along_eta = f + at[0] * t
    return inside, at, -m - at[0] * e - at[1] * along_eta, wp.cross(along_xi, along_eta)


@wp.func
def project_on_face(
    X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), face: wp.array2d(dtype=wp.int32), f: int, x: wp.vec3d
):
    """`project` of the point x on face f of nodes at X + u, and whether that is a triangle.

    Coordinates relative to the point keep the digits that a gap needs.
    """
    i0 = face[f, 0]
    i1 = face[f, 1]
    i2 = face[f, 2]
    i3 = face[f, 3]
    p0 = X[i0] + u[i0] - x
    p1 = X[i1] + u[i1] - x
    p2 = X[i2] + u[i2] - x
    p3 = X[i3] + u[i3] - x
    inside, at, away, area_normal = project(p0, p1, p2, p3, i2 == i3)
    return inside, at, away, area_normal, i2 == i3


@wp.func
def middle(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), face: wp.array2d(dtype=wp.int32), f: int):
    """Mean of the corners of face f [m]."""
    total = wp.vec3d()
    for c in range(4):
        total += X[face[f, c]] + u[face[f, c]]
    return wp.float64(0.25) * total


@wp.func
def area_vector(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), face: wp.array2d(dtype=wp.int32), f: int):
    """Vector along the normal of face f at its middle, whose length is twice the area of the face [m^2]."""
    across = X[face[f, 2]] + u[face[f, 2]] - X[face[f, 0]] - u[face[f, 0]]
    return wp.cross(across, X[face[f, 3]] + u[face[f, 3]] - X[face[f, 1]] - u[face[f, 1]])


@wp.func
def lies_below(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    f: int,
    g: int,
    normal: wp.vec3d,
) -> bool:
    """Whether the middle of face f is behind face g, whose normal is `normal`: no fold where a node is near both."""
    return wp.dot(middle(X, u, face, f) - middle(X, u, face, g), normal) < wp.float64(0.0)


@wp.func
def is_edge(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    f: int,
    g: int,
    normal: wp.vec3d,
) -> bool:
    """Whether faces f and g share a node and meet at the edge of a solid, not in a fold; `normal` is that of g."""
    shared = bool(False)
    for a in range(4):
        for b in range(4):
            if face[f, a] == face[g, b]:
                shared = bool(True)
    return shared and lies_below(X, u, face, f, g, normal)


@wp.func
def distance_to_face(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    f: int,
    x: wp.vec3d,
    at: wp.vec2d,
    triangle: bool,
) -> wp.float64:
    """Distance of a point to a face, whose natural coordinates `at` of the foot may lie beyond its edges [m]."""
    one = wp.float64(1.0)
    on = wp.vec2d(wp.clamp(at[0], -one, one), wp.clamp(at[1], -one, one))
    if triangle:
        on = wp.vec2d(wp.max(at[0], wp.float64(0.0)), wp.max(at[1], wp.float64(0.0)))
        on = on / wp.max(on[0] + on[1], one)
    foot = interpolate(
        weights_at(on, triangle),
        X[face[f, 0]] + u[face[f, 0]] - x,
        X[face[f, 1]] + u[face[f, 1]] - x,
        X[face[f, 2]] + u[face[f, 2]] - x,
        X[face[f, 3]] + u[face[f, 3]] - x,
    )
    return wp.length(foot)
