"""Owns gradients in the ten-node tetrahedron: nodes as they are read, differences at points, an element in its frame.

With p_ij the value in the middle of the edge between corners i and j, of the corner itself where i = j, the derivative
with respect to the barycentric coordinate L_i at the point beside corner g is

    d_i(g) = 4 a s_i + (4 a - 1) p_ii + c p_ig,    s_i = sum_j p_ij over j other than i,
    a = (5 - sqrt 5) / 20,    c = 4 / sqrt 5,

and in the centroid s_i. A gradient follows from the differences d_i - d_0 of displacements and positions, so that edges
may be curved.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.elements.patterns import mean_frame
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

FAR = (5.0 - 5.0**0.5) / 5.0  # 4 a
CORNER = FAR - 1.0  # 4 a - 1
BESIDE = 4.0 / 5.0**0.5  # c
POINT = 1.0 / 24.0  # volume of a point over the determinant of the edges there


@wp.func
def between(i: int, j: int):
    """The node between two corners, in the order of VTK; the corner itself where they are one."""
    if i == j:
        return i
    if i == 3 or j == 3:
        return i + j + 4
    return 4 + (2 * (i + j) + 1) % 3


@cache
def difference_functions(precision: str) -> tuple[Any, Any, Any]:
    """Functions of values at the nodes less that of the first one: (values, their differences in the centroid) of a
    field; what the differences at all points have in common; the differences at point g."""
    t = scalars(precision)
    R, vec3, mat33, mat103 = t.real, t.vec3, t.mat33, t.mat103

    @wp.func
    def load_nodes(field: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        p = mat103()
        origin = field[conn[0, e]]
        for a in range(1, 10):
            d = field[conn[a, e]] - origin  # differenced before it is rounded
            p[a] = vec3(R(d[0]), R(d[1]), R(d[2]))
        s0 = p[4] + p[6] + p[7]
        s1 = p[4] + p[5] + p[8]
        s2 = p[5] + p[6] + p[9]
        s3 = p[7] + p[8] + p[9]
        return p, wp.matrix_from_rows(s1 - s0, s2 - s0, s3 - s0)

    @wp.func
    def common_differences(p: mat103, centre: mat33):
        return R(FAR) * centre + R(CORNER) * wp.matrix_from_rows(p[1], p[2], p[3])

    @wp.func
    def point_differences(p: mat103, common: mat33, g: int):
        d = mat33()
        first = p[between(0, g)]
        for i in range(3):
            d[i] = common[i] + R(BESIDE) * (p[between(i + 1, g)] - first)
        return d

    return load_nodes, common_differences, point_differences


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
    load_nodes, common_differences, point_differences = difference_functions(precision)
    edge_gradient = edge_gradient_function(precision)
    rotated, add_matrices = mean_frame(precision, finite), fused(precision).add_matrices

    @wp.struct
    class TenNodes:
        """Rotation W = Q - I; x and u of the nodes less those of the first; what differences at points have in common:
        x_common, u_common."""

        W: mat33
        x: mat103
        u: mat103
        x_common: mat33
        u_common: mat33

    @wp.func
    def load_tet10(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        it = TenNodes()
        x_nodes, x_centre = load_nodes(X, conn, e)
        u_nodes, u_centre = load_nodes(u, conn, e)
        it.x = x_nodes
        it.u = u_nodes
        it.x_common = common_differences(x_nodes, x_centre)
        it.u_common = common_differences(u_nodes, u_centre)
        H, _cofactors, _det = edge_gradient(x_centre, u_centre)
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
