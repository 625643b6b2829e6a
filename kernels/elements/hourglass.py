"""Owns the hourglass stiffness of `hex8r`: amplitudes of the hourglass modes, their forces and their plastic part.

Belytschko and Bindeman, Comput. Meth. Appl. Mech. Engng 105 (1993) 225: the modes carry the elastic energy of a brick
of the element's mean edges without its parasitic shear.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import NOTHING
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

# Kept beside the history of the point: plastic hourglass amplitudes, and the energy they took [J].
KEPT = ("vector", "vector", "vector", "vector", "scalar")
AMPLITUDE_ROWS = 12


@cache
def hourglass_function(precision: str) -> Any:
    """The function of amplitudes, see `patterns.amplitude_function`, that gives generalised forces and energy."""
    t = scalars(precision)
    R, vec3, mat33, mat43, mat73 = t.real, t.vec3, t.mat33, t.mat43, t.mat73

    @wp.func
    def hourglass(q: mat43, x: mat73, volume: R, K: R, G: R):
        """Forces conjugate to the amplitudes q, one row for each pattern, and the energy.

        The brick has the element's mean edges, along x[k] and |x[k]| / 4 long.
        """
        one = R(1.0)
        nu = (R(3.0) * K - R(2.0) * G) / (R(6.0) * K + R(2.0) * G)
        third = volume / R(3.0)
        plane = third * R(2.0) * G / (one - nu)
        E = third * R(2.0) / R(3.0) * G * (one + nu)
        length = vec3(wp.length(x[0]), wp.length(x[1]), wp.length(x[2]))
        inverse = vec3(one / length[0], one / length[1], one / length[2])
        y = mat33()
        for k in range(3):
            y[k] = (inverse[k] * inverse[k]) * x[k]
        F = mat43()
        along = vec3(R(NOTHING))
        energy = R(NOTHING)
        for k in range(3):  # strains that vary along edge k, in the plane of the two others
            i = (k + 1) % 3
            j = (k + 2) % 3
            # pattern m varies along the two edges other than edge m
            ei = wp.dot(q[j], y[i])
            ej = wp.dot(q[i], y[j])
            ij = length[i] * inverse[j]
            ji = length[j] * inverse[i]
            shear = ji * wp.dot(q[j], y[j]) + ij * wp.dot(q[i], y[i])
            last = wp.dot(q[3], y[k])
            si = plane * (ei + nu * ej)
            sj = plane * (ej + nu * ei)
            sij = third * G * shear
            F[j] = F[j] + si * y[i]
            F[i] = F[i] + sj * y[j]
            along[j] = along[j] + ji * sij
            along[i] = along[i] + ij * sij
            F[3] = F[3] + (E * last) * y[k]
            energy += R(0.5) * (si * ei + sj * ej + sij * shear + E * last * last)
        for k in range(3):
            F[k] = F[k] + along[k] * y[k]
        return F, energy

    return hourglass


@cache
def amplitude_functions(precision: str, first: int) -> tuple[Any, Any]:
    """Functions that read and write the plastic hourglass amplitudes of an element, from row `first` on."""
    t = scalars(precision)
    R, mat43 = t.real, t.mat43

    @wp.func
    def read_amplitudes(history: wp.array2d(dtype=R), e: int):
        q = mat43()
        for m in range(4):
            for i in range(3):
                q[m, i] = history[wp.static(first) + 3 * m + i, e]
        return q

    @wp.func
    def write_amplitudes(history_out: wp.array2d(dtype=R), e: int, q: mat43):
        for m in range(4):
            for i in range(3):
                history_out[wp.static(first) + 3 * m + i, e] = q[m, i]

    return read_amplitudes, write_amplitudes
