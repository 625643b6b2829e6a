"""Owns the elastic forces of `hex8` at small strain, and what its plastic kernels share with them."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import NOTHING
from warp_mca.kernels.elements.hexahedron import line_functions, node_force_function
from warp_mca.kernels.hardware.scalars import THIRD, scalars

wp.set_module_options({"enable_backward": False})


@cache
def stress_functions(precision: str) -> tuple[Any, Any, Any]:
    """Functions of symmetric tensors (xx, yy, zz, xy, yz, xz).

    (S b + c; six sums of products l b, as strains; the invariant J2 = S : S / 2 of a traceless S, which needs no zz.)
    """
    t = scalars(precision)
    R, vec3 = t.real, t.vec3

    @wp.func
    def add_traction(xx: R, yy: R, zz: R, xy: R, yz: R, xz: R, b: vec3, c: vec3):
        # nested so that every product fuses with a sum
        return vec3(
            xx * b[0] + (xy * b[1] + (xz * b[2] + c[0])),
            xy * b[0] + (yy * b[1] + (yz * b[2] + c[1])),
            xz * b[0] + (yz * b[1] + (zz * b[2] + c[2])),
        )

    @wp.func
    def symmetric_gradient(l0: vec3, l1: vec3, l2: vec3, b0: vec3, b1: vec3, b2: vec3):
        """Direct components, and twice the shear ones, of the sum of l b."""
        xx = l0[0] * b0[0] + l1[0] * b1[0] + l2[0] * b2[0]
        yy = l0[1] * b0[1] + l1[1] * b1[1] + l2[1] * b2[1]
        zz = l0[2] * b0[2] + l1[2] * b1[2] + l2[2] * b2[2]
        xy = l0[0] * b0[1] + l1[0] * b1[1] + l2[0] * b2[1] + l0[1] * b0[0] + l1[1] * b1[0] + l2[1] * b2[0]
        yz = l0[1] * b0[2] + l1[1] * b1[2] + l2[1] * b2[2] + l0[2] * b0[1] + l1[2] * b1[1] + l2[2] * b2[1]
        xz = l0[0] * b0[2] + l1[0] * b1[2] + l2[0] * b2[2] + l0[2] * b0[0] + l1[2] * b1[0] + l2[2] * b2[0]
        return xx, yy, zz, xy, yz, xz

    @wp.func
    def invariant(xx: R, yy: R, xy: R, yz: R, xz: R):
        return xx * (xx + yy) + (yy * yy + (xy * xy + (yz * yz + xz * xz)))

    return add_traction, symmetric_gradient, invariant


@cache
def elastic_function(precision: str) -> Any:
    """The function (corners, local displacements, frame W, K, G) -> (corner forces, greatest S : S / 2 of a point).

    Jacobians lack LINE_SCALE^3, which strains do not feel and forces take from the moduli: K, G and stresses are
    those of the material times that.
    """
    t = scalars(precision)
    R, mat33, mat43, mat83 = t.real, t.mat33, t.mat43, t.mat83
    edges, to_lines = line_functions(precision)
    edge_to_node = node_force_function(precision)
    add_traction, symmetric_gradient, invariant = stress_functions(precision)

    @wp.func
    def elastic_forces(Xl: mat83, ul: mat83, W: mat33, K: R, G: R):
        gx = to_lines(edges(Xl, 0))
        gy = to_lines(edges(Xl, 1))
        gz = to_lines(edges(Xl, 2))
        lx = to_lines(edges(ul, 0))
        ly = to_lines(edges(ul, 1))
        lz = to_lines(edges(ul, 2))
        Sx = mat43()  # stress times cofactor, summed over the two points of each Gauss line
        Sy = mat43()
        Sz = mat43()
        Bx = mat43(R(NOTHING))  # cofactors alone, which carry the element's one pressure
        By = mat43(R(NOTHING))
        Bz = mat43(R(NOTHING))
        volume = R(NOTHING)
        dilation = R(NOTHING)
        largest = R(0.0)
        for g in range(8):
            i = g & 1
            j = (g >> 1) & 1
            k = g >> 2
            jx = j + 2 * k
            jy = i + 2 * k
            jz = i + 2 * j
            b0 = wp.cross(gy[jy], gz[jz])
            b1 = wp.cross(gz[jz], gx[jx])
            b2 = wp.cross(gx[jx], gy[jy])
            det = wp.dot(gx[jx], b0)
            xx, yy, zz, xy, yz, xz = symmetric_gradient(lx[jx], ly[jy], lz[jz], b0, b1, b2)
            trace = xx + yy + zz
            volume += det
            dilation += trace
            shear = G / det
            direct = shear + shear
            mean = R(THIRD) * trace
            xx = direct * (xx - mean)
            yy = direct * (yy - mean)
            zz = direct * (zz - mean)
            xy = shear * xy
            yz = shear * yz
            xz = shear * xz
            largest = wp.max(largest, invariant(xx, yy, xy, yz, xz))
            Sx[jx] = add_traction(xx, yy, zz, xy, yz, xz, b0, Sx[jx])
            Sy[jy] = add_traction(xx, yy, zz, xy, yz, xz, b1, Sy[jy])
            Sz[jz] = add_traction(xx, yy, zz, xy, yz, xz, b2, Sz[jz])
            Bx[jx] = Bx[jx] + b0
            By[jy] = By[jy] + b1
            Bz[jz] = Bz[jz] + b2
        pressure = K * dilation / volume
        Fx = to_lines(Sx + pressure * Bx)
        Fy = to_lines(Sy + pressure * By)
        Fz = to_lines(Sz + pressure * Bz)
        return edge_to_node(Fx, Fy, Fz, W), largest

    return elastic_forces
