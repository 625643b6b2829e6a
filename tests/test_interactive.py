"""Tests interactive pictures from recorded files; pyvista is optional."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flying_bars import FlyingBars
from matplotlib import colormaps

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.pictures.interactive import plotter
from warp_mca.recorders import Cadence, View, VtkHdfFile
from warp_mca.results.figure_style import engineering

BELT = mca.RigidPlane(point=(0.0, 0.0, -0.001), normal=(0.0, 0.0, 1.0), velocity=(2.0, 0.0, 0.0))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Three frames of the bars over a belt, z up."""
    bars = FlyingBars(contacts=(mca.Contact(slave=mca.Surface(body="lower", nodes="zmin"), master=BELT),))
    recorder = VtkHdfFile(tmp_path / "bars.vtkhdf")
    recorder.start(bars.info)
    for index in range(3):
        recorder.frame(bars.frame(index))
    recorder.finish(True)
    return tmp_path / "bars.vtkhdf"


def test_vtk_reads_what_is_up_and_the_planes_at_every_frame(file: Path):
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(file))
    for step in range(3):
        reader.SetStep(step)
        reader.Update()
        fields = reader.GetOutputDataObject(0).GetFieldData()
        expected = {
            "up": BELT.normal,
            **{f"plane_{name}": getattr(BELT, name) for name in ("point", "normal", "velocity")},
        }
        for name, value in expected.items():
            np.testing.assert_array_equal(vtk_to_numpy(fields.GetArray(name)), [value])


def test_the_picture_stands_upright_on_its_floor(file: Path):
    pytest.importorskip("pyvista")
    picture = plotter(file, time=1e-9, field="velocity", off_screen=True)
    assert tuple(picture.camera.up) == (0.0, 0.0, 1.0)
    bodies, floor = (picture.actors[name].mapper.dataset for name in ("bodies", "plane 0"))
    assert floor.bounds[4] == floor.bounds[5] == pytest.approx(-0.001)
    assert bodies.bounds[4] == pytest.approx(0.0, abs=1e-9)
    speed = np.asarray(bodies.point_data["speed [m/s]"])
    np.testing.assert_allclose(speed, 3.0, rtol=1e-6)
    picture.close()


def test_a_section_keeps_what_is_behind_its_plane(file: Path):
    pytest.importorskip("pyvista")
    middle = (0.05, 0.0, 0.0)
    cuts = (None, (middle, (1.0, 0.0, 0.0)), (middle, (-2.0, 0.0, 0.0)))
    pictures = [plotter(file, time=0.0, field="velocity", cut=cut, off_screen=True) for cut in cuts]
    whole, low, high = (picture.actors["bodies"].mapper.dataset for picture in pictures)
    assert low.bounds[1] == pytest.approx(0.05) == pytest.approx(high.bounds[0])
    assert (low.bounds[0], high.bounds[1]) == pytest.approx((whole.bounds[0], whole.bounds[1]))
    np.testing.assert_allclose(np.asarray(low.point_data["speed [m/s]"]), 3.0, rtol=1e-6)
    section = np.asarray(low.points)[np.abs(np.asarray(low.points)[:, 0] - 0.05) < 1e-6]
    assert len(section) >= 8  # corners of two bars
    for picture in pictures:
        picture.close()


def test_a_recording_of_one_frame_is_drawn_at_its_time(tmp_path: Path, bars: FlyingBars):
    pytest.importorskip("pyvista")
    recorder = VtkHdfFile(tmp_path / "one.vtkhdf", cadence=Cadence(times=(2e-6,)))
    recorder.start(bars.info)
    recorder.frame(bars.frame(2))
    recorder.finish(True)
    picture = plotter(tmp_path / "one.vtkhdf", time=0.0, off_screen=True)
    points = np.asarray(picture.actors["bodies"].mapper.dataset.points)
    assert points[:, 0].min() == pytest.approx(3.0 * bars.frame(2).time, rel=1e-5)
    picture.close()


def test_stress_is_in_the_units_and_colours_of_other_pictures(file: Path):
    """MPa or what has few digits, on the square-root scale; hidden bodies are not there, the camera where asked."""
    pytest.importorskip("pyvista")
    picture = plotter(file, view=View(hidden=("upper bar",), camera=(0.0, 0.0, 1.0), pixels=400), off_screen=True)
    bodies = picture.actors["bodies"].mapper
    (title,) = (name for name in bodies.dataset.point_data if name.startswith("von Mises stress"))
    scale, unit = engineering(float(np.quantile(bodies.dataset.point_data["von_mises"], 0.995)), "Pa")
    assert title == f"von Mises stress [{unit}]"
    np.testing.assert_allclose(bodies.dataset.point_data[title], scale * bodies.dataset.point_data["von_mises"])
    assert set(bodies.dataset.cell_data["body"]) == {1}
    quarter = bodies.lookup_table.map_value(0.25 * bodies.scalar_range[1])
    np.testing.assert_allclose(quarter[:3], np.array(colormaps["viridis"](0.5))[:3], atol=0.02)
    direction = np.array(picture.camera.position) - np.array(picture.camera.focal_point)
    np.testing.assert_allclose(direction / np.linalg.norm(direction), [0.0, 0.0, 1.0], atol=1e-6)
    assert tuple(picture.window_size) == (400, 300)
    picture.close()


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"field": "heat"}, "field = 'heat': choose one of"),
        ({"magnify": -1.0}, "magnify = -1.0: give a factor above 0"),
        ({"cut": (1.0, 2.0, 3.0)}, "give a point and a normal"),
        ({"cut": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))}, "plotter.cut"),
        ({"cut": ((-9.0, 0.0, 0.0), (1.0, 0.0, 0.0))}, "nothing is left to show"),
    ],
)
def test_what_cannot_be_drawn_is_refused(file: Path, options: dict, why: str):
    if "cut" in options:
        pytest.importorskip("pyvista")
    with pytest.raises(RequestError, match=why):
        plotter(file, **options)


def test_other_files_are_refused(tmp_path: Path):
    pytest.importorskip("pyvista")
    (tmp_path / "a.vtkhdf").write_text("none")
    for name in ("a.vtkhdf", "missing.vtkhdf"):
        with pytest.raises(RequestError, match="give a recording that VtkHdfFile or --vtkhdf wrote"):
            plotter(tmp_path / name)
