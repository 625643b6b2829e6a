"""Owns linear viscoelasticity of the deviatoric stress: a Prony series on elasticity or on a hyperelastic law.

With the elastic stress T and terms of share g and time tau, the stress is T - sum z, where z' = (g T - z) / tau is what
has relaxed. For T linear over a step dt, with h = g T - z and x = dt / tau, exactly

    z <- z + (1 - e^-x) h + g (1 - (1 - e^-x) / x) (T_new - T)

Taylor, Pister and Goudreau, Int. J. Numer. Meth. Engng 2 (1970) 45; Simo and Hughes, Computational Inelasticity
(1998), section 10.3. z grows from 0, so that float32 resolves slow terms. At finite strain T is the stress conjugate to
logarithmic strain.

The dissipated energy grows by (h + h_new) : dz C / (2 g), with the compliance C = 1 / (2 G) of elasticity, and the
secant one 2 W / (T : T) of a hyperelastic energy W, with which a step that relaxes takes the share g of W. The rest of
the work, counted as central differences do it, is stored.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.kinematics import eigen_function
from warp_mca.kernels.materials.laws import law_functions, row_count

wp.set_module_options({"enable_backward": False})

RELAXES = True
FIRST = 9  # column of Model.law with g of the first term; g of all terms, then tau [s], then k of the bulk modulus
SMALL = 1e-4  # stress over G below which the compliance is that of small strain


def HISTORY(terms: str, *base: str) -> tuple[str, ...]:  # in capitals as the constant of other laws
    """z of each term, T and the dissipated energy; strain and work of a hyperelastic law."""
    return ("deviator",) * (int(terms) + 1) + ("scalar",) + ("deviator", "scalar") * _nonlinear(base)


def _nonlinear(base: tuple[str, ...]) -> bool:
    return any(base)


def elliptic(terms: str, *base: str) -> bool:
    """As `Law.elliptic`."""
    return _nonlinear(base)


@cache
def row_type(precision: str) -> Any:
    """A row of `Model.law`, and the number of terms: loops over these are not unrolled, which compiles sooner."""
    R = scalars(precision).real

    @wp.struct
    class Row:
        law: wp.array2d(dtype=R)
        m: int
        count: int

    return Row


@cache
def parameters(precision: str, terms: str, *_base: str) -> Any:
    """The function (law, m, scale) -> row m of `Model.law`."""
    R, Row, count = scalars(precision).real, row_type(precision), int(terms)

    @wp.func
    def prony_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        c = Row()
        c.law = law
        c.m = m
        c.count = wp.static(count)
        return c

    return prony_parameters


@cache
def factors_function(precision: str) -> Any:
    """The function x = dt / tau -> (1 - e^-x, 1 - (1 - e^-x) / x), to rounding; 0, 0 of 0."""
    R = scalars(precision).real

    @wp.func
    def factors(x: R):
        one = R(1.0)
        t = wp.tanh(R(0.5) * x)
        gone = R(2.0) * t / (one + t)
        series = x * (R(0.5) - x * (R(THIRD) * R(0.5) - x * (R(1.0) / R(24.0) - x / R(120.0))))
        small = x < R(0.02)
        return gone, wp.where(small, series, one - gone / wp.where(small, one, x))

    return factors


@cache
def elastic_function(precision: str, base: tuple[str, ...]) -> Any:
    """The function (e, c) -> (T, W) of the law that relaxes: stress conjugate to e [Pa], energy [J/m^3]."""
    t, Row = scalars(precision), row_type(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    if not _nonlinear(base):

        @wp.func
        def linear(e: mat33, c: Row):
            G = c.law[c.m, 1]
            return R(2.0) * G * e, G * wp.ddot(e, e)

        return linear
    functions, principal = law_functions(":".join(base), precision), eigen_function(precision)
    mandel, stored, read = functions.mandel, functions.stored, functions.parameters

    @wp.func
    def green(e: R):
        """(exp(2 e) - 1) / 2, to rounding."""
        t = wp.tanh(e)
        return t / (R(1.0) - t)

    @wp.func
    def nonlinear(e: mat33, c: Row):
        N, d = principal(e)
        E = N * wp.diag(vec3(green(d[0]), green(d[1]), green(d[2]))) * wp.transpose(N)
        E = R(0.5) * (E + wp.transpose(E))
        own = read(c.law, c.m, R(1.0))
        return mandel(E, own), stored(E, own)

    return nonlinear


@cache
def deviator_functions(precision: str, size: int) -> tuple[Any, Any]:
    """Functions of a history of so many rows: (h, first) -> traceless tensor, (h, first, tensor) -> h."""
    t = scalars(precision)
    R, mat33, rows = t.real, t.mat33, wp.types.vector(size, t.real)

    @wp.func
    def deviator_at(h: rows, first: int):
        xx = h[first]
        yy = h[first + 1]
        xy = h[first + 2]
        yz = h[first + 3]
        xz = h[first + 4]
        return mat33(xx, xy, xz, xy, yy, yz, xz, yz, R(0.0) - xx - yy)

    @wp.func
    def with_deviator(h: rows, first: int, T: mat33):
        new = h
        new[first] = T[0, 0]
        new[first + 1] = T[1, 1]
        new[first + 2] = T[0, 1]
        new[first + 3] = T[1, 2]
        new[first + 4] = T[0, 2]
        return new

    return deviator_at, with_deviator


@cache
def deviatoric(precision: str, terms: str, *base: str) -> Any:
    """The function (e, history, dt, c) -> (S, history)."""
    t, Row = scalars(precision), row_type(precision)
    size, count, nonlinear = row_count(HISTORY(terms, *base)), int(terms), _nonlinear(base)
    R, mat33, rows = t.real, t.mat33, wp.types.vector(size, t.real)
    elastic, factors = elastic_function(precision, base), factors_function(precision)
    deviator_at, with_deviator = deviator_functions(precision, size)
    spent, before, worked = 5 * count + 5, 5 * count + 6, size - 1

    @wp.func
    def compliance(T: mat33, W: R, G: R):
        """1 / (2 G), or the secant one."""
        found = R(0.5) / G
        if wp.static(nonlinear):
            square = wp.ddot(T, T)
            found = wp.where(square > (R(SMALL) * G) * (R(SMALL) * G), R(2.0) * W / square, found)
        return found

    @wp.func
    def relaxing(e: mat33, h: rows, dt: R, c: Row):
        T, W = elastic(e, c)
        old = deviator_at(h, wp.static(5 * count))
        G = c.law[c.m, 1]
        new = h
        S = T
        S_old = old
        soft = compliance(T, W, G)
        for i in range(c.count):
            g = c.law[c.m, wp.static(FIRST) + i]
            z = deviator_at(h, 5 * i)
            S_old = S_old - z
            if dt > R(0.0):
                gone, half = factors(dt / c.law[c.m, wp.static(FIRST + count) + i])
                left = g * old - z
                dz = gone * left + (g * half) * (T - old)
                both = left + left + g * (T - old) - dz
                spent_now = R(0.5) * soft / g * wp.ddot(both, dz)
                new[wp.static(spent)] = new[wp.static(spent)] + spent_now
                z = z + dz
                new = with_deviator(new, 5 * i, z)
            S = S - z
        if dt > R(0.0):
            new = with_deviator(new, wp.static(5 * count), T)
            if wp.static(nonlinear):
                moved = e - deviator_at(h, wp.static(before))
                new[wp.static(worked)] = new[wp.static(worked)] + R(0.5) * wp.ddot(S + S_old, moved)
                new = with_deviator(new, wp.static(before), e)
        return S, new

    return relaxing


@cache
def energies(precision: str, terms: str, *base: str) -> Any:
    """The function (e, history, c) -> (stored, dissipated) [J/m^3]."""
    t, Row = scalars(precision), row_type(precision)
    size, count, nonlinear = row_count(HISTORY(terms, *base)), int(terms), _nonlinear(base)
    R, mat33, rows = t.real, t.mat33, wp.types.vector(size, t.real)
    deviator_at, _ = deviator_functions(precision, size)
    spent, worked = 5 * count + 5, size - 1

    @wp.func
    def prony_energies(e: mat33, h: rows, c: Row):
        lost = h[wp.static(spent)]
        stored = R(0.0)
        if wp.static(nonlinear):
            stored = h[wp.static(worked)] - lost
        else:
            G = c.law[c.m, 1]
            share = R(1.0)
            for i in range(c.count):
                g = c.law[c.m, wp.static(FIRST) + i]
                left = (R(2.0) * G * g) * e - deviator_at(h, 5 * i)
                stored += R(0.25) / (G * g) * wp.ddot(left, left)
                share -= g
            stored += share * G * wp.ddot(e, e)
        return stored, lost

    return prony_energies
