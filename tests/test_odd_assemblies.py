"""Solids that overlap far, lie in each other, or touch at an edge or a point; faces without a solid: none is taken for
something else silently."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from impacts import prepared
from test_assembly import drawn

import warp_mca as mca

BLOCK = (0, 0, 0, 20, 20, 5)  # mm


def assembly(file: Path, how: str) -> mca.Assembly:
    """Its solids, joined by pairs."""
    return mca.Assembly(file, materials={"*": mca.library.ABS}, size=4e-3, join={"*": how})


def scene(parts: mca.Assembly) -> mca.Scene:
    """At rest in space."""
    impact = mca.ImpactPhase(duration=1e-6)
    return mca.Scene(name="odd", bodies=parts.bodies, contacts=parts.contacts, impact=impact)


@pytest.mark.parametrize("off", [-0.1, 0.05])
def test_a_tie_spans_the_gap_or_overlap_of_the_file_on_every_face(tmp_path: Path, off: float):
    """A third of the nodes was left free where the overlap was a twentieth of the edges of smaller faces."""
    parts = assembly(drawn(tmp_path / "off.step", BLOCK, (0, 0, 5 + off, 20, 20, 5)), "tie")
    model = prepared(scene(parts)).model
    (tied,) = (item for item in model.passes if item.bonds is not None)
    assert tied.bonds is not None
    held = tied.slave[tied.bonds.face >= 0]
    x, y, z = model.X[tied.slave].T
    joint = np.abs(z - 5e-3) < 1.5e-4
    assert np.array_equal(np.sort(held), tied.slave[joint]) and len(held) > 50
    assert np.ptp(x[joint]) == pytest.approx(0.02) and np.ptp(y[joint]) == pytest.approx(0.02)


@pytest.mark.parametrize("place", [(20, 20, 0), (20, 20, 5)])
def test_a_tie_at_an_edge_or_a_point_is_refused(tmp_path: Path, place: tuple[float, float, float]):
    """The bodies turned about it like doors."""
    parts = assembly(drawn(tmp_path / "edge.step", BLOCK, (*place, 20, 20, 5)), "tie")
    assert [touch.gap for touch in parts.touching] == [0.0]
    with pytest.raises(mca.RequestError, match=r"nodes that its bond holds = \d+: they lie in a line"):
        prepared(scene(parts))


def test_a_solid_within_another_one_is_not_glued(tmp_path: Path):
    """Its mass and its material were lost."""
    parts = assembly(drawn(tmp_path / "inside.step", BLOCK, (5, 5, 1, 5, 5, 2)), "glue")
    (body,) = parts.bodies
    assert isinstance(body.geometry, mca.Cad)
    with pytest.raises(mca.RequestError, match="solid_2 lies in the solids before it"):
        body.geometry.build()


def test_faces_without_a_solid_are_told(tmp_path: Path):
    import gmsh

    file = tmp_path / "shell.step"
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(*BLOCK)
        gmsh.model.occ.addRectangle(0, 0, 10, 20, 20)
        gmsh.model.occ.synchronize()
        gmsh.write(str(file))
    finally:
        gmsh.finalize()
    mesh = mca.Cad(file, size=8e-3).build()
    assert mesh.notes == ("faces of shell.step that bound no solid are left out: 1",)
    assert np.ptp(mesh.points[:, 2]) == pytest.approx(5e-3)


def test_an_overlap_is_told_where_it_is(tmp_path: Path):
    """The middle of what a pressed sleeve shares with its shaft lies on the axis, outside of the sleeve."""
    import gmsh

    file, r, over = tmp_path / "sleeve.step", 5.0, 0.1
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 20, r + over)
        sleeve, bore = (gmsh.model.occ.addCylinder(0, 0, 5, 0, 0, 10, radius) for radius in (8.0, r))
        gmsh.model.occ.cut([(3, sleeve)], [(3, bore)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(file))
    finally:
        gmsh.finalize()
    (touch,) = mca.Assembly(file, materials={"*": mca.library.ABS}, size=4e-3).touching
    x, y, z = touch.at
    assert r <= 1e3 * np.hypot(x, y) * (1.0 + 1e-9) <= r + over
    assert z == pytest.approx(10e-3)
    assert touch.depth == pytest.approx(1e-3 * over, rel=0.02)
