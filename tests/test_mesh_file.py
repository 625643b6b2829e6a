"""Tests the final state by reading its files back with the formats' own readers."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from flying_bars import FlyingBars

import warp_mca as mca
from warp_mca.base.errors import McaError, RequestError
from warp_mca.geometry.cell_types import HEXAHEDRON
from warp_mca.model.build import build_model
from warp_mca.recorders import mesh_file
from warp_mca.recorders.mesh_file import COMPONENTS, FinalState, cells

INDEX = 7  # of the last frame


def write(file: Path, bars: FlyingBars, ok: bool = True) -> None:
    """What a run does with a recorder that takes two frames."""
    recorder = FinalState(file)
    recorder.start(bars.info)
    recorder.frame(bars.frame(0))
    last = bars.frame(INDEX)
    assert last.volume is not None
    recorder.frame(last)
    for field in (array for array in vars(last.volume).values() if array is not None):
        field[:] = -1.0  # the buffers of a frame are used again
    recorder.finish(ok)
    recorder.finish(False)


def read(file: Path, **options: str) -> meshio.Mesh:
    return meshio.read(file, **options)


def elements(bars: FlyingBars) -> np.ndarray:
    """In the order of the bars' meshes: both are alike."""
    one = mca.Box(size=(0.1, 0.01, 0.01), divisions=(10, 1, 1)).build()
    return np.concatenate([one.hexahedra, one.hexahedra + len(one.points)])


def check(found: meshio.Mesh, bars: FlyingBars, stress: bool = True) -> None:
    """The last frame is all there."""
    volume = bars.frame(INDEX).volume
    assert volume is not None
    (block,) = found.cells
    assert block.type == "hexahedron"
    np.testing.assert_array_equal(block.data, elements(bars))
    np.testing.assert_allclose(found.points, bars.info.model.X + volume.displacement, rtol=1e-14)
    for name in ("displacement", "velocity", "von_mises", "plastic_strain") + ("stress",) * stress:
        np.testing.assert_allclose(found.point_data[name], getattr(volume, name), rtol=1e-6)
    np.testing.assert_array_equal(found.cell_data["body"][0], np.repeat([0, 1], 10))
    np.testing.assert_array_equal(found.cell_data["material"][0], np.zeros(20))


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_formats_of_vtk_hold_stress_as_one_field(tmp_path: Path, bars: FlyingBars, suffix: str):
    file = tmp_path / "new" / f"end{suffix}"
    write(file, bars)
    check(read(file), bars)
    assert not bars.said


@pytest.mark.parametrize("suffix", [".xdmf", ".med", ".hmf", ".msh"])
def test_other_formats_hold_stress_by_component(tmp_path: Path, bars: FlyingBars, suffix: str):
    file = tmp_path / f"end{suffix}"
    write(file, bars)
    found = read(file, file_format="gmsh") if suffix == ".msh" else read(file)
    check(found, bars, stress=False)
    volume = bars.frame(INDEX).volume
    for k, name in enumerate(COMPONENTS):
        np.testing.assert_allclose(found.point_data[f"stress_{name}"], volume.stress[:, k], rtol=1e-6)
    assert {path.stem for path in tmp_path.iterdir()} == {"end"}


def test_gmsh_opens_a_file_of_hexahedra_and_wedges(tmp_path: Path):
    import gmsh

    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build()
    halves = np.array([[0, 1, 3, 3, 4, 5, 7, 7], [0, 3, 2, 2, 4, 7, 6, 6]], np.int32)
    steel, file = mca.Elastic(E=210e9, nu=0.3, rho=7850.0), tmp_path / "end.msh"
    bodies = (
        mca.Body(name="hexahedron", geometry=box, material=steel),
        mca.Body(name="wedges", geometry=mca.Mesh(box.points, halves), material=steel, position=(2.0, 0.0, 0.0)),
    )
    scene = mca.Scene(name="two", bodies=bodies, impact=mca.ImpactPhase(duration=1e-5, output_interval=1e-5))
    mca.run(scene, recorders=[FinalState(file)])
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(file))
        kinds, tags, _ = gmsh.model.mesh.getElements(3)
        assert {int(kind): len(of_kind) for kind, of_kind in zip(kinds, tags, strict=True)} == {5: 1, 6: 2}
        assert len(gmsh.view.getTags()) == 12
    finally:
        gmsh.finalize()


