"""Owns what a run says of the mass that mass scaling added."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.model.mass_scaling import added_shares, peak_error, striking_body

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.scene import Scene


def mass_report(scene: Scene, model: Model) -> dict[str, object]:
    """Keys of the summary of a scene with mass scaling; none without.

    Args:
        scene: of the run.
        model: of that scene alone.
    """
    scaling = model.scaling
    if scaling is None:
        return {}
    shares = added_shares(scene, model.node_start, model.mass, scaling.added)
    speed = np.linalg.norm(model.V, axis=1)
    plain = model.mass - scaling.added

    def changed(power: int) -> float:
        """Change of the sum of m v^power at the start, as a share of it [-]; 0 at rest."""
        before = float(plain @ speed**power)
        return float(scaling.added @ speed**power) / before if before > 0.0 else 0.0

    body = striking_body(scene, shares)
    return {
        "mass_added": shares,
        "mass_scaling": {
            "asked": scene.impact.mass_scaling,
            "plain_stable_dt": scaling.plain_dt,
            "elements": scaling.elements,
            "greatest": max(shares.values()),
            "striking_body": body,
            "striking": shares[body],
            "momentum": changed(1),
            "kinetic_energy": changed(2),
            "F_n_first_peak": peak_error(scene, model.node_start, model.mass, scaling.added),
        },
    }
