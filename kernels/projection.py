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
        xi_new = wp.clamp(xi + (h11 * g0 - h01 * g1) / det, -two, two)
        eta_new = wp.clamp(eta + (h00 * g1 - h01 * g0) / det, -two, two)
        moved = wp.abs(xi_new - xi) + wp.abs(eta_new - eta)
        xi = xi_new
        eta = eta_new
        if moved < wp.float64(1e-9):  # the next step would be its square
            break
    return wp.vec2d(xi, eta)
