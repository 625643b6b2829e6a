"""Owns the strain measures: small strain in the rotated frame, and logarithmic strain for large deformation.

Both act on the displacement gradient H in a frame that has turned with the element, F = I + H. The deviatoric strain
goes to the return map; the stress that comes back, work-conjugate to it, turns into the first Piola-Kirchhoff stress.
Logarithmic: E = ln(F^T F) / 2 with additive plastic strain, Miehe, Apel and Lambrecht, Comput. Meth. Appl. Mech.
Engng 191 (2002) 5383. Hyperelastic laws take the isochoric strain of `isochoric`, which needs no logarithm.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.logarithm import log_function

wp.set_module_options({"enable_backward": False})


SWEEPS = 4  # of Jacobi's method: quadratic, so that the fourth works on rounding alone


@cache
def eigen_function(precision: str) -> Any:
    """The function C -> (N, d): directions as columns and eigenvalues of a symmetric matrix, by Jacobi's method.

    It has no branches, so that a CPU computes several elements at once. Warp's eig3 leaves errors of up to 1e-3 of the
    largest entry in float32, this function 1e-6.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def jacobi_rotation(p: R, q: R, pq: R):
        """Cosine, sine and tangent of the rotation that makes the entry pq of a symmetric 2 x 2 matrix zero."""
        one = R(1.0)
        twice = R(2.0) * pq
        size = wp.abs(q - p) + wp.sqrt((q - p) * (q - p) + twice * twice)
        resolved = size > wp.abs(pq)  # if squares underflow, a tiny q - p would make the tangent huge
        tangent = wp.where(resolved, wp.where(q < p, -twice, twice), R(0.0)) / wp.where(resolved, size, one)
        cosine = one / wp.sqrt(one + tangent * tangent)
        return cosine, cosine * tangent, tangent

    @wp.func
    def rotate(p: R, q: R, pq: R, pr: R, qr: R, n_p: vec3, n_q: vec3):
        """Entries pp, qq, pr, qr and both directions after the rotation that makes pq zero; r is the third axis."""
        c, s, t = jacobi_rotation(p, q, pq)
        return p - t * pq, q + t * pq, c * pr - s * qr, s * pr + c * qr, c * n_p - s * n_q, s * n_p + c * n_q

    @wp.func
    def jacobi_eigen(C: mat33):
        xx = C[0, 0]
        yy = C[1, 1]
        zz = C[2, 2]
        xy = C[0, 1]
        yz = C[1, 2]
        xz = C[0, 2]
        n0 = vec3(R(1.0), R(0.0), R(0.0))
        n1 = vec3(R(0.0), R(1.0), R(0.0))
        n2 = vec3(R(0.0), R(0.0), R(1.0))
        for _ in range(wp.static(SWEEPS)):
            xx, yy, xz, yz, n0, n1 = rotate(xx, yy, xy, xz, yz, n0, n1)
            xy = R(0.0)
            xx, zz, xy, yz, n0, n2 = rotate(xx, zz, xz, xy, yz, n0, n2)
            xz = R(0.0)
            yy, zz, xy, xz, n1, n2 = rotate(yy, zz, yz, xy, xz, n1, n2)
            yz = R(0.0)
        return wp.matrix_from_cols(n0, n1, n2), vec3(xx, yy, zz)

    return jacobi_eigen


@dataclass(frozen=True)
class Kinematics:
    """Functions of a strain measure.

    Attributes:
        dilatation: H -> J - 1 [-], change of volume over volume.
        deviator: H -> (deviatoric strain e, principal directions N, eigenvalues d of F^T F - I).
        nominal: (H, S, N, d, pressure) -> first Piola-Kirchhoff stress [Pa] of the stress S conjugate to e, and of the
            pressure, which goes with the derivative of J with respect to F.
        pressure: (K, J - 1) -> derivative of the volumetric energy with respect to J [Pa].
        volumetric_energy: (K, J - 1) -> energy per reference volume [J/m^3].
        volume_strain: J - 1 -> trace of the strain [-].
        conjugate_pressure: (derivative of an energy with respect to that trace [Pa], J - 1) -> with respect to J [Pa].
        cauchy: (H, S, N, d, pressure) -> Cauchy stress in the rotated frame [Pa].
    """

    dilatation: Any
    deviator: Any
    nominal: Any
    pressure: Any
    volumetric_energy: Any
    volume_strain: Any
    conjugate_pressure: Any
    cauchy: Any


@cache
def kinematics(precision: str, finite: bool) -> Kinematics:
    """The functions of logarithmic strain where `finite`, else of small strain."""
    return _logarithmic(precision) if finite else _small(precision)


@cache
def cofactor_function(precision: str) -> Any:
    """The function H -> (J F^-T, J) of F = I + H."""
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def cofactor(H: mat33):
        F = wp.identity(n=3, dtype=R) + H
        r0 = vec3(F[0, 0], F[0, 1], F[0, 2])
        r1 = vec3(F[1, 0], F[1, 1], F[1, 2])
        r2 = vec3(F[2, 0], F[2, 1], F[2, 2])
        k0 = wp.cross(r1, r2)
        k1 = wp.cross(r2, r0)
        k2 = wp.cross(r0, r1)
        return mat33(k0[0], k0[1], k0[2], k1[0], k1[1], k1[2], k2[0], k2[1], k2[2]), wp.dot(r0, k0)

    return cofactor


