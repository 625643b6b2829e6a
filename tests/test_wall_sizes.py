"""Sizes of cells from the walls of a CAD part: thickness behind its faces, and the time that takes."""

from __future__ import annotations

import time

import pytest

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
