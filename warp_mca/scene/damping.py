"""Owns the damping of bodies: in proportion to mass and stiffness, or by a loss factor over a band of frequencies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.scene.loads import LOADS, Load

ABOUT = ("body", "ground")
LARGEST = 0.5  # loss factor up to which branches fit it
FIT = 0.01  # share by which the loss factor may be off within the band
POINTS = 40  # of each decade at which it is fitted
WIDEST = 1e6  # ratio of the ends of a band
PER_DECADE = 3  # branches at most
BEYOND = (-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4, 0.6)  # decades


@dataclass(frozen=True, kw_only=True)
class Damping(Load):
    """Damping of a body: forces -alpha M v - beta K v, or those of a loss factor over a band of frequencies.

    A mode of circular frequency w decays with the damping ratio alpha / (2 w) + beta w / 2 (Rayleigh), or with half of
    the loss factor. K v is the rate at which the forces of the elements change, as seen by who turns with the body. So
    the stiffness part follows the tangent: it grows smaller where a body yields.

    A loss factor adds generalised Maxwell branches to all moduli, which keep their values for slow loads (Emmerich and
    Korn, Geophysics 52 (1987) 1252). At frequencies far above the band they are higher by the share `stiffening`. It
    shortens the time step by the root of that, where stiffness divides it by beta w of the fastest vibration of a cell.
    A free vibration decays faster than half of the loss factor says, by the share loss_factor / pi.

    Attributes:
        mass: alpha [1/s].
        stiffness: beta [s].
        loss_factor: energy lost in a cycle of vibration over 2 pi times the greatest stored [-], up to 0.5.
        band: the least and the greatest frequency at which it holds, to 1 % [Hz].
        about: motion relative to which `mass` damps: "body", the mean rigid motion of the body, that its held nodes
            allow, so that falling, flying and swinging do not slow down; or "ground", all motion.
    """

    mass: float = 0.0
    stiffness: float = 0.0
    loss_factor: float = 0.0
    band: tuple[float, float] | None = None
    about: str = "body"

    energies = ("damping",)
    refuses = {"multi_rate": "its forces are those of one common step; leave it out"}  # noqa: RUF012
    module = "warp_mca.physics.loads.damping"
    inner = True

    def __post_init__(self) -> None:
        super().__post_init__()
        owner = f"Damping of {self.body}"
        validate.within(owner, 0.0, 1e12, mass=self.mass)
        validate.within(owner, 0.0, 1e3, stiffness=self.stiffness)
        validate.within(owner, 0.0, LARGEST, loss_factor=self.loss_factor)
        validate.choice(owner, ABOUT, about=self.about)
        if not (self.mass or self.stiffness or self.loss_factor):
            raise bad_value(f"{owner}.mass", self.mass, "nothing damps; give mass, stiffness, or loss_factor and band")
        if self.loss_factor and self.band is None:
            raise bad_value(f"{owner}.band", None, "give the frequencies (f1, f2) between which loss_factor holds [Hz]")
        if self.band is not None:
            if not self.loss_factor:
                raise bad_value(f"{owner}.loss_factor", self.loss_factor, "give that of the band, above 0")
            if not (validate.is_list(self.band) and len(self.band) == 2 and 0.0 < self.band[0] < self.band[1]):
                raise bad_value(f"{owner}.band", validate.brief(self.band), "give two frequencies f1 < f2 above 0 [Hz]")
            if self.band[1] > WIDEST * self.band[0]:
                raise bad_value(f"{owner}.band", self.band, f"give frequencies of a ratio of at most {WIDEST:g}")

    @property
    def is_constant(self) -> bool:
        """It knows no time."""
        return True

    def branches(self) -> tuple[Array, Array]:
        """Shares of the stiffness [-] and relaxation times [s] of the Maxwell branches, shape (count,), float64 both.

        As few as keep the loss factor to 1 % within the band, at times spaced evenly in their logarithm.
        """
        if self.band is None:
            return np.zeros(0), np.zeros(0)
        return _fitted(self.loss_factor, 2.0 * math.pi * self.band[0], 2.0 * math.pi * self.band[1])

    @property
    def stiffening(self) -> float:
        """Share by which the band's branches raise the moduli far above the band [-]."""
        return float(self.branches()[0].sum())

    def loss_at(self, frequency: float) -> float:
        """Loss factor of an elastic vibration [-]: twice its damping ratio.

        Args:
            frequency: [Hz], above 0.
        """
        w = 2.0 * math.pi * frequency
        share, times = self.branches()
        return float(_loss(np.array([w]), share, times)[0]) + self.mass / w + self.stiffness * w


def _loss(w: Array, share: Array, times: Array) -> Array:
    """Imaginary over real part of 1 + sum g i w tau / (1 + i w tau), shape (len(w),)."""
    x = w[:, None] * times
    return (share * x / (1.0 + x * x)).sum(axis=1) / (1.0 + (share * x * x / (1.0 + x * x)).sum(axis=1))


@cache
def _fitted(loss_factor: float, w1: float, w2: float) -> tuple[Array, Array]:
    """Branches of a loss factor between two circular frequencies, see `Damping.branches`."""
    from scipy.optimize import nnls  # whose import takes long

    decades = math.log10(w2 / w1)
    w = np.geomspace(w1, w2, 5 + math.ceil(POINTS * decades))
    best, found = math.inf, (np.zeros(0), np.zeros(0))
    for count in range(1, 4 + math.ceil(PER_DECADE * decades)):
        for beyond in BEYOND:  # how far the outer times lie off the band
            reach = 10.0**beyond
            times = 1.0 / np.geomspace(w1 / reach, w2 * reach, count) if count > 1 else np.full(1, (w1 * w2) ** -0.5)
            x = w[:, None] * times
            rows = (x / loss_factor - x * x) / (1.0 + x * x)  # their loss factor is the wanted one where rows @ g = 1
            share, _ = nnls(rows, np.ones(len(w)))
            off = float(np.abs(_loss(w, share, times) / loss_factor - 1.0).max())
            if off < best:
                best, found = off, (share[share > 0.0], times[share > 0.0])
        if best <= FIT:
            break
    return found


LOADS[Damping.__name__] = Damping
