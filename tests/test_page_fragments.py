"""Python blocks of pages that take names or files as known: they run on a small scene in place of large ones."""

from __future__ import annotations

import dataclasses
import inspect
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest

import warp_mca as mca
from benchmarks.pages import run_page
from warp_mca.geometry.refinement import refined_count
from warp_mca.recorders import UsdFile, VtkHdfFile

PAGES = ("accuracy.md", "batch.md", "hinges.md", "visualise.md")
STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
WALL = mca.RigidPlane(point=(0.2, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
SURFACE = mca.Surface(body="AB", nodes="xmax")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Bar:
    """A bar along x with one layer of small cells, which mass scaling is for."""

    cells: int = 20

    def build(self) -> mca.Mesh:
        """The mesh."""
        box = mca.Box(size=(0.2, 0.01, 0.01), divisions=(self.cells, 2, 2)).build()
        points = box.points.copy()
        points[np.isclose(points[:, 0], 0.1), 0] -= 0.18 / self.cells
        return dataclasses.replace(box, points=points)

    def refined(self, factor: float) -> Bar:
        """With more cells."""
        return Bar(cells=refined_count(self.cells, factor, even=True))


def small(**parameters: object) -> mca.Scene:
    """A rod with the name of a link strikes a wall."""
    return mca.Scene(
        name="small",
        bodies=(mca.Body(name="AB", geometry=Bar(), material=STEEL, velocity=(1.0, 0.0, 0.0)),),
        contacts=(mca.Contact(slave=SURFACE, master=WALL),),
        impact=mca.ImpactPhase(duration=6e-5, output_interval=1e-6),
        paths=(mca.Path(name="a", lines=(mca.Line(body="AB", start=(0.2, 0, 0), end=(0, 0, 0)),), spacing=0.01),),
        tip=mca.Point(body="AB", at=(0.1, 0.0, 0.0)),
        parameters=parameters,
    )


class Cycle(mca.Result):
    """A result that stands for one of several impacts."""

    def impact(self, number: int = 0) -> mca.Result:
        """Any of them."""
        return self


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every built-in scene becomes the small one, once its own parameters are checked; everything runs on the CPU."""
    make_scene, run_batch, sweep, tradeoff, run = mca.make_scene, mca.run_batch, mca.sweep, mca.tradeoff, mca.run

    def run_small(scene: mca.Scene, **options) -> mca.Result:
        if "accuracy" in options:  # takes minutes; tests/test_accuracy.py has it
            inspect.signature(run).bind(scene, **options)
            return MagicMock(spec=mca.Result, summary={"accuracy": {"estimate": {}}})
        return run(scene, **options)

    def made(name: str, **parameters) -> mca.Scene:
        make_scene(name, **parameters)
        return small(**parameters)

    def considered(scene: mca.Scene, **options) -> MagicMock:
        inspect.signature(tradeoff).bind(scene, **options)
        return MagicMock()

    result = mca.run(small(), device="cpu")
    values = {field.name: getattr(result, field.name) for field in dataclasses.fields(result)}
    monkeypatch.setattr(mca, "make_scene", made)
    monkeypatch.setattr(mca, "run", run_small)
    monkeypatch.setattr(mca, "run_batch", lambda scenes, device, out: run_batch(scenes, device="cpu"))
    monkeypatch.setattr(mca, "sweep", lambda scenes, **more: sweep(scenes, **more, device="cpu", workers=1))
    monkeypatch.setattr(mca, "tradeoff", considered)
    monkeypatch.setattr(mca, "load", lambda folder: Cycle(**values))


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("page", PAGES)
def test_blocks_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    if page == "visualise.md":
        plotter = pytest.importorskip("pyvista").Plotter
        monkeypatch.setattr(plotter, "show", lambda self: self.show_axes())  # no window
        recorders = [UsdFile(tmp_path / "two_link.usdc"), VtkHdfFile(tmp_path / "drop.vtkhdf")]
        mca.run(small(), device="cpu", recorders=recorders)
    given = {"mca": mca, "scene": small(), "tip": SURFACE, "top": WALL}
    given |= {"dataclasses": dataclasses, "refined_count": refined_count}
    assert run_page(page, tmp_path, given)
