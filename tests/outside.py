"""What a scene with something from outside the package must stand: devices, model files, states, batches, rates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from impacts import begun, finished, result_of

import warp_mca as mca
from warp_mca.scene import model_file


def holds_up(scene: mca.Scene, device: str, folder: Path, *, tolerance: float = 1e-4) -> mca.Result:
    """The result of an impact of one contact, on `device`.

    Its energy balance closes to `tolerance`. From a model file, from a saved state and in a batch it gives the same
    bits; with several rates the same impulse to 2 %.
    """
    result = result_of(finished(scene, device=device))
    assert result.F_n.max() > 0.0 and result.summary["energy_error"] < tolerance

    goes_on(scene, folder, device)
    assert all(same(other, result) for other in mca.run_batch([scene, scene], device=device))
    rates = mca.run(scene, device=device, multi_rate=2)
    assert rates.summary["rate_groups"]
    impulse = [float(r.F_n.sum()) for r in (rates, result)]
    assert impulse[0] == pytest.approx(impulse[1], rel=0.02)
    return result


def goes_on(scene: mca.Scene, folder: Path, device: str = "cpu") -> None:
    """A model file holds the scene; its run goes on from a state that the scene's run saved, to the same bits."""
    impact = begun(scene, device=device)
    model_file.save(folder / "scene.mca", scene, impact.ready[0].meshes)
    stored = model_file.load(folder / "scene.mca")
    assert stored.scene.loads == scene.loads
    impact.advance(until=impact.steps.count // 2)
    impact.save(folder / "middle.state")
    impact.advance()
    later = begun(stored.scene, device=device, meshes=stored.meshes)
    later.load(folder / "middle.state")
    later.advance()
    assert later.state.differences(impact.state) == []


def same(one: mca.Result, other: mca.Result) -> bool:
    """Whether two histories have the same bits."""
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in other.history)
