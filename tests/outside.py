"""What a scene with something from outside the package must stand: devices, model files, states, batches, rates."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impacts import begun, finished, result_of
from undrawn import draw_nothing

import warp_mca as mca
from warp_mca.base import outside
from warp_mca.cli.main import main
from warp_mca.phases.checkpoint import Checkpoint
from warp_mca.results.storage import load
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


def striking(box: mca.Mesh, material: Any, speed: float, **bar: Any) -> mca.Scene:
    """A bar of 20 x 5 x 5 mm flies along x against a rigid block and yields there; its cells grow along x.

    `box` has it in even cells from the origin, `bar` has other fields of its body.
    """
    points = box.points.copy()
    points[:, 0] = 0.02 * (1.0 - (1.0 - points[:, 0] / 0.02) ** 2)
    body = {"geometry": replace(box, points=points), "material": material, "velocity": (speed, 0.0, 0.0)}
    block = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2), origin=(0.02, -0.0025, -0.0025))
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    slave, master = mca.Surface(body="bar", nodes="xmax"), mca.Surface(body="block", nodes="xmin")
    return mca.Scene(
        name="striking",
        bodies=(
            mca.Body(name="bar", **body, **bar),
            mca.Body(name="block", geometry=block, material=steel, rigid=True),
        ),
        contacts=(mca.Contact(slave=slave, master=master, penalty=0.05),),
        impact=mca.ImpactPhase(duration=1e-5, output_interval=1e-6, time_step_scale=0.2),
    )


def own_law(monkeypatch: pytest.MonkeyPatch, folder: Path, file: str, table: dict, kind: str, script: str) -> str:
    """A test's file as the module `own_law` of a folder, beside the scene file block.py, as another process finds them.

    Args:
        file: of the test. table, kind: where the class that the file registers stands, and its name.
        script: what follows the import of `own_law` in block.py.
    """
    draw_nothing(monkeypatch)
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(outside, "_IMPORTED", {})
    monkeypatch.delitem(sys.modules, "own_law", raising=False)
    monkeypatch.delitem(table, kind)
    shutil.copy(file, "own_law.py")
    Path("block.py").write_text(f"from own_law import {kind}, block\n\n{script}\n")
    return "own_law"


def runs_on(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    table: dict,
    kind: str,
    duration: str,
    interval: str,
) -> mca.Result:
    """The result of block.py with `own_law`; from a model file, and stopped at a checkpoint and resumed, equal bits."""
    run = ["--import", "own_law", "--duration", duration]
    assert main(["run", "block.py", "--out", "whole", *run]) == 0
    assert main(["build", "block.py", "-o", "block.mca"]) == 0
    del table[kind]
    assert main(["run", "block.mca", "--out", "file"]) == 2
    assert "by --import own_law" in capsys.readouterr().err
    monkeypatch.delitem(sys.modules, "own_law")
    assert main(["run", "block.mca", "--out", "file", *run]) == 0
    store = Checkpoint.store

    def store_and_stop(self: Checkpoint, *args: object, **more: object) -> None:
        store(self, *args, **more)  # pyright: ignore[reportArgumentType]
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "store", store_and_stop)
        assert main(["run", "block.mca", "--out", "again", "--checkpoint", interval, *run]) == 130
    assert main(["resume", "again", "--import", "own_law"]) == 0
    whole = load("whole")
    assert same(load("file"), whole) and same(load("again"), whole)
    return whole
