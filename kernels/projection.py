"""Owns the closest point of a bilinear face."""

import warp as wp

wp.set_module_options({"enable_backward": False})


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
def triangle_weights(x: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.vec4d:
    """Area coordinates of the point of the (extended) triangle nearest to x; the last is 0."""
    ab = b - a
    ac = c - a
    ax = x - a
    d00 = wp.dot(ab, ab)
    d01 = wp.dot(ab, ac)
    d11 = wp.dot(ac, ac)
    d20 = wp.dot(ax, ab)
    d21 = wp.dot(ax, ac)
    inverse = wp.float64(1.0) / (d00 * d11 - d01 * d01)
    s = inverse * (d11 * d20 - d01 * d21)
    t = inverse * (d00 * d21 - d01 * d20)
    return wp.vec4d(wp.float64(1.0) - s - t, s, t, wp.float64(0.0))


@wp.func
def interpolate(w: wp.vec4d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d) -> wp.vec3d:
    """Value at weights w of a field given at the four corners."""
    return w[0] * a + w[1] * b + w[2] * c + w[3] * d


@wp.func
def face_tangents(xi: wp.float64, eta: wp.float64, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d):
    """Derivatives of the position along xi and eta."""
    one = wp.float64(1.0)
    q = wp.float64(0.25)
    along_xi = q * ((one - eta) * (b - a) + (one + eta) * (c - d))
    along_eta = q * ((one - xi) * (d - a) + (one + xi) * (c - b))
    return along_xi, along_eta


@wp.func
def closest_point(x: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d) -> wp.vec2d:
    """Natural coordinates of the point of the (extended) face nearest to x, by Newton's method.

    At most six iterations: it is quadratic, and exact in one on a parallelogram. Iterates stay within [-2, 2].
    """
    xi = wp.float64(0.0)
    eta = wp.float64(0.0)
    twist = wp.float64(0.25) * (a - b + c - d)
    for _ in range(6):
        along_xi, along_eta = face_tangents(xi, eta, a, b, c, d)
        r = x - interpolate(shape(xi, eta), a, b, c, d)
        g0 = wp.dot(r, along_xi)
        g1 = wp.dot(r, along_eta)
        h00 = wp.dot(along_xi, along_xi)
        h11 = wp.dot(along_eta, along_eta)
        h01 = wp.dot(along_xi, along_eta) - wp.dot(r, twist)
        det = h00 * h11 - h01 * h01
        if det <= wp.float64(0.0):  # far from the face the curvature term can spoil the matrix: leave it out
            h01 = wp.dot(along_xi, along_eta)
            det = h00 * h11 - h01 * h01
        two = wp.float64(2.0)
        inverse = wp.float64(1.0) / det
        xi_new = wp.clamp(xi + inverse * (h11 * g0 - h01 * g1), -two, two)
        eta_new = wp.clamp(eta + inverse * (h00 * g1 - h01 * g0), -two, two)
        moved = wp.abs(xi_new - xi) + wp.abs(eta_new - eta)
        xi = xi_new
        eta = eta_new
        if moved < wp.float64(1e-9):  # the next step would be its square
            break
    return wp.vec2d(xi, eta)


@wp.func
def project(x: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d, triangle: bool, reach: wp.float64):
    """Nearest point of a face: whether it lies within `reach` of its half size, weights, a quarter of its area vector.

    A triangle has its last corner twice; coordinates that run along its edges then have no inverse there.
    """
    if triangle:
        w = triangle_weights(x, a, b, c)
        least = wp.min(w[0], wp.min(w[1], w[2]))
        inside = least >= wp.float64(0.5) * (wp.float64(1.0) - reach)
        return inside, w, wp.float64(0.125) * wp.cross(b - a, c - a)
    at = closest_point(x, a, b, c, d)
    along_xi, along_eta = face_tangents(at[0], at[1], a, b, c, d)
    inside = wp.abs(at[0]) <= reach and wp.abs(at[1]) <= reach
    return inside, shape(at[0], at[1]), wp.cross(along_xi, along_eta)
