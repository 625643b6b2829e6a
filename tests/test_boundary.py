"""The boundary of meshes against counting every face by its set of nodes."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.geometry.boundary import boundary_faces
from warp_mca.geometry.cell_types import CELL_TYPES
from warp_mca.geometry.degenerate import tetrahedral
from warp_mca.geometry.quality import check
from warp_mca.verify.small_meshes import mixed_cube


def meshes() -> dict[str, mca.Mesh]:
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(7, 6, 5)).build()
    renumbered = np.random.default_rng(2).permutation(len(box.points)).astype(np.int32)
    fan = np.array([[0, k, k + 1, 0, 20, 20 + k, 21 + k, 20] for k in range(1, 19)], np.int32)  # wedges around a line
    solid = box.hexahedra
    return {
        "box": box,
        "one": mca.Mesh(box.points, solid[:1]),
        "in any order": mca.Mesh(box.points, renumbered[np.random.default_rng(3).permutation(solid)]),
        "mixed": mixed_cube(),
        "tetrahedra": tetrahedral(mixed_cube()),
        "fan": mca.Mesh(np.zeros((40, 3)), fan),
        "hollow": mca.Mesh(box.points, np.delete(solid, 100, axis=0)),
        "twice": mca.Mesh(box.points, np.concatenate([solid, solid[3:4], solid[100:102], solid[100:101]])),
    }


def counted(mesh: mca.Mesh) -> set[tuple[int, frozenset[int]]]:
    """Cell and nodes of each face that no other cell has."""
    faces, first = [], 0
    for name, cells in mesh.cells.items():
        for k, cell in enumerate(cells):
            faces += [(first + k, frozenset(cell[list(face)].tolist())) for face in CELL_TYPES[name].faces]
        first += len(cells)
    count = Counter(nodes for _, nodes in faces)
    return {(cell, nodes) for cell, nodes in faces if count[nodes] == 1 and len(nodes) > 2}


@pytest.mark.parametrize("name", meshes())
def test_faces_of_one_cell_are_found(name: str):
    mesh = meshes()[name]
    faces, owner = mesh.boundary
    found = [(cell, frozenset(nodes)) for cell, nodes in zip(owner.tolist(), faces.tolist(), strict=True)]
    assert len(found) == len(set(found))
    assert set(found) == counted(mesh)
    triangles = np.array([len(nodes) == 3 for _, nodes in found])
    np.testing.assert_array_equal(faces[:, 2] == faces[:, 3], triangles)
    assert np.array_equal(owner, np.sort(owner))


def test_faces_look_outwards():
    """Their areas enclose the volume: sum of x . n A / 3."""
    mesh = mixed_cube()
    p = mesh.points[boundary_faces(mesh.cells, len(mesh.points))[0]]
    normal = 0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    assert (normal * p.mean(axis=1)).sum() / 3.0 == pytest.approx(1.0, rel=1e-12)


def test_a_set_of_the_mesh_may_go_by_the_name_of_the_whole_skin():
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)).build()
    assert len(box.surface("boundary")[0]) == 24
    named = mca.Mesh(box.points, box.hexahedra, {"boundary": box.nodes("xmin")})
    assert len(named.surface("boundary")[0]) == 4


def test_cells_on_the_same_side_of_a_face_are_found():
    """A wedge within a hexahedron; tetrahedra on the same side of a triangle; not those on both."""
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 1, 1)).build()
    inner = box.hexahedra[1][[0, 1, 2, 0, 4, 5, 6, 4]]
    cells = np.concatenate([box.hexahedra, inner[None]])
    assert mca.Mesh(box.points, cells).overlapping.tolist() == [1, 2]
    with pytest.raises(
        RequestError, match=r"^body a: Mesh cells = \[1, 2\]: these two cells lie on the same side of a"
    ):
        check(mca.Mesh(box.points, cells), "a")
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 2], [0, 0, -1]], float)
    none, both, same = np.zeros((0, 8), np.int32), [[0, 1, 2, 3], [0, 2, 1, 5]], [[0, 1, 2, 3], [0, 1, 2, 4]]
    for pair, found in ((both, []), (same, [0, 1])):
        assert mca.Mesh(corners, none, tetrahedra=np.array(pair, np.int32)).overlapping.tolist() == found
    assert all(not len(mesh.overlapping) for name, mesh in meshes().items() if name != "twice")
    assert meshes()["twice"].overlapping.tolist() == [3, 210]
