"""What a scene with something from outside the package must stand: devices, model files, states, batches, rates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from impacts import begun, figures, finished, result_of

import warp_mca as mca
from warp_mca.scene import model_file


def holds_up(scene: mca.Scene, device: str, folder: Path, *, tolerance: float = 1e-4) -> mca.Result:
    """The result of an impact of one contact, on `device`.

    Its energy balance closes to `tolerance`. From a model file, from a saved state and in a batch it gives the same
    history; with several rates the same impulse to 2 %.
    """
    meshes = mca.mesh(scene)
    whole = finished(scene, device=device)
    result = result_of(whole)
    assert result.F_n.max() > 0.0 and result.summary["energy_error"] < tolerance

    model_file.save(folder / "scene.mca", scene, meshes)
    stored = model_file.load(folder / "scene.mca")
    assert same(mca.run(stored.scene, device=device, meshes=stored.meshes), result)

    paused, later = begun(scene, device=device), begun(scene, device=device)
    paused.advance(until=whole.steps.count // 2)
    paused.save(folder / "state")
    later.load(folder / "state")
    later.advance()
    again, known = figures(later), figures(whole)
    assert all(np.array_equal(again[name], known[name], equal_nan=True) for name in known)

    assert all(same(other, result) for other in mca.run_batch([scene, scene], device=device))
    rates = mca.run(scene, device=device, multi_rate=2)
    assert rates.summary["rate_groups"]
    impulse = [float(r.F_n.sum()) for r in (rates, result)]
    assert impulse[0] == pytest.approx(impulse[1], rel=0.02)
    return result


def same(one: mca.Result, other: mca.Result) -> bool:
    """Whether two histories have the same bits."""
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in other.history)
