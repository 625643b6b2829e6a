"""Owns the accelerations of a short chain in plain numbers, which a swing asks for hundreds of times.

The equations are those of `chain.py`. Their arrays have two or three entries, for which calls of NumPy take twenty
times as long as the arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from warp_mca.rigid.chain import Array, Chain

UNKNOWN = (ArithmeticError, ValueError)  # of angles that are infinite, or a mass matrix that is singular
MOST_LINKS = 6  # beyond, NumPy is faster
Numbers = list[float]
Acceleration = Callable[[Array, Array, Array | None], Array]


def acceleration_of(chain: Chain) -> Acceleration:
    """`chain.acceleration` as a function of theta, theta_dot and force; equal to it but for round-off."""
    if len(chain.links) > MOST_LINKS:
        return chain.acceleration
    plain = _Plain(chain)

    def acceleration(theta: Array, theta_dot: Array, force: Array | None) -> Array:
        try:
            return np.array(plain.solved(theta.tolist(), theta_dot.tolist(), None if force is None else force.tolist()))
        except UNKNOWN:
            return chain.acceleration(theta, theta_dot, force)

    return acceleration


def free_slopes(chain: Chain) -> Callable[[float, Array], Array | Numbers]:
    """Rates and accelerations of a chain without loads as a function of time and state, as `acceleration_of` has them.

    Two links on a base that rests, which most scenes have, take a third of the time of others.
    """
    count = chain.coordinate_count
    if len(chain.links) > MOST_LINKS:
        return lambda _t, y: np.concatenate([y[count:], chain.acceleration(y[:count], y[count:])])
    plain = _Plain(chain)
    solved = plain.two_links() if count == len(chain.links) == 2 else lambda q, v: plain.solved(q, v, None)

    def slopes(_t: float, y: Array) -> Array | Numbers:
        values = y.tolist()
        try:
            return values[count:] + solved(values[:count], values[count:])
        except UNKNOWN:
            return np.concatenate([y[count:], chain.acceleration(y[:count], y[count:])])

    return slopes


def end_point(chain: Chain, point: tuple[float, float]) -> Callable[[Array], tuple[float, float]]:
    """World position [m] of a point in the last link's frame as a function of theta, as `chain.at` gives it."""
    arms = [*(link.hinge_out for link in chain.links[:-1]), point]

    def position(theta: Array) -> tuple[float, float]:
        angles, (x, y) = theta.tolist(), chain.origin
        if chain.slide is not None:
            way = angles.pop(0)
            x, y = x + way * chain.slide[0], y + way * chain.slide[1]
        for angle, (a, b) in zip(angles, arms, strict=True):
            sine, cosine = math.sin(angle), math.cos(angle)
            x, y = x + b * cosine - a * sine, y - a * cosine - b * sine
        return x, y

    return position


class _Plain:
    """Constants of a chain, and its equations of motion."""

    def __init__(self, chain: Chain) -> None:
        first, second = chain.moments
        self._first: list[Numbers] = first.tolist()
        self._hinge: list[Numbers] = [list(map(float, link.hinge_out)) for link in chain.links]
        self._second: Numbers = second.tolist()
        self._gravity = tuple(map(float, chain.gravity))
        self._slide = None if chain.slide is None else tuple(map(float, chain.slide))
        self._mass = chain.mass

    def solved(self, theta: Numbers, theta_dot: Numbers, force: Numbers | None) -> Numbers:
        """theta'' = M^-1 (Q - C - G), see `Chain.acceleration`."""
        base = int(self._slide is not None)
        w, u = self._turned(theta[base:])
        square = [rate * rate for rate in theta_dot[base:]]
        (gx, gy), count = self._gravity, len(square)
        needed = [wx * gy - wy * gx for wx, wy in w]
        matrix = [[0.0] * j + [self._second[j]] + [0.0] * (count - 1 - j) for j in range(count)]
        for i, (ux, uy) in enumerate(u):
            for j in range(i + 1, count):
                wx, wy = w[j]
                matrix[j][i] = ux * wx + uy * wy  # the lower half is enough
                turning = uy * wx - ux * wy
                needed[j] += turning * square[i]
                needed[i] -= turning * square[j]
        if self._slide is not None:
            ex, ey = self._slide
            along = -self._mass * (gx * ex + gy * ey)
            needed.insert(0, along - sum(s * (wx * ex + wy * ey) for s, (wx, wy) in zip(square, w, strict=True)))
            matrix = [[self._mass], *([wy * ex - wx * ey, *row] for row, (wx, wy) in zip(matrix, w, strict=True))]
        if force is None:
            return _solved(matrix, [-value for value in needed])
        return _solved(matrix, [q - value for q, value in zip(force, needed, strict=True)])

    def two_links(self) -> Callable[[Numbers, Numbers], Numbers]:
        """What `solved` gives of two links without a force, written out: the same operations in the same order."""
        sin, cos = math.sin, math.cos
        ((a0, b0), (a1, b1)), (c0, d0), (I0, I1) = self._first, self._hinge[0], self._second
        gx, gy = self._gravity

        def solved(theta: Numbers, theta_dot: Numbers) -> Numbers:
            (q0, q1), (v0, v1) = theta, theta_dot
            s0, k0, s1, k1 = sin(q0), cos(q0), sin(q1), cos(q1)
            ux, uy, wx, wy = d0 * k0 - c0 * s0, -c0 * k0 - d0 * s0, b1 * k1 - a1 * s1, -a1 * k1 - b1 * s1
            turning, M10 = uy * wx - ux * wy, ux * wx + uy * wy
            f0 = -((b0 * k0 - a0 * s0) * gy - (-a0 * k0 - b0 * s0) * gx - turning * (v1 * v1))
            f1 = -(wx * gy - wy * gx + turning * (v0 * v0))
            share = M10 / I0
            a_1 = (f1 - share * f0) / (I1 - share * M10)
            return [(f0 - M10 * a_1) / I0, a_1]

        return solved

    def _turned(self, theta: Numbers) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
        """First moments w [kg m] and hinge vectors u [m] of the links in the world."""
        w, u = [], []
        for angle, (a, b), (c, d) in zip(theta, self._first, self._hinge, strict=True):
            sine, cosine = math.sin(angle), math.cos(angle)
            w.append((b * cosine - a * sine, -a * cosine - b * sine))
            u.append((d * cosine - c * sine, -c * cosine - d * sine))
        return w, u


def _solved(matrix: Sequence[Numbers], right: Numbers) -> Numbers:
    """x of M x = b, by M = L D L^T; of M the lower half is read and overwritten, b too.

    Raises:
        ZeroDivisionError: M is singular.
    """
    count = len(right)
    for k in range(count):
        pivot = matrix[k][k]
        for i in range(k + 1, count):
            share = matrix[i][k] / pivot
            for j in range(k + 1, i + 1):
                matrix[i][j] -= share * matrix[j][k]
            right[i] -= share * right[k]
    for k in reversed(range(count)):
        for i in range(k + 1, count):
            right[k] -= matrix[i][k] * right[i]
        right[k] /= matrix[k][k]
    return right
