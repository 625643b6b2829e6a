"""Owns the internal vectors of `hex8i` that are kept from step to step, see `hex8i_points`: how they change.

Logarithmic elasticity is elliptic up to stretches of about 0.21 to 1.39 only (Bruhns, Xiao and Meyers, Proc. R. Soc. A
457 (2001) 2207), beyond which a vector would grow at will: vectors fade out before, as elastic strains grow. Where
material flows, its tangent modulus falls below the stress, and in a crushed cell a vector would grow at will, too (de
Souza Neto, Peric, Huang and Owen, Commun. Numer. Meth. Engng 11 (1995) 951): as total strains grow, vectors are held at
what they are. They cannot fade there, because the plastic strain has grown with them.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hex8i_small import internal_function
from warp_mca.kernels.elements.internal_modes import LEAST, mode_functions
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.laws import law_functions

wp.set_module_options({"enable_backward": False})

FADING, FADED = 0.2, 0.35  # |e| of the elastic deviatoric strain e from which vectors fade, and at which they are gone
# F : F / J^(2/3) of the mean deformation from which vectors are held more and more, up to HELD: cells that are crushed
# to a fifth and to a tenth of their height
HOLDING, HELD = 10.0, 20.0
STIFFENING = 2.0  # greatest growth of tangent moduli over that of the deviatoric stress
LOOSE = 1e-3  # share of its motion that a held vector keeps, so that its closed form is known

KEPT = ("vector", "vector", "vector", "scalar")  # c_k, and how far vectors have faded, behind the history of the points


@cache
def vector_functions(precision: str, law_name: str, points: int) -> tuple[Any, Any]:
    """Functions that read and write c_k, one in each row, and the share [-] that is left of vectors."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    first = points * law_functions(law_name, precision).size

    @wp.func
    def read_vectors(history: wp.array2d(dtype=R), e: int):
        c = mat33()
        for i in range(9):
            c[i // 3, i % 3] = history[wp.static(first) + i, e]
        return c, R(1.0) - history[wp.static(first + 9), e]

    @wp.func
    def write_vectors(history_out: wp.array2d(dtype=R), e: int, c: mat33, share: R):
        for i in range(9):
            history_out[wp.static(first) + i, e] = c[i // 3, i % 3]
        history_out[wp.static(first + 9), e] = R(1.0) - share

    return read_vectors, write_vectors


@cache
def share_function(precision: str, law_name: str, finite: bool) -> Any:
    """The function (F, greatest S : S of a point, G) -> the share [-] that is left of vectors, or of their motion."""
    R, mat33 = scalars(precision).real, scalars(precision).mat33
    law = law_functions(law_name, precision)
    holds, fades = finite and law.flows, finite and not law.elliptic
    per_strain, per_stretch = 1.0 / (FADED - FADING), 1.0 / (HELD - HOLDING)

    @wp.func
    def share_left(F: mat33, stress2: R, G: R):
        left = R(1.0)
        if wp.static(fades):
            left = wp.clamp((R(FADED) - R(0.5) * wp.sqrt(stress2) / G) * R(per_strain), R(0.0), R(1.0))
        if wp.static(holds):
            J = wp.determinant(F)
            stretch2 = wp.ddot(F, F) / wp.pow(J * J, R(THIRD))
            left = wp.clamp((R(HELD) - stretch2) * R(per_stretch), R(LOOSE), wp.max(left, R(LOOSE)))
        return left

    return share_left


@cache
def corrected_function(precision: str, law_name: str, finite: bool) -> Any:
    """The function (F, c, a, A_k^-1 F r_k in rows, share, greatest S : S, G) -> change of a, new c, new share."""
    R, mat33 = scalars(precision).real, scalars(precision).mat33
    law, share_left = law_functions(law_name, precision), share_function(precision, law_name, finite)
    flows, stiffens = law.flows, finite and law.elliptic and not law.general

    @wp.func
    def corrected(F: mat33, c: mat33, a: mat33, s: mat33, share: R, stress2: R, G: R):
        left = share_left(F, stress2, G)
        step = R(-3.0) * (s * F)
        if wp.static(stiffens):  # where the tangent moduli exceed those of A_k, whole steps would go too far
            step = (G / (G + R(STIFFENING) * wp.sqrt(stress2))) * step
        closed = (R(1.0) / wp.max(share, R(LEAST))) * (a - c)
        new = mat33()
        if wp.static(flows):
            new = c + (left * step + (share - left) * closed)
        else:
            new = left * (c + step)
        return (new - c) + (left - share) * closed, new, left

    return corrected


@cache
def closed_form_function(precision: str) -> Any:
    """The function (s, r, G_k, Y, y, F^-1, K, G) -> how r . F^T L(G_k F^-1) changes with G_k and with F, negative.

    s is A_k^-1 F r, Y is F y. What r has left of traction does work as the closed form of a vector changes.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    modes, internal_vector = mode_functions(precision), internal_function(precision)
    doubled_gradient, twice, whole = modes.doubled_gradient, modes.twice, modes.whole
    tensor = wp.types.vector(6, R)

    @wp.func
    def elastic(D: tensor, K: R, G: R):
        return whole(G * D, (R(0.5) * K - R(THIRD) * G) * (D[0] + D[1] + D[2]))

    @wp.func
    def closed_form(s: vec3, r: vec3, G_k: mat33, Y: vec3, y: vec3, inverse: mat33, K: R, G: R):
        with_G = elastic(twice(s, Y), K, G) * wp.transpose(inverse)
        spatial = G_k * inverse
        D = doubled_gradient(spatial)
        b = internal_vector(D, Y, vec3(), K, G)
        v = (K + R(THIRD) * G) * (wp.dot(Y, b) * s + wp.dot(s, Y) * b) + (R(2.0) * G * wp.dot(s, b)) * Y
        with_F = wp.outer(elastic(D, K, G) * s + v, y) - wp.outer(b, r) - wp.transpose(spatial) * with_G
        return with_G, with_F

    return closed_form
