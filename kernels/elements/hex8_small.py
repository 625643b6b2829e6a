"""Owns the forces of `hex8` at small strain: the loop over its Gauss points, elastic or with a return map."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import NOTHING
from warp_mca.kernels.elements.hexahedron import (
    LINE_SCALE,
    gauss_line_function,
    history_place,
    line_functions,
    lines_of_point,
    node_force_function,
)
from warp_mca.kernels.elements.viscosity import viscosity_function
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.flow import flow_function

wp.set_module_options({"enable_backward": False})


@cache
def stress_functions(precision: str) -> tuple[Any, Any, Any, Any]:
    """Four functions of symmetric tensors.

    They give S b + c; six sums of products l b, as strains xx, yy, zz, xy, yz, xz; the deviatoric stress of strains,
    whose shear components are doubled; and the invariant J2 = S : S / 2 of a traceless S, which needs no zz.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def add_traction(S: mat33, b: vec3, c: vec3):
        # nested so that every product fuses with a sum
        return vec3(
            S[0, 0] * b[0] + (S[0, 1] * b[1] + (S[0, 2] * b[2] + c[0])),
            S[0, 1] * b[0] + (S[1, 1] * b[1] + (S[1, 2] * b[2] + c[1])),
            S[0, 2] * b[0] + (S[1, 2] * b[1] + (S[2, 2] * b[2] + c[2])),
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
    def deviator(direct: R, shear: R, mean: R, xx: R, yy: R, zz: R, xy: R, yz: R, xz: R):
        d_xx = direct * (xx - mean)
        d_yy = direct * (yy - mean)
        d_zz = direct * (zz - mean)
        d_xy = shear * xy
        d_yz = shear * yz
        d_xz = shear * xz
        return mat33(d_xx, d_xy, d_xz, d_xy, d_yy, d_yz, d_xz, d_yz, d_zz)

    @wp.func
    def invariant(S: mat33):
        shear = S[0, 1] * S[0, 1] + (S[1, 2] * S[1, 2] + S[0, 2] * S[0, 2])
        return S[0, 0] * (S[0, 0] + S[1, 1]) + (S[1, 1] * S[1, 1] + shear)

    return add_traction, symmetric_gradient, deviator, invariant


@cache
def elastic_function(precision: str, plastic: bool) -> Any:
    """The function (greatest S : S / 2 of `small_strain_function`, material, law) -> whether no point yields."""
    R, scale = scalars(precision).real, LINE_SCALE**3

    @wp.func
    def is_elastic(largest: R, m: int, law: wp.array2d(dtype=R)):
        if wp.static(plastic):
            return R(3.0) * largest <= R(scale) * R(scale) * law[m, 2] * law[m, 2]
        return True

    return is_elastic


@cache
def small_strain_function(
    precision: str, law_name: str, viscous: int = 0, ahead: bool = False, listed: bool = False
) -> Any:
    """The function that gives the corner forces of an element, and the greatest S : S / 2 of a point.

    It takes corners, local displacements and frame W; the material m and its K and G; where there is a law, the history
    of element e; of a viscous one the time step and extremes. Jacobians lack the factor LINE_SCALE^3. Strains do
    not depend on it, and K, G and stresses are those of the material times this factor, so that forces are right.

    Args:
        ahead: see `viscosity_function`.
        listed: elements that yield are computed again; their viscosity is not kept.
    """
    t = scalars(precision)
    R, mat33, mat43, mat83 = t.real, t.mat33, t.mat43, t.mat83
    gauss_lines = gauss_line_function(precision, scaled=False)
    _, to_lines = line_functions(precision)
    edge_to_node = node_force_function(precision)
    add_traction, symmetric_gradient, deviator, invariant = stress_functions(precision)
    viscous_pressure, scale = viscosity_function(precision, False, viscous, ahead), LINE_SCALE**3
    is_elastic = elastic_function(precision, listed)
    plastic, flow_at = bool(law_name), flow_function(precision, law_name, points=8, scale=scale)

    @wp.func
    def element_forces(
        Xl: mat83,
        ul: mat83,
        W: mat33,
        K: R,
        G: R,
        e: int,
        m: int,
        law: wp.array2d(dtype=R),
        dt: R,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
    ):
        gx, gy, gz = gauss_lines(Xl)
        lx, ly, lz = gauss_lines(ul)
        Sx = mat43()  # stress times cofactor, summed over the two points of each Gauss line
        Sy = mat43()
        Sz = mat43()
        Bx = mat43(R(NOTHING))  # cofactors alone, which carry the element's one pressure
        By = mat43(R(NOTHING))
        Bz = mat43(R(NOTHING))
        volume, dilatation, largest = R(NOTHING), R(NOTHING), R(0.0)
        if wp.static(plastic):
            flag = yielded_out[e]
            flag_new = flag
        for g in range(8):
            jx, jy, jz = lines_of_point(g)
            b0 = wp.cross(gy[jy], gz[jz])
            b1 = wp.cross(gz[jz], gx[jx])
            b2 = wp.cross(gx[jx], gy[jy])
            det = wp.dot(gx[jx], b0)
            xx, yy, zz, xy, yz, xz = symmetric_gradient(lx[jx], ly[jy], lz[jz], b0, b1, b2)
            trace = xx + yy + zz
            volume += det
            dilatation += trace
            shear = G / det
            S = deviator(shear + shear, shear, R(THIRD) * trace, xx, yy, zz, xy, yz, xz)
            largest = wp.max(largest, invariant(S))
            if wp.static(plastic):
                S, dp = flow_at(S, G, history_place(g), e, m, flag, law, history_out)
                if dp > R(0.0):
                    flag_new = int(1)
            Sx[jx] = add_traction(S, b0, Sx[jx])
            Sy[jy] = add_traction(S, b1, Sy[jy])
            Sz[jz] = add_traction(S, b2, Sz[jz])
            Bx[jx] = Bx[jx] + b0
            By[jy] = By[jy] + b1
            Bz[jz] = Bz[jz] + b2
        if wp.static(plastic):
            if flag_new != flag:
                yielded_out[e] = flag_new
        theta, kept = dilatation / volume, is_elastic(largest, m, law)
        q = R(scale) * viscous_pressure(e, theta, R(scale) * volume, dt, kept, extreme_out)
        pressure = K * dilatation / volume + q
        Fx = to_lines(Sx + pressure * Bx)
        Fy = to_lines(Sy + pressure * By)
        Fz = to_lines(Sz + pressure * Bz)
        return edge_to_node(Fx, Fy, Fz, W), largest

    return element_forces
