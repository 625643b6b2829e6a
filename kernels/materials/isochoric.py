"""Owns the strain of hyperelastic laws: Green and Lagrange's of the isochoric deformation, (J^(-2/3) F^T F - I) / 2.

Their stress is Mandel's, C S with the second Piola-Kirchhoff stress S: that of an isotropic law is symmetric, and the
Kirchhoff stress turned back by the rotation, so that the first Piola-Kirchhoff stress is F^-T times it. Neither needs
the directions of principal stretch that logarithmic strain does.
"""

from dataclasses import replace
from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.kinematics import Kinematics, cofactor_function, kinematics
from warp_mca.kernels.materials.laws import law_functions

wp.set_module_options({"enable_backward": False})

# y^(-1/3) by the bits of y, to 3 %, then Newton's method, which squares that and doubles it
_SOURCE = """
#if defined(__CUDA_ARCH__)
    return rcbrt{suffix}(y);
#else
    float single = (float)y;
    unsigned bits;
    __builtin_memcpy(&bits, &single, 4);
    bits = 0x54a21d2au - bits / 3u;
    __builtin_memcpy(&single, &bits, 4);
    {real} x = single, third = y / 3;
    {steps}
    return y > 0 && y < __builtin_inf() ? x : ({real})__builtin_nan("");
#endif
"""
_STEP = "x = x * (({real})(4.0 / 3.0) - third * x * x * x);"


@cache
def root_function(precision: str) -> Any:
    """The function y -> y^(-1/3) of a positive number, near rounding; NaN for others on a CPU."""
    R, real, suffix, steps = (wp.float32, "float", "f", 3) if precision == "mixed" else (wp.float64, "double", "", 5)
    source = _SOURCE.format(real=real, suffix=suffix, steps=steps * _STEP.format(real=real))

    @wp.func_native(source)
    def inverse_root(y: R) -> R: ...

    return inverse_root


@cache
def trace_function(precision: str) -> Any:
    """The function E -> tr E to rounding of E : E, as tr E = E : E - (tr E)^2 - 4 det E where det (I + 2 E) = 1.

    The sum of the diagonal has no digits left where strains are below rounding.
    """
    mat33, R = scalars(precision).mat33, scalars(precision).real

    @wp.func
    def isochoric_trace(E: mat33):
        trace = wp.trace(E)
        return wp.ddot(E, E) - trace * trace - R(4.0) * wp.determinant(E)

    return isochoric_trace


@cache
def law_kinematics(precision: str, law_name: str, finite: bool) -> Kinematics:
    """The strain measure that a law asks for, as `kinematics`: that of this file for hyperelastic ones."""
    found = kinematics(precision, finite)
    return _isochoric(precision, found) if law_functions(law_name, precision).hyperelastic else found


def _isochoric(precision: str, logarithmic: Kinematics) -> Kinematics:
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    dilatation, inverse_root, cofactor = logarithmic.dilatation, root_function(precision), cofactor_function(precision)

    @wp.func
    def isochoric_strain(H: mat33):
        C = H + wp.transpose(H) + wp.transpose(H) * H
        theta = dilatation(H)
        one = R(1.0)
        square = (one + theta) * (one + theta)
        x = inverse_root(square)
        j = x - one
        # what J^2 (1 + j)^3 - 1 is off by, without the digits that small numbers lose beside 1
        off = theta * (R(2.0) + theta) + square * j * (R(3.0) + R(3.0) * j + j * j)
        j = j - off / (R(3.0) * square * x * x)
        E = (R(0.5) + R(0.5) * j) * C
        for i in range(3):
            E[i, i] = E[i, i] + R(0.5) * j
        return E, mat33(), vec3()

    @wp.func
    def isochoric_nominal(H: mat33, S: mat33, N: mat33, d: vec3, pressure: R):
        k, J = cofactor(H)
        M = (R(1.0) / J) * S
        for i in range(3):
            M[i, i] = M[i, i] + pressure
        return k * M

    @wp.func
    def isochoric_cauchy(H: mat33, S: mat33, N: mat33, d: vec3, pressure: R):
        k, J = cofactor(H)
        sigma = (k * S + (k * S) * wp.transpose(H)) / (J * J)
        sigma = R(0.5) * (sigma + wp.transpose(sigma))
        mean = R(THIRD) * wp.trace(sigma)
        for i in range(3):
            sigma[i, i] = sigma[i, i] + (pressure - mean)
        return sigma

    return replace(logarithmic, deviator=isochoric_strain, nominal=isochoric_nominal, cauchy=isochoric_cauchy)
