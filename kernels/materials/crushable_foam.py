"""Owns the crushable foam: principal stresses limited by a curve of crushing, elastic unloading, a limit of tension.

The law of MAT_CRUSHABLE_FOAM (63) of LS-DYNA, LS-DYNA Keyword User's Manual, volume II: uniaxial with Poisson's ratio
0, principal stresses of an elastic trial are cut to [-Y(gamma), T]. Here gamma = 1 - J is the greatest crushing so far,
so that a foam that expands again across does not soften, and all is in logarithmic strain: T = E (strain - eps_p), with
Kirchhoff stresses -J Y and J T as limits.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.kinematics import eigen_function
from warp_mca.kernels.materials.table import curve_function, table_type

wp.set_module_options({"enable_backward": False})

# inelastic strain, how much of it there was (not less than before), greatest crushing, dissipated energy
HISTORY = ("tensor", "scalar", "scalar", "scalar")
PLASTIC_ROW = 6
TENSION, COUNT = 3, 4  # columns: limit of tension [Pa], number of points of the curve


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> row m of `Model.law`."""
    R, Table = scalars(precision).real, table_type(precision)

    @wp.func
    def foam_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        c = Table()
        c.law = law
        c.row = m
        c.scale = scale
        return c

    return foam_parameters


@cache
def strain_function(precision: str) -> Any:
    """The function history -> eps_p."""
    t = scalars(precision)
    mat33, rows = t.mat33, wp.types.vector(9, t.real)

    @wp.func
    def inelastic_strain(h: rows):
        return mat33(h[0], h[3], h[5], h[3], h[1], h[4], h[5], h[4], h[2])

    return inelastic_strain


@cache
def stress(precision: str) -> Any:
    """The function (strain, history, dt, c) -> (stress, history)."""
    t, Table = scalars(precision), table_type(precision)
    R, vec3, mat33, rows = t.real, t.vec3, t.mat33, wp.types.vector(9, t.real)
    principal, inelastic, curve = (
        eigen_function(precision),
        strain_function(precision),
        curve_function(precision, COUNT),
    )

    @wp.func
    def foam_stress(strain: mat33, h: rows, dt: R, c: Table):
        E = R(2.0) * c.law[c.row, 1]
        eps_p = inelastic(h)
        trial = E * (strain - eps_p)
        new = h
        if dt > R(0.0):
            N, s = principal(trial)
            J = wp.exp(wp.trace(strain))
            before = h[7]
            crushed = wp.max(before, R(1.0) - J)
            limit, _slope, _work = curve(crushed, c)
            earlier, _slope, _work = curve(before, c)
            tension = J * c.law[c.row, wp.static(TENSION)]
            cut = vec3()
            lost = R(0.0)
            square = R(0.0)
            for i in range(3):
                held = wp.clamp(s[i], -J * limit, tension)
                gone = (s[i] - held) / E
                lost += R(0.5) * (held + wp.clamp(s[i], -J * earlier, tension)) * gone
                square += gone * gone
                cut[i] = gone
            new[7] = crushed
            if square > R(0.0):
                change = N * wp.diag(cut) * wp.transpose(N)
                eps_p = eps_p + R(0.5) * (change + wp.transpose(change))
                trial = E * (strain - eps_p)
                p = h[6] + wp.sqrt(square)
                new = rows(
                    eps_p[0, 0],
                    eps_p[1, 1],
                    eps_p[2, 2],
                    eps_p[0, 1],
                    eps_p[1, 2],
                    eps_p[0, 2],
                    p,
                    crushed,
                    h[8] + lost,
                )
        return trial, new

    return foam_stress


@cache
def energies(precision: str) -> Any:
    """The function (strain, history, c) -> (stored, dissipated) [J/m^3]."""
    t, Table = scalars(precision), table_type(precision)
    mat33, rows, inelastic = t.mat33, wp.types.vector(9, t.real), strain_function(precision)

    @wp.func
    def foam_energies(strain: mat33, h: rows, c: Table):
        left = strain - inelastic(h)
        return c.law[c.row, 1] * wp.ddot(left, left), h[8]

    return foam_energies
