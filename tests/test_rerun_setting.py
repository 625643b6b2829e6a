"""Tests where the views of a rerun recording look, its planes, and that scenes do not share a layout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flying_bars import DT, STEPS, FlyingBars
from rrd import rows
from test_rerun import record

import warp_mca as mca
from warp_mca.recorders.rerun_setting import sights

BELT = mca.RigidPlane(point=(0.0, 0.0, -0.001), normal=(0.0, 0.0, 1.0), velocity=(2.0, 0.0, 0.0))
UP, DOWN = 1, 2  # of rerun's ViewDir
LOWER = mca.Surface(body="lower", nodes="zmin")


def test_the_contact_view_looks_at_the_slave_from_outside():
    bars = FlyingBars(contacts=(mca.Contact(slave=LOWER, master=BELT),))
    up, bounds, focus, reach = sights(bars.info)
    np.testing.assert_array_equal(up, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(bounds, [[0.0, 0.0, 0.0], [0.1, 0.03, 0.01]], atol=1e-12)
    assert focus is not None
    np.testing.assert_allclose(focus, [[0.05, 0.005, 0.0], [0.0, 0.0, -1.0]], atol=1e-9)
    assert reach == pytest.approx(np.hypot(0.1, 0.01))


def test_of_several_contacts_the_first_one_is_looked_at():
    far = mca.RigidPlane(point=(0.0, -0.5, 0.0))
    master = mca.Surface(body="upper bar", nodes="ymin")
    contacts = (
        mca.Contact(slave=mca.Surface(body="lower", nodes="ymin"), master=far),
        mca.Contact(slave=mca.Surface(body="lower", nodes="ymax"), master=master),
    )
    focus = sights(FlyingBars(contacts=contacts).info).focus
    assert focus is not None
    np.testing.assert_allclose(focus, [[0.05, 0.01, 0.005], [0.0, 1.0, 0.0]], atol=1e-9)


def test_scenes_without_contacts_have_no_view_of_one(bars: FlyingBars):
    assert sights(bars.info).focus is None


def test_a_belt_is_drawn_and_moves(tmp_path: Path):
    bars = FlyingBars(contacts=(mca.Contact(slave=LOWER, master=BELT),))
    record(tmp_path / "a.rrd", bars)
    plane = "/world/planes/0"
    ((static, _, points),) = rows(tmp_path / "a.rrd", plane, "Mesh3D:vertex_positions")
    assert static
    np.testing.assert_allclose(np.array(points)[:, 2], -0.001, atol=1e-9)
    moved = {step: value for _, step, value in rows(tmp_path / "a.rrd", plane, "Transform3D:translation")}
    assert len(moved) == 9
    np.testing.assert_allclose(moved[3 * STEPS][0], [2.0 * 3 * STEPS * DT, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(("gravity", "axis", "word"), [((0.0, 0.0, -9.8), 2, UP), ((0.0, 9.8, 0.0), 1, DOWN)])
def test_the_world_says_what_is_up(tmp_path: Path, gravity: tuple[float, float, float], axis: int, word: int):
    record(tmp_path / "a.rrd", FlyingBars(gravity=gravity))
    ((static, _, found),) = rows(tmp_path / "a.rrd", "/world", "ViewCoordinates:xyz")
    assert static
    assert np.ravel(found)[axis] == word


def test_each_scene_has_an_application_of_its_own(tmp_path: Path):
    from rerun.chunk import RrdReader

    found = set()
    for name in ("one", "other"):
        record(tmp_path / f"{name}.rrd", FlyingBars(name=name))
        found |= {store.application_id for store in RrdReader(str(tmp_path / f"{name}.rrd")).recordings()}
    assert found == {"warp_mca one", "warp_mca other"}
