"""A run whose figures are known, in place of finite elements."""

from __future__ import annotations

import numpy as np

import warp_mca as mca


def fake(scene: mca.Scene, order: float = 1.5, share: float = 0.0, size: float = 0.02, **options: object) -> mca.Result:
    """A run whose first peak is 100 N (1 + size / R^order), whose other figures are exact, with a share of springs."""
    peak = 100.0 * (1.0 + size * scene.refine**-order)
    summary = {
        "F_n_peaks": [[1e-4, peak]],
        "contact_duration": 1e-3,
        "contact_open_at_end": False,
        "max_plastic_strain": 0.0,
        "contact_spring_share": {"it": share},
        "contact_spring_loss": {"it": -0.3 * share},
        "n_elements": 100,
        "n_steps": 100,
        "precision": "mixed",
        "device": "cpu",
        "simulated_time": scene.impact.duration,
    }
    return mca.Result(summary, {"time_s": np.array([1e-3]), "F_n_N": np.array([50.0])})
