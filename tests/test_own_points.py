"""Elements of the user's own with any number of integration points: each has rows of the history, none has others'."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import linear_tet_kernels
import numpy as np
import pytest
from impacts import begun, finished, result_of
from linear_tet import LinearTet

import warp_mca as mca
from warp_mca.kernels.elements import hourglass
from warp_mca.kernels.materials.laws import HISTORY_SIZE
from warp_mca.physics.elements import ELEMENTS
from warp_mca.physics.elements.stage import ElementStage

METAL = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=50e6, E_t=1e9)
LAST = 8  # point that flows


@pytest.fixture(scope="module")
def kernels(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """Those of `linear_tet`, whose history is that of point LAST."""
    source = Path(str(linear_tet_kernels.__file__)).read_text()
    for name in ("history", "history_out"):
        assert f"plastic_strain({name}, 0, e" in source
        source = source.replace(f"plastic_strain({name}, 0, e", f"plastic_strain({name}, {LAST}, e")
    path = tmp_path_factory.mktemp("kernels") / "last_point_kernels.py"
    path.write_text(source)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def scene(monkeypatch: pytest.MonkeyPatch, kernels: ModuleType, points: int) -> mca.Scene:
    """A bar that flows where it strikes a wall, of elements with so many points."""

    class Own(LinearTet):
        name = f"own{points}"

        def stage(self, block, X, precision):
            return ElementStage(block, precision, kernels, points=points)

    monkeypatch.setitem(ELEMENTS, Own.name, Own())
    box = mca.Box(size=(0.02, 0.005, 0.005), divisions=(8, 2, 2))
    bar = mca.Body(name="bar", geometry=box, material=METAL, element=Own.name, velocity=(30.0, 0.0, 0.0))
    wall = mca.RigidPlane(point=(0.02, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="bar", nodes="xmax"), master=wall)
    impact = mca.ImpactPhase(duration=6e-6, output_interval=1e-6)
    return mca.Scene(name="bar", bodies=(bar,), contacts=(contact,), impact=impact)


def test_a_point_has_rows_of_its_own(monkeypatch: pytest.MonkeyPatch, kernels: ModuleType):
    """However many points there are besides; all that reads the history finds it there."""
    impacts = [finished(scene(monkeypatch, kernels, points)) for points in (LAST + 1, 27)]
    summaries = [result_of(impact).summary for impact in impacts]
    first, second = (impact.state.elements[0].history.numpy() for impact in impacts)
    rows = slice(LAST * HISTORY_SIZE, (LAST + 1) * HISTORY_SIZE)
    assert len(first) == rows.stop and len(second) == 27 * HISTORY_SIZE
    assert not np.delete(first, np.r_[rows], axis=0).any() and not np.delete(second, np.r_[rows], axis=0).any()
    assert np.array_equal(first[rows], second[rows])
    assert summaries[0]["max_plastic_strain"] == first[-1].max() > 1e-3
    assert summaries[1]["max_plastic_strain"] == first[-1].max()
    assert summaries[0]["energy"] == summaries[1]["energy"]
    assert summaries[0]["energy"]["plastic"] > 0.0 and summaries[0]["energy_error"] < 1e-2


@pytest.mark.parametrize("points", [1, LAST])
def test_a_point_without_rows_stops_the_run(points: int, monkeypatch: pytest.MonkeyPatch, kernels: ModuleType):
    with pytest.raises(mca.GuardError, match="not a number"):
        mca.run(scene(monkeypatch, kernels, points))


def test_plastic_strains_of_all_points_turn_with_the_element(monkeypatch: pytest.MonkeyPatch, kernels: ModuleType):
    """A quarter turn about z exchanges xx and yy, and yz takes the place of xz."""
    stage = begun(scene(monkeypatch, kernels, 3)).solver.elements[0]
    history = np.arange(1.0, 3.0 * HISTORY_SIZE + 1.0)[:, None] * [[1.0, 2.0]]
    turned = stage.rotated(history, np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]] * 2))
    xx, yy, xy, yz, xz, p = history.reshape(3, HISTORY_SIZE, 2).transpose(1, 0, 2)
    expected = np.stack([yy, xx, -xy, xz, -yz, p], axis=1).reshape(history.shape)
    np.testing.assert_allclose(turned, expected, atol=1e-12)


def test_a_history_with_too_few_rows_is_refused(monkeypatch: pytest.MonkeyPatch, kernels: ModuleType):
    block = begun(scene(monkeypatch, kernels, 2)).solver.elements[0].block
    with pytest.raises(mca.RequestError, match="Rows of the history of element own2 = 17: give at least 18"):
        ElementStage(block, "mixed", kernels, points=3, rows=17)
    with pytest.raises(mca.RequestError, match=r"give at least 18, for 1 points of 6 and 4 vectors of 3"):
        kernels.VECTORS = hourglass.VECTORS  # type: ignore[attr-defined]
        try:
            ElementStage(block, "mixed", kernels, points=1, rows=6)
        finally:
            del kernels.VECTORS  # type: ignore[attr-defined]