def _small(precision: str) -> Kinematics:
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def small_dilatation(H: mat33):
        return wp.trace(H)

    @wp.func
    def small_deviator(H: mat33):
        mean = R(THIRD) * wp.trace(H)
        xy = R(0.5) * (H[0, 1] + H[1, 0])
        yz = R(0.5) * (H[1, 2] + H[2, 1])
        xz = R(0.5) * (H[0, 2] + H[2, 0])
        # no products with zeros of an identity, which compilers keep
        return mat33(H[0, 0] - mean, xy, xz, xy, H[1, 1] - mean, yz, xz, yz, H[2, 2] - mean), mat33(), vec3()

    @wp.func
    def small_stress(H: mat33, S: mat33, N: mat33, d: vec3, pressure: R):
        P = S
        for i in range(3):
            P[i, i] = P[i, i] + pressure
        return P

    @wp.func
    def small_pressure(K: R, theta: R):
        return K * theta

    @wp.func
    def small_volumetric(K: R, theta: R):
        return R(0.5) * K * theta * theta

    @wp.func
    def small_volume_strain(theta: R):
        return theta

    @wp.func
    def small_conjugate(mean: R, theta: R):
        return mean

    return Kinematics(
        small_dilatation,
        small_deviator,
        small_stress,
        small_pressure,
        small_volumetric,
        small_volume_strain,
        small_conjugate,
        small_stress,
    )


def _logarithmic(precision: str) -> Kinematics:
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    principal, natural_log, cofactor = eigen_function(precision), log_function(precision), cofactor_function(precision)

    @wp.func
    def log_over(x: R):
        """ln(1 + x) / x, to rounding also where x is small (Kahan)."""
        one = R(1.0)
        y = one + x
        exact = y - one
        none = exact == R(0.0)
        return wp.where(none, one, natural_log(y) / wp.where(none, one, exact))

    @wp.func
    def log_dilatation(H: mat33):
        trace = wp.trace(H)
        second = R(0.5) * (trace * trace - wp.trace(H * H))
        return trace + second + wp.determinant(H)

    @wp.func
    def log_deviator(H: mat33):
        C = H + wp.transpose(H) + wp.transpose(H) * H
        N, d = principal(C)
        e0 = R(0.5) * d[0] * log_over(d[0])
        e1 = R(0.5) * d[1] * log_over(d[1])
        e2 = R(0.5) * d[2] * log_over(d[2])
        mean = (e0 + e1 + e2) / R(3.0)
        e = N * wp.diag(vec3(e0 - mean, e1 - mean, e2 - mean)) * wp.transpose(N)
        return R(0.5) * (e + wp.transpose(e)), N, d

    @wp.func
    def log_deviatoric(H: mat33, S: mat33, N: mat33, d: vec3):
        T = wp.transpose(N) * S * N
        one = R(1.0)
        # divided differences of ln at the squared stretches
        xy = T[0, 1] * log_over((d[0] - d[1]) / (one + d[1])) / (one + d[1])
        yz = T[1, 2] * log_over((d[1] - d[2]) / (one + d[2])) / (one + d[2])
        xz = T[0, 2] * log_over((d[0] - d[2]) / (one + d[2])) / (one + d[2])
        xx = T[0, 0] / (one + d[0])
        yy = T[1, 1] / (one + d[1])
        zz = T[2, 2] / (one + d[2])
        P = N * mat33(xx, xy, xz, xy, yy, yz, xz, yz, zz) * wp.transpose(N)
        return P + H * P

    @wp.func
    def log_nominal(H: mat33, S: mat33, N: mat33, d: vec3, pressure: R):
        k, _J = cofactor(H)
        return log_deviatoric(H, S, N, d) + pressure * k

    @wp.func
    def log_pressure(K: R, theta: R):
        return K * theta * log_over(theta) / (R(1.0) + theta)

    @wp.func
    def log_volumetric(K: R, theta: R):
        strain = theta * log_over(theta)
        return R(0.5) * K * strain * strain

    @wp.func
    def log_cauchy(H: mat33, S: mat33, N: mat33, d: vec3, pressure: R):
        P = log_deviatoric(H, S, N, d)
        sigma = (P + P * wp.transpose(H)) / (R(1.0) + log_dilatation(H))
        return R(0.5) * (sigma + wp.transpose(sigma)) + pressure * wp.identity(n=3, dtype=R)

    @wp.func
    def log_volume_strain(theta: R):
        return theta * log_over(theta)

    @wp.func
    def log_conjugate(mean: R, theta: R):
        return mean / (R(1.0) + theta)

    return Kinematics(
        log_dilatation,
        log_deviator,
        log_nominal,
        log_pressure,
        log_volumetric,
        log_volume_strain,
        log_conjugate,
        log_cauchy,
    )
