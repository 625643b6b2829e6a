"""Owns what hexahedra share: edge vectors, their interpolation to Gauss points, frames, and loads of nodes.

Gradients come from edge vectors interpolated along one direction at a time and the cofactors of the Jacobian; forces
go back by the transposed pass (sum factorisation).
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.elements.rotation import nearest_rotation
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

_GAUSS = 0.5773502691896257
_NEAR, _FAR = 0.5 * (1.0 + _GAUSS), 0.5 * (1.0 - _GAUSS)


@cache
def edge_functions(precision: str) -> tuple[Any, Any]:
    """Functions (half edge vectors along a direction, interpolation of four edge vectors to the four Gauss lines)."""
    t = scalars(precision)
    R, mat43, mat83 = t.real, t.mat43, t.mat83

    @wp.func
    def half_edges(x: mat83, direction: int):
        e = mat43()
        if direction == 0:
            e[0] = R(0.5) * (x[1] - x[0])
            e[1] = R(0.5) * (x[2] - x[3])
            e[2] = R(0.5) * (x[5] - x[4])
            e[3] = R(0.5) * (x[6] - x[7])
        if direction == 1:
            e[0] = R(0.5) * (x[3] - x[0])
            e[1] = R(0.5) * (x[2] - x[1])
            e[2] = R(0.5) * (x[7] - x[4])
            e[3] = R(0.5) * (x[6] - x[5])
        if direction == 2:
            e[0] = R(0.5) * (x[4] - x[0])
            e[1] = R(0.5) * (x[5] - x[1])
            e[2] = R(0.5) * (x[7] - x[3])
            e[3] = R(0.5) * (x[6] - x[2])
        return e

    @wp.func
    def to_gauss(e: mat43):
        near = R(_NEAR)
        far = R(_FAR)
        f = mat43()
        f[0] = near * e[0] + far * e[1]
        f[1] = near * e[1] + far * e[0]
        f[2] = near * e[2] + far * e[3]
        f[3] = near * e[3] + far * e[2]
        g = mat43()
        g[0] = near * f[0] + far * f[2]
        g[2] = near * f[2] + far * f[0]
        g[1] = near * f[1] + far * f[3]
        g[3] = near * f[3] + far * f[1]
        return g

    return half_edges, to_gauss


LINE_RATIO = _FAR / _NEAR
LINE_SCALE = 0.5 * _NEAR * _NEAR  # of half edges at the Gauss lines over what `line_functions` gives


@cache
def line_functions(precision: str) -> tuple[Any, Any]:
    """Functions like those of `edge_functions` without factors: one multiply-add in place of three operations.

    Edges are whole, and weights are divided by the larger one; LINE_SCALE brings the result back.
    """
    t = scalars(precision)
    R, mat43, mat83 = t.real, t.mat43, t.mat83

    @wp.func
    def edges(x: mat83, direction: int):
        e = mat43()
        if direction == 0:
            e[0] = x[1] - x[0]
            e[1] = x[2] - x[3]
            e[2] = x[5] - x[4]
            e[3] = x[6] - x[7]
        if direction == 1:
            e[0] = x[3] - x[0]
            e[1] = x[2] - x[1]
            e[2] = x[7] - x[4]
            e[3] = x[6] - x[5]
        if direction == 2:
            e[0] = x[4] - x[0]
            e[1] = x[5] - x[1]
            e[2] = x[7] - x[3]
            e[3] = x[6] - x[2]
        return e

    @wp.func
    def to_lines(e: mat43):
        r = R(LINE_RATIO)
        f = mat43()
        f[0] = e[0] + r * e[1]
        f[1] = e[1] + r * e[0]
        f[2] = e[2] + r * e[3]
        f[3] = e[3] + r * e[2]
        g = mat43()
        g[0] = f[0] + r * f[2]
        g[2] = f[2] + r * f[0]
        g[1] = f[1] + r * f[3]
        g[3] = f[3] + r * f[1]
        return g

    return edges, to_lines


@cache
def gauss_line_function(precision: str, scaled: bool) -> Any:
    """The function that gives the edge vectors of the three directions on the Gauss lines.

    `scaled` as `edge_functions` has them, otherwise as `line_functions` does.
    """
    along, interpolated = edge_functions(precision) if scaled else line_functions(precision)
    mat83 = scalars(precision).mat83

    @wp.func
    def gauss_lines(x: mat83):
        return interpolated(along(x, 0)), interpolated(along(x, 1)), interpolated(along(x, 2))

    return gauss_lines


@wp.func
def lines_of_point(g: int):
    """Gauss lines along xi, eta and zeta that pass through Gauss point g = i + 2 j + 4 k."""
    i = g & 1
    j = (g >> 1) & 1
    k = g >> 2
    return j + 2 * k, i + 2 * k, i + 2 * j


@wp.func
def history_place(g: int):
    """Place of Gauss point g in the history: g and g + 4 are neighbours, for lanes of `hex8_patch`."""
    return 2 * (g & 3) + (g >> 2)


@cache
def frame_functions(precision: str, finite: bool = False) -> tuple[Any, Any]:
    """Two functions that take an element to its rotated frame.

    They give its rotation W = Q - I with the volume ratio J at its centre, and its local displacements.
    """
    t = scalars(precision)
    R, mat33, mat83 = t.real, t.mat33, t.mat83
    edges, _ = line_functions(precision)
    polar_rotation = nearest_rotation(precision, finite)
    add_transposed = fused(precision).add_transposed

    @wp.func
    def edge_sum(x: mat83, direction: int):
        e = edges(x, direction)
        return (e[0] + e[1]) + (e[2] + e[3])

    @wp.func
    def element_rotation(X: mat83, u: mat83):
        c0 = edge_sum(X, 0)
        c1 = edge_sum(X, 1)
        c2 = edge_sum(X, 2)
        a0 = wp.cross(c1, c2)
        a1 = wp.cross(c2, c0)
        a2 = wp.cross(c0, c1)
        inverse = R(1.0) / wp.dot(c0, a0)
        grad = wp.outer(edge_sum(u, 0), a0) + wp.outer(edge_sum(u, 1), a1) + wp.outer(edge_sum(u, 2), a2)
        F = wp.identity(n=3, dtype=R) + inverse * grad
        return polar_rotation(F), wp.determinant(F)

    @wp.func
    def local_displacement(X: mat83, u: mat83, W: mat33):
        local = mat83()
        for a in range(1, 8):  # the first node is the origin of both
            local[a] = add_transposed(u[a], W, X[a] + u[a])  # Q^T (X + u) - X, without cancellation
        return local

    return element_rotation, local_displacement


@cache
def gradient_function(precision: str) -> Any:
    """The function that gives the Jacobian determinant and the displacement gradient at Gauss point g."""
    t = scalars(precision)
    mat43 = t.mat43

    @wp.func
    def point_gradient(gx: mat43, gy: mat43, gz: mat43, lx: mat43, ly: mat43, lz: mat43, g: int):
        jx, jy, jz = lines_of_point(g)
        b0 = wp.cross(gy[jy], gz[jz])
        b1 = wp.cross(gz[jz], gx[jx])
        b2 = wp.cross(gx[jx], gy[jy])
        det = wp.dot(gx[jx], b0)
        return det, (wp.outer(lx[jx], b0) + wp.outer(ly[jy], b1) + wp.outer(lz[jz], b2)) / det

    return point_gradient


@cache
def node_force_function(precision: str) -> Any:
    """The function that turns edge forces, one 4 x 3 matrix for each direction, into node forces, out of frame W."""
    t = scalars(precision)
    mat33, mat43, mat83 = t.mat33, t.mat43, t.mat83
    add_product = fused(precision).add_product

    @wp.func
    def edge_to_node(Fx: mat43, Fy: mat43, Fz: mat43, W: mat33):
        f = mat83()
        f[0] = Fx[0] + Fy[0] + Fz[0]
        f[1] = Fy[1] + Fz[1] - Fx[0]
        f[2] = Fz[3] - Fx[1] - Fy[1]
        f[3] = Fx[1] - Fy[0] + Fz[2]
        f[4] = Fx[2] + Fy[2] - Fz[0]
        f[5] = Fy[3] - Fx[2] - Fz[1]
        f[6] = -Fx[3] - Fy[3] - Fz[3]
        f[7] = Fx[3] - Fy[2] - Fz[2]
        for a in range(8):
            f[a] = add_product(f[a], W, f[a])
        return f

    return edge_to_node


@cache
def store_function(precision: str) -> Any:
    """The function (force_out, n, f, a) that stores the force on corner a in entry n.

    It stores components one by one: storing a whole vector would prevent vectorisation on a CPU.
    """
    t = scalars(precision)
    vec3, mat83 = t.vec3, t.mat83

    @wp.func
    def store_force(force_out: wp.array(dtype=vec3), n: int, f: mat83, a: int):
        for i in range(3):
            force_out[n][i] = f[a, i]

    return store_force


@cache
def load_function(precision: str) -> Any:
    """The function that reads an element's nodes relative to its first one, differenced before they are rounded."""
    t = scalars(precision)
    R, vec3, mat83 = t.real, t.vec3, t.mat83

    @wp.func
    def load_element(field: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        local = mat83()
        origin = field[conn[0, e]]
        for a in range(1, 8):
            d = field[conn[a, e]] - origin
            local[a] = vec3(R(d[0]), R(d[1]), R(d[2]))
        return local

    return load_element


@cache
def framed_function(precision: str, finite: bool = False) -> Any:
    """The function (X, u, conn, e) -> (corners, local displacements, frame W, ratio of volumes J at the centre)."""
    load_element = load_function(precision)
    element_rotation, local_displacement = frame_functions(precision, finite)

    @wp.func
    def load_in_frame(
        X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int
    ):
        Xl = load_element(X, conn, e)
        ul = load_element(u, conn, e)
        W, J = element_rotation(Xl, ul)
        return Xl, local_displacement(Xl, ul, W), W, J

    return load_in_frame
