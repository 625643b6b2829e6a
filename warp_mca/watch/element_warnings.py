"""Owns what a finished run says of elements whose figures are less sure than they look."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.scene import Scene
    from warp_mca.watch.ledger import Ledger

COROTATIONAL_STRAIN = 0.1  # beyond this, small strain in a rotated frame is off by a tenth of itself
COROTATIONAL_VOLUME = 0.15  # loss of volume, which goes with that strain where bodies cannot give way sideways
NOISE = 0.02  # pressure that rounding shakes up, as a share of stress, from which on a word is said
ROUNDING = 1.4 * 2.0**-24  # of dilatation in float32 in each step, over the strain; measured, see docs/decisions.md


def element_warnings(scene: Scene, model: Model, ledger: Ledger, steps: int) -> list[str]:
    """What a run's elements leave in doubt, one sentence each.

    Args:
        scene: that was run. model: of the scene alone. ledger: of the run.
        steps: that it took.
    """
    found = list(_large_strain(scene, ledger))
    if ledger.precision == "mixed":
        found += _shaken_pressure(model, ledger.kept.max_strain, steps)
    return found


def _large_strain(scene: Scene, ledger: Ledger) -> Iterator[str]:
    small = [body.name for body in scene.bodies if body.kinematics == "corotational"]
    if not small:
        return
    where = "" if len(small) == len(scene.bodies) else f", if that was in {' or '.join(small)}"
    strain, lost = ledger.kept.max_strain, 1.0 - ledger.kept.min_jacobian
    if strain > COROTATIONAL_STRAIN:
        yield (
            f"strain reached {strain:.2f}; the co-rotational element takes strains as small, expect stresses off by as "
            f"much where it exceeds {COROTATIONAL_STRAIN}, or choose kinematics='finite'{where}"
        )
    elif lost > COROTATIONAL_VOLUME:
        yield (
            f"elements lost up to {lost:.0%} of their volume; the co-rotational element takes strains as small, expect "
            f"stresses off by as much there, or choose kinematics='finite'{where}"
        )


def _shaken_pressure(model: Model, strain: float, steps: int) -> Iterator[str]:
    """Rounding of the dilatation pushes volumes to and fro in each step: a random walk of pressure, K r e sqrt(n)."""
    for K, G, yield_stress in np.pad(model.law, ((0, 0), (0, 1)))[:, :3]:
        stress = min(3.0 * G * strain, yield_stress) if yield_stress > 0.0 else 3.0 * G * strain
        noise = K * ROUNDING * strain * math.sqrt(steps)
        if noise > NOISE * stress > 0.0:
            nu = (3.0 * K - 2.0 * G) / (6.0 * K + 2.0 * G)
            limit = "the yield stress" if stress == yield_stress else "the greatest stress"
            yield (
                f"in {steps:,} steps, rounding in mixed precision shakes up pressures of some {noise:.2g} Pa, "
                f"{noise / stress:.0%} of {limit}, where Poisson's ratio is {nu:.4g}: choose --precision float64"
            )
