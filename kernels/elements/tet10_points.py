"""Owns gradients in the ten-node tetrahedron: nodes as they are read, differences at points, an element in its frame.

With p_i the value at corner i and w_ij what the node between corners i and j has above their mean, a field is
sum_i L_i p_i + 4 sum_ij L_i L_j w_ij in the barycentric coordinates L_i (hierarchical shape functions: Zienkiewicz,
Taylor and Zhu, The Finite Element Method, 7th ed., 2013, section 6.9). Its derivative with respect to L_i at the point
beside corner g is

    d_i(g) = p_i + 4 a s_i + c w_ig,    s_i = sum_j w_ij,    w_gg = 0,    a = (5 - sqrt 5) / 20,    c = 4 / sqrt 5,

and p_i + s_i in the centroid. A gradient follows from the differences d_i - d_0 of displacements and positions, so that
edges may be curved; w is taken before values are rounded, so that linear fields keep all their digits.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.elements.patterns import mean_frame
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

FAR = (5.0 - 5.0**0.5) / 5.0  # 4 a
BESIDE = 4.0 / 5.0**0.5  # c
POINT = 1.0 / 24.0  # volume of a point over the determinant of the edges there


@wp.func
def between(i: int, j: int):
    """The node between two corners, in the order of VTK; 0 where they are one."""
    if i == j:
        return 0
    if i == 3 or j == 3:
        return i + j + 4
    return 4 + (2 * (i + j) + 1) % 3


@cache
def difference_functions(precision: str) -> tuple[Any, Any]:
    """Functions of a field: (field, conn, e) -> (0, p_i - p_0, w_ij by nodes; s_i - s_0 as rows); (these values, what
    the differences at all points have in common, g) -> differences d_i - d_0 at point g as rows."""
    t = scalars(precision)
    R, vec3, mat33, mat103 = t.real, t.vec3, t.mat33, t.mat103

    @wp.func
    def above_mean(field: wp.array(dtype=wp.vec3d), node: int, p: wp.vec3d, q: wp.vec3d):
        w = field[node] - wp.float64(0.5) * (p + q)
        return vec3(R(w[0]), R(w[1]), R(w[2]))

    @wp.func
    def load_nodes(field: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        p0 = field[conn[0, e]]
        p1 = field[conn[1, e]]
        p2 = field[conn[2, e]]
        p3 = field[conn[3, e]]
        d1 = p1 - p0
        d2 = p2 - p0
        d3 = p3 - p0
        p = mat103()
        p[1] = vec3(R(d1[0]), R(d1[1]), R(d1[2]))
        p[2] = vec3(R(d2[0]), R(d2[1]), R(d2[2]))
        p[3] = vec3(R(d3[0]), R(d3[1]), R(d3[2]))
        p[4] = above_mean(field, conn[4, e], p0, p1)
        p[5] = above_mean(field, conn[5, e], p1, p2)
        p[6] = above_mean(field, conn[6, e], p2, p0)
        p[7] = above_mean(field, conn[7, e], p0, p3)
        p[8] = above_mean(field, conn[8, e], p1, p3)
        p[9] = above_mean(field, conn[9, e], p2, p3)
        s1 = p[5] + p[8] - p[6] - p[7]
        s2 = p[5] + p[9] - p[4] - p[7]
        s3 = p[8] + p[9] - p[4] - p[6]
        return p, wp.matrix_from_rows(s1, s2, s3)

    @wp.func
    def point_differences(p: mat103, common: mat33, g: int):
        d = mat33()
        first = p[between(0, g)]
        for i in range(3):
            d[i] = common[i] + R(BESIDE) * (p[between(i + 1, g)] - first)
        return d

    return load_nodes, point_differences


@cache
def edge_gradient_function(precision: str) -> Any:
    """The function (differences of positions, of a field) -> (gradient, cofactors as rows, determinant)."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33

    @wp.func
    def edge_gradient(x: mat33, u: mat33):
        c0 = wp.cross(x[1], x[2])
        c1 = wp.cross(x[2], x[0])
        c2 = wp.cross(x[0], x[1])
        det = wp.dot(x[0], c0)
        H = (R(1.0) / det) * (wp.outer(u[0], c0) + wp.outer(u[1], c1) + wp.outer(u[2], c2))
        return H, wp.matrix_from_rows(c0, c1, c2), det

    return edge_gradient


@cache
def tet10_functions(precision: str, finite: bool) -> tuple[Any, Any, Any]:
    """The struct of an element; the function (X, u, conn, e) -> struct; the function (struct, g) -> (displacement
    gradient in the rotated frame, cofactors as rows, volume) of point g."""
    t = scalars(precision)
    R, mat33, mat103 = t.real, t.mat33, t.mat103
    load_nodes, point_differences = difference_functions(precision)
    edge_gradient = edge_gradient_function(precision)
    rotated, add_matrices = mean_frame(precision, finite), fused(precision).add_matrices

    @wp.struct
    class TenNodes:
        """Rotation W = Q - I; x and u as `difference_functions` have them; what differences at points have in common:
        x_common, u_common."""

        W: mat33
        x: mat103
        u: mat103
        x_common: mat33
        u_common: mat33

    @wp.func
    def load_tet10(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        it = TenNodes()
        x_nodes, x_sums = load_nodes(X, conn, e)
        u_nodes, u_sums = load_nodes(u, conn, e)
        x_corners = wp.matrix_from_rows(x_nodes[1], x_nodes[2], x_nodes[3])
        u_corners = wp.matrix_from_rows(u_nodes[1], u_nodes[2], u_nodes[3])
        it.x = x_nodes
        it.u = u_nodes
        it.x_common = x_corners + R(FAR) * x_sums
        it.u_common = u_corners + R(FAR) * u_sums
        H, _cofactors, _det = edge_gradient(x_corners + x_sums, u_corners + u_sums)
        W, _H = rotated(H)
        it.W = W
        return it

    @wp.func
    def point_gradient(it: TenNodes, g: int):
        x = point_differences(it.x, it.x_common, g)
        H, cofactors, det = edge_gradient(x, point_differences(it.u, it.u_common, g))
        H = add_matrices(H, wp.transpose(it.W), wp.identity(n=3, dtype=R) + H)  # Q^T F - I
        return H, cofactors, R(POINT) * det

    return TenNodes, load_tet10, point_gradient


@cache
def centre_function(precision: str) -> Any:
    """The function struct -> (cofactors as rows, determinant) at the centroid, of an element at small strain."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    TenNodes, _load_tet10, _point_gradient = tet10_functions(precision, False)
    edge_gradient = edge_gradient_function(precision)

    @wp.func
    def centre(it: TenNodes):
        corners = wp.matrix_from_rows(it.x[1], it.x[2], it.x[3])
        _H, cofactors, det = edge_gradient(corners + (R(1.0) / R(FAR)) * (it.x_common - corners), mat33())
        return cofactors, det

    return centre
