"""Sizes of cells from the walls of a CAD part: thickness behind its faces, the time that takes, and no slivers."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from parts import PHONE, write_phone

import warp_mca as mca
from warp_mca.geometry.cad_walls import face_thickness

SIDES = (120.0, 70.0, 9.0)  # of a slab whose edges are rounded, as those of a phone are [mm]
ROUND = 2.0
SECONDS = 8.0  # of one core: it takes 1.3, and took 19 when each ray was held against each of 43,000 triangles


def test_a_slab_with_round_edges_has_its_thickness_soon():
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for name, value in (("General.Terminal", 0), ("Mesh.MeshSizeMax", 3.5), ("Mesh.MeshSizeFromCurvature", 12)):
            gmsh.option.setNumber(name, value)
        slab = gmsh.model.occ.addBox(0, 0, 0, *SIDES)
        gmsh.model.occ.synchronize()
        gmsh.model.occ.fillet([slab], [edge for _, edge in gmsh.model.getEntities(1)], [ROUND])
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(2)
        start = time.process_time()
        thickness = face_thickness(gmsh.model)
        taken = time.process_time() - start
        boxes = {face: gmsh.model.getBoundingBox(2, face) for face in thickness}
    finally:
        gmsh.finalize()
    assert len(thickness) == 26
    for axis, side in enumerate(SIDES):
        flat = [face for face, box in boxes.items() if box[axis + 3] - box[axis] < 0.1]
        assert [thickness[face] for face in flat] == pytest.approx([side, side], rel=1e-6)
    assert taken < SECONDS


def test_a_plate_has_no_sliver(tmp_path: Path):
    """HXT leaves one in the glass, 16 times as flat as half of the cells, and Delaunay's algorithm some 34 times."""
    mesh = mca.Cad(write_phone(tmp_path), across=1.0, solids=("glass",)).build()
    corners = mesh.points[mesh.others["tetra10"][:, :4]]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
    face = [corners[:, [a, b, c]] for a, b, c in ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))]
    area = [0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) for x in face]
    height = 3.0 * volume / np.max(area, axis=0)
    assert volume.sum() == pytest.approx(1e-9 * PHONE["glass"], rel=1e-6)
    assert height.min() > np.median(height) / 5.0


def test_a_foil_that_takes_long_is_told_of_before_it_is_meshed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    file = write_phone(tmp_path)
    part = mca.Cad(file, across=1.0, solids=("glass",))
    monkeypatch.setattr("warp_mca.geometry.cad._MANY", 100.0)
    count = part.build().cell_count
    (told,) = caplog.messages
    number, size = (float(told.split(word)[0].split()[-1]) for word in (" million", " m wide"))
    assert told.startswith("phone.step gets some") and size == pytest.approx(1e-3)
    assert number == pytest.approx(1e-6 * count, rel=0.3)