def test_vtk_reads_the_components_of_stress_by_their_names(tmp_path: Path, bars: FlyingBars):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    write(tmp_path / "end.vtu", bars)
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "end.vtu"))
    reader.Update()
    stress = vtk_to_numpy(reader.GetOutput().GetPointData().GetArray("stress"))
    np.testing.assert_array_equal(stress, bars.frame(INDEX).volume.stress)
    assert reader.GetOutput().GetNumberOfCells() == 20


def test_elements_come_in_the_order_of_the_meshes(bars: FlyingBars):
    soft = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=100e6, E_t=1e9)
    one, other = bars.info.scene.bodies
    scene = dataclasses.replace(bars.info.scene, bodies=(one, dataclasses.replace(other, material=soft)))
    meshes = {body.name: body.geometry.build() for body in scene.bodies}
    X = {name: mesh.points for name, mesh in meshes.items()}
    model = build_model(scene, meshes, X, {name: np.zeros_like(x) for name, x in X.items()})
    assert model.element_of[0] == 10  # the model puts plastic elements first
    ((cell, nodes),), body, material = cells(model)
    assert cell is HEXAHEDRON
    np.testing.assert_array_equal(nodes, elements(bars))
    np.testing.assert_array_equal(body, np.repeat([0, 1], 10))
    assert model.law[material[10:], 2] == pytest.approx(100e6)
    assert not model.law[material[:10], 2].any()


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("end.step", "knows no format with this suffix; name a .vtu"),
        ("end", "knows no format"),
        ("end.stl", "hexahedra in this format .they do not come back.; name a .vtu"),
        ("end.obj", "can only contain triangle or quad"),
        ("end.xml", "only supports triangles and tetrahedra"),
        ("end.bdf", r"hexahedra in this format \(AssertionError\); name a .vtu"),  # too narrow for the coordinates
        ("file/end.vtu", "not a folder"),
        ("folder.vtu", "is a folder"),
    ],
)
def test_what_cannot_be_written_is_refused_before_the_run(tmp_path: Path, name: str, remedy: str):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.vtu").mkdir()
    with pytest.raises(RequestError, match=rf"^final = .*{remedy}[^\n]*$"):
        FinalState(tmp_path / name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.vtu"]


def test_a_format_without_fields_takes_the_mesh_and_says_so(tmp_path: Path, bars: FlyingBars):
    write(tmp_path / "end.inp", bars)
    found = read(tmp_path / "end.inp")
    np.testing.assert_array_equal(found.cells[0].data, elements(bars))
    np.testing.assert_allclose(found.points, bars.positions(bars.frame(INDEX).step), atol=1e-9)
    (said,) = bars.said
    lost = "displacement, velocity, stress, von_mises, plastic_strain, body, material"
    assert f"no place for {lost}; name a .vtu" in said


def test_a_run_that_failed_has_no_final_state(tmp_path: Path, bars: FlyingBars):
    (tmp_path / "end.vtu").write_text("older")
    write(tmp_path / "end.vtu", bars, ok=False)
    assert (tmp_path / "end.vtu").read_text() == "older"


def test_an_older_file_is_replaced(tmp_path: Path, bars: FlyingBars):
    (tmp_path / "end.vtu").write_text("older")
    write(tmp_path / "end.vtu", bars)
    check(read(tmp_path / "end.vtu"), bars)
    assert [path.name for path in tmp_path.iterdir()] == ["end.vtu"]


@pytest.mark.parametrize("failure", [OSError("No space left on device"), SystemExit("it gave up"), KeyError("body")])
def test_a_writer_that_fails_leaves_nothing(
    tmp_path: Path, bars: FlyingBars, monkeypatch: pytest.MonkeyPatch, failure: BaseException
):
    recorder = FinalState(tmp_path / "end.vtu")
    recorder.start(bars.info)
    recorder.frame(bars.frame(1))

    def fail(path: Path, *args: object, **options: object) -> None:
        path.write_text("half")
        raise failure

    monkeypatch.setattr(meshio, "write", fail)
    with pytest.raises(McaError, match=f"final state could not be written: .*{failure.args[0]}"):
        recorder.finish(True)
    recorder.finish(False)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_noticed_before(tmp_path: Path, bars: FlyingBars, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(mesh_file.shutil, "disk_usage", lambda path: SimpleNamespace(free=1 << 20))
    with pytest.raises(McaError, match="too little is free"):
        write(tmp_path / "end.vtu", bars)
    assert list(tmp_path.iterdir()) == []
