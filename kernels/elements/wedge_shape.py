"""Owns the shape of a wedge: its patterns, volume and gradients, points, and the base in which hourglass strains lie.

The thickness goes from triangle to triangle. r, s and zeta count from the middle; x = r x_0 + s x_1 + zeta x_2 + zeta r
x_3 + zeta s x_4 about it, with a pattern in each row of a 5 x 3 matrix.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars

wp.set_module_options({"enable_backward": False})

CORNERS = POINTS = 6
SIXTH, GAUSS = 0.5 * THIRD, 3.0**-0.5


@cache
def pattern_functions(precision: str) -> tuple[Any, Any]:
    """Functions (nodes -> patterns; forces on patterns -> on corners, the transpose)."""
    t = scalars(precision)
    R, vec3, mat53, mat63 = t.real, t.vec3, wp.types.matrix((5, 3), t.real), t.mat63

    @wp.func
    def half_edge(field: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int, a: int, b: int):
        d = field[conn[b, e]] - field[conn[a, e]]
        return R(0.5) * vec3(R(d[0]), R(d[1]), R(d[2]))

    @wp.func
    def load_patterns(field: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        low_r = half_edge(field, conn, e, 0, 1)
        low_s = half_edge(field, conn, e, 0, 2)
        top_r = half_edge(field, conn, e, 3, 4)
        top_s = half_edge(field, conn, e, 3, 5)
        x = mat53()
        x[0] = low_r + top_r
        x[1] = low_s + top_s
        x[3] = top_r - low_r
        x[4] = top_s - low_s
        x[2] = half_edge(field, conn, e, 0, 3) + R(THIRD) * (x[3] + x[4])
        return x

    @wp.func
    def to_corners(f: mat53):
        mean = R(THIRD) * f[2]
        middle = -f[0] - f[1]
        along = mean - f[3] - f[4]
        found = mat63()
        found[0] = R(0.5) * (middle - along)
        found[3] = R(0.5) * (middle + along)
        along = mean + f[3]
        found[1] = R(0.5) * (f[0] - along)
        found[4] = R(0.5) * (f[0] + along)
        along = mean + f[4]
        found[2] = R(0.5) * (f[1] - along)
        found[5] = R(0.5) * (f[1] + along)
        return found

    return load_patterns, to_corners


@cache
def gradient_functions(precision: str) -> tuple[Any, Any]:
    """Functions (patterns -> volume and its gradients; patterns of displacements -> mean gradient).

    V = [x_0 x_1 x_2] + [x_3 x_4 x_2] / 3, which is exact; gradients are its derivatives.
    """
    t = scalars(precision)
    R, mat33, mat53 = t.real, t.mat33, wp.types.matrix((5, 3), t.real)

    @wp.func
    def volume_gradients(x: mat53):
        b = mat53()
        b[0] = wp.cross(x[1], x[2])
        b[1] = wp.cross(x[2], x[0])
        b[2] = wp.cross(x[0], x[1]) + R(THIRD) * wp.cross(x[3], x[4])
        b[3] = R(THIRD) * wp.cross(x[4], x[2])
        b[4] = R(THIRD) * wp.cross(x[2], x[3])
        return b, wp.dot(b[2], x[2])

    @wp.func
    def mean_gradient(u: mat53, b: mat53, volume: R):
        H = mat33()
        for p in range(5):
            H = H + wp.outer(u[p], b[p])
        return H / volume

    return volume_gradients, mean_gradient


@cache
def place_function(precision: str) -> Any:
    """The function g -> (zeta, r, s) of point g: near the corner of the same number."""
    R = scalars(precision).real

    @wp.func
    def place_of(g: int):
        r = -R(SIXTH)
        s = -R(SIXTH)
        if g % 3 == 1:
            r = R(THIRD)
        if g % 3 == 2:
            s = R(THIRD)
        zeta = R(GAUSS)
        if g < 3:
            zeta = -R(GAUSS)
        return zeta, r, s

    return place_of


@cache
def tensor_functions(precision: str) -> tuple[Any, Any]:
    """Functions (symmetric part of the dyad of two vectors; deviator)."""
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def dyad(a: vec3, b: vec3):
        return R(0.5) * (wp.outer(a, b) + wp.outer(b, a))

    @wp.func
    def without_trace(S: mat33):
        mean = R(THIRD) * wp.trace(S)
        return mat33(
            S[0, 0] - mean, S[0, 1], S[0, 2], S[1, 0], S[1, 1] - mean, S[1, 2], S[2, 0], S[2, 1], S[2, 2] - mean
        )

    return dyad, without_trace


@cache
def hooke_function(precision: str) -> Any:
    """The function (strain, K, G) -> stress of isotropic elasticity [Pa]."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33

    @wp.func
    def hooke(E: mat33, K: R, G: R):
        pressure = (K - R(2.0) * R(THIRD) * G) * wp.trace(E)
        return R(2.0) * G * E + pressure * wp.identity(n=3, dtype=R)

    return hooke
