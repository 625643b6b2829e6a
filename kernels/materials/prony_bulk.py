"""Owns linear viscoelasticity of deviatoric stress and pressure: `prony`, and a series k of the bulk modulus beside it.

The volumetric stress is K tr(strain) - sum z, with z' = (k K tr(strain) - z) / tau of each term.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials import prony
from warp_mca.kernels.materials.laws import row_count

wp.set_module_options({"enable_backward": False})

parameters = prony.parameters
elliptic = prony.elliptic
RELAXES = True


def HISTORY(terms: str, *base: str) -> tuple[str, ...]:  # in capitals as the constant of other laws
    """That of `prony`; z of each term, and K tr(strain)."""
    return prony.HISTORY(terms, *base) + ("scalar",) * (int(terms) + 1)


@cache
def parts_functions(precision: str, terms: str, *base: str) -> tuple[Any, Any]:
    """Functions strain -> (deviator, trace), history -> that of `prony`."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    size, own = row_count(HISTORY(terms, *base)), row_count(prony.HISTORY(terms, *base))
    rows, first = wp.types.vector(size, R), wp.types.vector(own, R)

    @wp.func
    def split(strain: mat33):
        trace = wp.trace(strain)
        e = strain
        for i in range(3):
            e[i, i] = e[i, i] - R(THIRD) * trace
        return e, trace

    @wp.func
    def begin(h: rows):
        found = first()
        for i in range(wp.static(own)):
            found[i] = h[i]
        return found

    return split, begin


@cache
def stress(precision: str, terms: str, *base: str) -> Any:
    """The function (strain, history, dt, c) -> (stress, history)."""
    t, Row = scalars(precision), prony.row_type(precision)
    size, own, count = row_count(HISTORY(terms, *base)), row_count(prony.HISTORY(terms, *base)), int(terms)
    R, mat33, rows, spent = t.real, t.mat33, wp.types.vector(size, t.real), 5 * count + 5
    relaxing, factors = prony.deviatoric(precision, terms, *base), prony.factors_function(precision)
    split, begin = parts_functions(precision, terms, *base)
    has_work = any(base)

    @wp.func
    def relaxing_whole(strain: mat33, h: rows, dt: R, c: Row):
        e, trace = split(strain)
        S, kept = relaxing(e, begin(h), dt, c)
        K = c.law[c.m, 0]
        T = K * trace
        old = h[wp.static(own + count)]
        new = h
        for i in range(wp.static(own)):
            new[i] = kept[i]
        pressure = T
        before = old
        for i in range(c.count):
            k = c.law[c.m, wp.static(prony.FIRST + 2 * count) + i]
            z = h[wp.static(own) + i]
            before = before - z
            if dt > R(0.0) and k > R(0.0):
                gone, half = factors(dt / c.law[c.m, wp.static(prony.FIRST + count) + i])
                left = k * old - z
                dz = gone * left + (k * half) * (T - old)
                lost = R(0.5) / (K * k) * (left + left + k * (T - old) - dz) * dz
                new[wp.static(spent)] = new[wp.static(spent)] + lost
                z = z + dz
                new[wp.static(own) + i] = z
            pressure = pressure - z
        if dt > R(0.0):
            new[wp.static(own + count)] = T
            if wp.static(has_work):
                work = R(0.5) * (pressure + before) * (T - old) / K
                new[wp.static(own - 1)] = new[wp.static(own - 1)] + work
        for i in range(3):
            S[i, i] = S[i, i] + pressure
        return S, new

    return relaxing_whole


@cache
def energies(precision: str, terms: str, *base: str) -> Any:
    """The function (strain, history, c) -> (stored, dissipated) [J/m^3]."""
    t, Row = scalars(precision), prony.row_type(precision)
    size, own, count = row_count(HISTORY(terms, *base)), row_count(prony.HISTORY(terms, *base)), int(terms)
    R, mat33, rows = t.real, t.mat33, wp.types.vector(size, t.real)
    of_deviator, has_work = prony.energies(precision, terms, *base), any(base)
    split, begin = parts_functions(precision, terms, *base)

    @wp.func
    def whole_energies(strain: mat33, h: rows, c: Row):
        e, trace = split(strain)
        stored, lost = of_deviator(e, begin(h), c)
        if wp.static(not has_work):
            K = c.law[c.m, 0]
            share = R(1.0)
            for i in range(c.count):
                k = c.law[c.m, wp.static(prony.FIRST + 2 * count) + i]
                left = k * K * trace - h[wp.static(own) + i]
                stored += wp.where(k > R(0.0), R(0.5) * left * left / (K * wp.max(k, R(1e-30))), R(0.0))
                share -= k
            stored += R(0.5) * share * K * trace * trace
        return stored, lost

    return whole_energies
