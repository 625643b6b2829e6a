"""Owns the strain of `hex8i` within an element: hourglass gradients and three internal vectors.

With natural coordinates xi_k, rows n_k of the inverse Jacobian at the centroid and hourglass amplitudes q, the
displacement gradient is

    H(xi) = H + sum_k xi_k (G_k + a_k n_k) + (terms of the products of two coordinates),

where H is the mean over the element, so that the patch test holds (Flanagan and Belytschko, Int. J. Numer. Meth.
Engng 17 (1981) 679), G_k comes from the amplitudes, and the vectors a_k are those of Wilson's incompatible modes
(Taylor, Beresford and Wilson, Int. J. Numer. Meth. Engng 10 (1976) 1211). Of the pattern xi eta zeta only the normal
strains along the natural axes are taken, without change of volume, because its shear would lock.

The vectors make the moments of traction sum xi_k sigma n_k vanish. All points share the frame of the centroid, so that
each vector has an equation of its own, with the acoustic tensor A_k = (lambda + G) n_k n_k + G |n_k|^2 I.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars

wp.set_module_options({"enable_backward": False})

PLANE = 3.0**-0.5  # of the points along the first two natural coordinates, +-
FOUR_THIRDS = 4.0 / 3.0
LEAST = 1e-37  # modulus above zero [Pa], where a smaller one is none in float32


def layers(points: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Natural coordinates of an element's points in the third direction, and their weights, 1 in sum over all points.

    Eight points are those of Gauss, two in each direction; more are those of Gauss in each half, where the stress has a
    corner if plastic zones grow from both faces; of these the outermost come last. Each layer has four points.
    """
    count = points // 4
    if count == 2:
        return (-PLANE, PLANE), (0.125, 0.125)
    at, weight = np.polynomial.legendre.leggauss(count // 2)
    return (
        tuple(np.concatenate([-(at + 1.0) / 2.0, (at + 1.0) / 2.0]).tolist()),
        tuple(np.tile(weight / 16.0, 2).tolist()),
    )


@cache
def place_functions(precision: str, points: int) -> tuple[Any, Any]:
    """Functions: column of points, 0 to 3 -> its first two natural coordinates; layer -> the third one, weight.

    Point number k of a column c is point c points / 4 + k of the element.
    """
    R, count = scalars(precision).real, points // 4
    row = wp.types.vector(count, R)
    at, weight = (row(*values) for values in layers(points))

    @wp.func
    def column_place(column: int):
        return R(PLANE) * R(2 * (column & 1) - 1), R(PLANE) * R(2 * (column >> 1) - 1)

    @wp.func
    def layer_place(k: int):
        zetas = wp.static(at)
        weights = wp.static(weight)
        return zetas[k], weights[k]

    return column_place, layer_place


@dataclass(frozen=True)
class Modes:
    """Functions of the natural frame of an element; y has n_k / 8 in row k, amplitudes are 8 q, see `patterns`.

    A symmetric tensor is a vector xx, yy, zz, xy, yz, xz, called D where it is twice a strain.

    Attributes:
        frame: patterns of positions -> y.
        twice: (a, b) -> a b + b a.
        doubled_gradient: H -> H + H^T as a symmetric tensor.
        gradients: (q, y) -> G_0, G_1, G_2, the parts of the gradient that are linear in a natural coordinate.
        doubled: (q, y) -> G_k + G_k^T, k = 0 to 2, as symmetric tensors.
        normals: (q, x) -> amounts z of normal strain z_k n_k n_k along the natural axes.
        normal: y_k -> deviator of y_k y_k.
        deviator: D -> its deviator.
        whole: (S, pressure) -> the matrix S + pressure I.
        invariant: S -> S : S / 2 of a traceless S.
        product: (symmetric tensor, vector) -> vector.
        solve: (t, y_k, K, G) -> A_k^-1 t.
    """

    frame: Any
    twice: Any
    doubled_gradient: Any
    gradients: Any
    doubled: Any
    normals: Any
    normal: Any
    deviator: Any
    whole: Any
    invariant: Any
    product: Any
    solve: Any


@cache
def mode_functions(precision: str) -> Modes:
    """The functions in the scalars of `precision`."""
    t = scalars(precision)
    R, vec3, mat33, mat43, mat73 = t.real, t.vec3, t.mat33, t.mat43, t.mat73
    tensor = wp.types.vector(6, R)

    @wp.func
    def frame(x: mat73):
        c0 = wp.cross(x[1], x[2])
        c1 = wp.cross(x[2], x[0])
        c2 = wp.cross(x[0], x[1])
        inverse = R(1.0) / wp.dot(x[0], c0)
        y = mat33()
        y[0] = inverse * c0
        y[1] = inverse * c1
        y[2] = inverse * c2
        return y

    @wp.func
    def twice(a: vec3, b: vec3):
        return tensor(
            R(2.0) * a[0] * b[0],
            R(2.0) * a[1] * b[1],
            R(2.0) * a[2] * b[2],
            a[0] * b[1] + a[1] * b[0],
            a[1] * b[2] + a[2] * b[1],
            a[0] * b[2] + a[2] * b[0],
        )

    @wp.func
    def gradients(q: mat43, y: mat33):
        return (
            wp.outer(q[1], y[2]) + wp.outer(q[2], y[1]),
            wp.outer(q[0], y[2]) + wp.outer(q[2], y[0]),
            wp.outer(q[0], y[1]) + wp.outer(q[1], y[0]),
        )

    @wp.func
    def doubled_gradient(H: mat33):
        return tensor(
            R(2.0) * H[0, 0],
            R(2.0) * H[1, 1],
            R(2.0) * H[2, 2],
            H[0, 1] + H[1, 0],
            H[1, 2] + H[2, 1],
            H[0, 2] + H[2, 0],
        )

    @wp.func
    def doubled(q: mat43, y: mat33):
        return (
            twice(q[1], y[2]) + twice(q[2], y[1]),
            twice(q[0], y[2]) + twice(q[2], y[0]),
            twice(q[0], y[1]) + twice(q[1], y[0]),
        )

    @wp.func
    def normals(q: mat43, x: mat73):
        return vec3(wp.dot(x[0], q[3]), wp.dot(x[1], q[3]), wp.dot(x[2], q[3]))

    @wp.func
    def normal(y: vec3):
        N = wp.outer(y, y)
        mean = R(THIRD) * wp.dot(y, y)
        for i in range(3):
            N[i, i] = N[i, i] - mean
        return N

    @wp.func
    def deviator(D: tensor):
        mean = R(THIRD) * (D[0] + D[1] + D[2])
        return tensor(D[0] - mean, D[1] - mean, D[2] - mean, D[3], D[4], D[5])

    @wp.func
    def whole(S: tensor, pressure: R):
        return mat33(S[0] + pressure, S[3], S[5], S[3], S[1] + pressure, S[4], S[5], S[4], S[2] + pressure)

    @wp.func
    def invariant(S: tensor):
        shear = S[3] * S[3] + (S[4] * S[4] + S[5] * S[5])
        return S[0] * (S[0] + S[1]) + (S[1] * S[1] + shear)

    @wp.func
    def product(S: tensor, y: vec3):
        return vec3(
            S[0] * y[0] + (S[3] * y[1] + S[5] * y[2]),
            S[3] * y[0] + (S[1] * y[1] + S[4] * y[2]),
            S[5] * y[0] + (S[4] * y[1] + S[2] * y[2]),
        )

    @wp.func
    def solve(traction: vec3, y: vec3, K: R, G: R):
        """By Sherman and Morrison."""
        inverse = R(1.0) / wp.dot(y, y)
        share = (K + R(THIRD) * G) / wp.max(K + R(FOUR_THIRDS) * G, R(LEAST)) * inverse * wp.dot(y, traction)
        return (inverse / wp.max(G, R(LEAST))) * (traction - share * y)

    return Modes(
        frame, twice, doubled_gradient, gradients, doubled, normals, normal, deviator, whole, invariant, product, solve
    )
