"""Meshes from files of other programs: what is read, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from recipes import area

from warp_mca.base.errors import RequestError
from warp_mca.geometry import Box, Mesh, MeshFile
from warp_mca.geometry.quality import check, volumes


def read_back(path: Path, mesh, **options) -> Mesh:
    import meshio

    meshio.write(path, mesh, **options)
    return MeshFile(path=path).build()


def as_meshio(mesh: Mesh, **extra):
    import meshio

    return meshio.Mesh(mesh.points, [("quad", mesh.surface("xmin")[0]), ("hexahedron", mesh.hexahedra)], **extra)


def test_mesh_file_binary_msh_with_physical_groups(tmp_path: Path):
    box = Box(size=(1.0, 2.0, 3.0), divisions=(2, 3, 4)).build()
    tags = [np.full(3 * 4, 7), np.where(np.arange(24) < 10, 1, 2)]
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    names = {"wall": np.array([7, 2]), "soft": np.array([1, 3])}
    written = as_meshio(box, cell_data=data, field_data=names)
    mesh = read_back(tmp_path / "box.msh", written, file_format="gmsh22", binary=True)
    assert np.array_equal(mesh.points, box.points)
    assert np.array_equal(mesh.hexahedra, box.hexahedra)
    assert np.array_equal(mesh.nodes("wall"), np.sort(box.nodes("xmin")))
    assert np.array_equal(mesh.cell_sets["soft"], np.arange(10))
    assert np.array_equal(mesh.cell_sets["physical_2"], np.arange(10, 24))


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("floor", ["floor", "column"])
def test_mesh_file_written_by_gmsh_itself(tmp_path: Path, version: float, binary: int, floor: str):
    """A surface may have the name of the volume: the sets of nodes and of cells then share it."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        square = gmsh.model.occ.addRectangle(0.0, 0.0, 0.0, 1.0, 1.0)
        swept = gmsh.model.occ.extrude([(2, square)], 0.0, 0.0, 2.0, numElements=[3], recombine=True)
        gmsh.model.occ.synchronize()
        for _, curve in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(curve, 3)
        gmsh.model.mesh.setTransfiniteSurface(square)
        gmsh.model.mesh.setRecombine(2, square)
        gmsh.model.addPhysicalGroup(2, [square], name=floor)
        gmsh.model.addPhysicalGroup(3, [swept[1][1]], name="column")
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "column.msh"))
    finally:
        gmsh.finalize()
    mesh = MeshFile(path=str(tmp_path / "column.msh")).build()
    check(mesh, "column")
    assert volumes(mesh).sum() == pytest.approx(2.0)
    assert area(mesh, floor) == pytest.approx(1.0)
    assert not any(name.startswith("physical") for name in (*mesh.node_sets, *mesh.cell_sets))
    assert np.array_equal(mesh.cell_sets["column"], np.arange(len(mesh.hexahedra)))


def test_groups_of_med_files(tmp_path: Path):
    """A cell may be in several; a group may have several families, of faces, cells or points."""
    import meshio

    box = Box(size=(2.0, 1.0, 1.0), divisions=(4, 1, 1)).build()
    file = tmp_path / "box.med"
    made = as_meshio(box, cell_data={"cell_tags": [np.array([-1]), np.array([-2, -2, -3, 0])]})
    made.point_data["point_tags"] = np.where(box.points[:, 0] == 2.0, 5, 0)
    made.cell_tags = {-1: ["wall"], -2: ["left", "all"], -3: ["all"]}
    made.point_tags = {5: ["end"]}
    meshio.write(file, made)
    mesh = MeshFile(file).build()
    assert {name: cells.tolist() for name, cells in mesh.cell_sets.items()} == {"left": [0, 1], "all": [0, 1, 2]}
    assert (mesh.points[mesh.nodes("wall"), 0] == 0.0).all() and len(mesh.nodes("wall")) == 4
    assert (mesh.points[mesh.nodes("end"), 0] == 2.0).all() and len(mesh.nodes("end")) == 4


def test_mesh_file_vtu(tmp_path: Path, capfd):
    box = Box(size=(1.0, 2.0, 3.0), divisions=(2, 3, 4)).build()
    mesh = read_back(tmp_path / "box.vtu", as_meshio(box))
    assert np.array_equal(mesh.points, box.points)
    assert np.array_equal(mesh.hexahedra, box.hexahedra)
    assert capfd.readouterr() == ("", "")


def test_mesh_file_point_and_cell_sets(tmp_path: Path):
    box = Box(size=(1.0, 1.0, 1.0), divisions=(2, 1, 1)).build()
    sets = {"point_sets": {"pins": np.array([0, 4])}, "cell_sets": {"left": [np.array([], int), np.array([0])]}}
    mesh = read_back(tmp_path / "box.inp", as_meshio(box, **sets))
    assert mesh.nodes("pins").tolist() == [0, 4]
    assert mesh.cell_sets["left"].tolist() == [0]


def test_a_refusal_gives_the_reason_of_meshio(tmp_path: Path):
    """Files of gmsh were told to become what they were; some readers print their reason and exit, others raise it."""
    for line, reason in (("9.9 0 8", "Need mesh format in"), ("4.1 0 8\n$EndMeshFormat", "Element section not found")):
        (tmp_path / "it.msh").write_text(f"$MeshFormat\n{line}\n")
        with pytest.raises(
            RequestError, match=rf"\(.*{reason}.*\); save it in gmsh's format 4.1 with Mesh.SaveAll off"
        ):
            MeshFile(tmp_path / "it.msh").build()


def test_mesh_file_refusals(tmp_path: Path, capfd):
    import meshio

    box = Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build()
    cases = {
        "no volume cells": [("quad", box.surface("xmin")[0])],
        "nodes beyond its 8 points": [("hexahedron", box.hexahedra + 1)],
    }
    for message, cells in cases.items():
        with pytest.raises(RequestError, match=message):
            read_back(tmp_path / "case.vtu", meshio.Mesh(box.points, cells))
    tags = {name: [np.array([1])] for name in ("gmsh:physical", "gmsh:geometrical")}
    cubic = meshio.Mesh(np.eye(20, 3), [("tetra20", [np.arange(20)])], cell_data=tags)
    with pytest.raises(RequestError, match="it holds tetra20; save it with linear cells"):
        read_back(tmp_path / "case.msh", cubic, file_format="gmsh22")
    with pytest.raises(RequestError, match="not finite"):
        read_back(tmp_path / "case.vtu", meshio.Mesh(box.points * math.nan, [("hexahedron", box.hexahedra)]))
    with pytest.raises(RequestError, match="no such file"):
        MeshFile(path=tmp_path / "none.vtu").build()
    for name in ("broken.vtu", "broken.msh", "broken.unknown"):
        (tmp_path / name).write_text("nonsense")
        with pytest.raises(RequestError, match="cannot read it"):
            MeshFile(path=tmp_path / name).build()
    (tmp_path / "empty.msh").write_bytes(b"")
    with pytest.raises(RequestError, match=r"meshio cannot read it \(it is empty\)"):
        MeshFile(path=tmp_path / "empty.msh").build()
    assert capfd.readouterr() == ("", "")
