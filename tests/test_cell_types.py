"""The table of cell types against geometry, VTK, meshio and gmsh."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import gmsh
import meshio
import numpy as np
import pytest

from warp_mca.geometry.cell_types import (
    CELL_TYPES,
    GMSH_ORDER,
    MAX_CORNERS,
    TETRA10,
    is_triangle,
    linear_type,
    stored_types,
)
from warp_mca.geometry.degenerate import cell_names, stored
from warp_mca.geometry.integrals import INTEGRALS

CORNERS = {  # of one cell of each type
    "hexahedron": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    "wedge": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]],
    "pyramid": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]],
    "tetrahedron": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
}
CORNERS["tetra10"] = CORNERS["tetrahedron"] + [
    [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0], [0, 0, 0.5], [0.5, 0, 0.5], [0, 0.5, 0.5]
]  # fmt: skip
VOLUME = {"hexahedron": 1.0, "wedge": 1.0 / 2.0, "pyramid": 1.0 / 3.0, "tetrahedron": 1.0 / 6.0, "tetra10": 1.0 / 6.0}


@pytest.mark.parametrize("name", stored_types())
def test_faces_close_the_cell_and_look_outwards(name: str):
    """Each edge bounds two faces, once in either direction; the faces enclose the volume by the divergence theorem."""
    cell = CELL_TYPES[name]
    sides = Counter(pair for face in cell.faces for pair in pairwise((*face, face[0])))
    assert set(sides.values()) == {1} and all((b, a) in sides for a, b in sides)
    if not cell.linear:  # whose faces have no parts
        assert {frozenset(edge) for edge in cell.edges} == {frozenset(side) for side in sides}
        assert len(cell.edges) == len(sides) // 2
    p = np.array(CORNERS[name], dtype=float)[cell.quads]
    normal = 0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    centre = np.array([np.mean([CORNERS[name][corner] for corner in face], axis=0) for face in cell.faces])
    assert (normal * centre).sum() / 3.0 == pytest.approx(VOLUME[name], rel=1e-12)
    assert is_triangle(cell.quads).tolist() == [len(face) == 3 for face in cell.faces]


@pytest.mark.parametrize("name", stored_types())
def test_edges_to_neighbours_are_right_handed(name: str):
    cell, x = CELL_TYPES[name], np.array(CORNERS[name], dtype=float)
    for corner, others in enumerate(cell.neighbours):
        assert np.linalg.det(x[list(others)] - x[corner]) > 0.1
        assert all(tuple(sorted((corner, other))) in {tuple(sorted(edge)) for edge in cell.edges} for other in others)


@pytest.mark.parametrize("name", stored_types())
def test_natural_coordinates_map_to_the_corners(name: str):
    linear = linear_type(name)
    natural, x = np.array(linear.natural, dtype=float), np.array(CORNERS[name], dtype=float)[: linear.corners]
    assert np.array_equal(x, (natural - natural.min()) / np.ptp(natural))


@pytest.mark.parametrize("name", CELL_TYPES)
def test_a_mirrored_cell_is_stored_upright(name: str):
    """With its volume, and under its own type, however it was numbered."""
    cell, x = CELL_TYPES[name], np.array(CORNERS[name], dtype=float)
    nodes = np.arange(cell.corners)[None]
    mirrored = nodes[:, list(cell.mirrored)]
    for given in [nodes] if name == "hexahedron" else [nodes, mirrored]:  # checks must find inverted hexahedra
        kept = stored(x, given, name)
        assert INTEGRALS[cell.stored_as].volumes(x[kept])[0] == pytest.approx(VOLUME[name], rel=1e-12)
        padded = np.pad(kept, ((0, 0), (0, max(0, MAX_CORNERS - kept.shape[1]))), constant_values=-1)
        assert cell.linear or cell_names(padded).tolist() == [name]
        assert np.array_equal(kept[0, cell.own_corners], nodes[0])
    reflected = (x * [-1.0, 1.0, 1.0])[list(cell.stored_corners)][None]
    assert INTEGRALS[cell.stored_as].volumes(reflected)[0] < 0.0
    order = np.array(cell.mirrored)[list(cell.stored_corners)]
    assert INTEGRALS[cell.stored_as].volumes((x * [-1.0, 1.0, 1.0])[order][None])[0] > 0.0


def test_codes_are_those_of_the_formats():
    assert {cell.meshio for cell in CELL_TYPES.values()} <= set(meshio._mesh.topological_dimension)
    for cell in CELL_TYPES.values():
        assert meshio._vtk_common.vtk_to_meshio_type[cell.vtk] == cell.meshio
        assert meshio._mesh.num_nodes_per_cell[cell.meshio] == cell.corners
    started = not gmsh.isInitialized()
    if started:
        gmsh.initialize(interruptible=False)
    try:
        for cell in CELL_TYPES.values():
            _, dimension, order, nodes, natural, _ = gmsh.model.mesh.getElementProperties(cell.gmsh)
            assert (dimension, order, nodes) == (3, 2 if cell.linear else 1, cell.corners)
            if cell is TETRA10:
                assert np.array_equal(np.reshape(natural, (10, 3))[list(GMSH_ORDER)], CORNERS[cell.name])
            if cell.natural:
                assert np.array_equal(np.ravel(natural), np.ravel(cell.natural))
    finally:
        if started:
            gmsh.finalize()
