"""Tests what USD files hold beside bodies: materials, normals, planes, camera and lights, and the way up."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from flying_bars import DT, STEPS, FlyingBars
from test_usd import opened, record

import warp_mca as mca
from warp_mca.recorders import UsdFile

SETTING = "/World/setting"


def with_floor(bars: FlyingBars, **options: object) -> FlyingBars:
    floor = mca.RigidPlane(point=(0.0, -0.001, 0.0), velocity=(2.0, 0.0, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="lower", nodes="ymin"), master=floor)
    scene = dataclasses.replace(bars.info.scene, contacts=(contact,), **options)
    bars.info = dataclasses.replace(bars.info, scene=scene)
    return bars


@pytest.fixture
def stage(bars: FlyingBars, tmp_path: Path):
    record(tmp_path / "bars.usdc", with_floor(bars), 3)
    return opened(tmp_path / "bars.usdc")


def test_what_is_drawn_is_bound_to_a_surface_that_reads_its_colours(stage):
    from pxr import UsdShade

    for name in ("/World/upper_bar", "/World/lower", "/World/contact", f"{SETTING}/plane_0"):
        material, _ = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(name)).ComputeBoundMaterial()
        surface, _, _ = material.ComputeSurfaceSource()
        assert surface.GetIdAttr().Get() == "UsdPreviewSurface"
        reader = surface.GetInput("diffuseColor").GetConnectedSources()[0][0].source.GetPrim()
        assert UsdShade.Shader(reader).GetIdAttr().Get() == "UsdPrimvarReader_float3"
        assert UsdShade.Shader(reader).GetInput("varname").Get() == "displayColor"


def test_normals_are_those_of_the_faces_of_a_bar_and_written_once(stage):
    from pxr import UsdGeom

    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/lower"))
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    assert primvar.GetInterpolation() == "faceVarying"
    assert primvar.GetAttr().GetTimeSamples() == [0.0]
    found = np.array(primvar.ComputeFlattened(2)).reshape(-1, 4, 3)
    corners = np.array(mesh.GetPointsAttr().Get(2))[np.reshape(mesh.GetFaceVertexIndicesAttr().Get(), (-1, 4))]
    faces = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    np.testing.assert_allclose(found, np.repeat(faces[:, None], 4, axis=1), atol=1e-5)


def test_a_body_that_turns_gets_new_normals(bars: FlyingBars, tmp_path: Path):
    from pxr import UsdGeom

    recorder = UsdFile(tmp_path / "a.usdc")
    recorder.start(bars.info)
    for code, angle in enumerate((0.0, 0.0, 0.0, 0.5)):
        turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        frame = bars.frame(code)
        points = {body: (x @ turn.T).astype(np.float32) for body, x in frame.points.items()}
        recorder.frame(dataclasses.replace(frame, points=points))
    recorder.finish(True)
    stage = opened(tmp_path / "a.usdc")
    primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/World/lower")).GetPrimvar("normals")
    assert primvar.GetAttr().GetTimeSamples() == [0.0, 2.0, 3.0]  # held until the frame before
    before, after = (np.array(primvar.ComputeFlattened(code)) for code in (2, 3))
    np.testing.assert_allclose(after, before @ turn.T, atol=1e-5)


def test_a_floor_moves_and_lies_below(stage):
    from pxr import UsdGeom

    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"{SETTING}/plane_0"))
    (move,) = mesh.GetOrderedXformOps()
    for code in range(3):
        np.testing.assert_allclose(move.Get(code), [2.0 * code * STEPS * DT, 0.0, 0.0], atol=1e-9)
    assert np.ptp(np.array(mesh.GetPointsAttr().Get())[:, 1]) == pytest.approx(0.0, abs=1e-9)
    assert len(set(mesh.GetDisplayColorPrimvar().GetIndices())) == 2


def test_the_camera_holds_the_bodies(stage):
    from pxr import Gf, Usd, UsdGeom

    camera = UsdGeom.Camera(stage.GetPrimAtPath(f"{SETTING}/camera"))
    view = camera.GetCamera(Usd.TimeCode(0)).frustum
    places = []
    for name in ("upper_bar", "lower"):
        for point in np.array(UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/{name}")).GetPointsAttr().Get(0)).tolist():
            places.append(view.ComputeViewMatrix().Transform(Gf.Vec3d(*point)))
    on_film = np.array([view.ComputeProjectionMatrix().Transform(place) for place in places])
    assert np.abs(on_film).max() < 1.0
    assert np.abs(on_film[:, :2]).max() > 0.7  # and fills the picture


@pytest.mark.parametrize(
    ("gravity", "axis", "turned"),
    [((0, 0, -9.8), "Z", False), ((0, -9.8, 0), "Y", False), ((9.8, 0, 0), "Y", True), ((0, 0, 9.8), "Z", True)],
)
def test_the_stage_s_up_axis_is_the_scene_s(bars: FlyingBars, tmp_path: Path, gravity: tuple, axis: str, turned: bool):
    from pxr import Gf, UsdGeom

    record(tmp_path / "a.usdc", with_floor(bars, gravity=gravity), 1)
    stage = opened(tmp_path / "a.usdc")
    assert UsdGeom.GetStageUpAxis(stage) == axis
    world = UsdGeom.Xform(stage.GetPrimAtPath("/World"))
    assert bool(world.GetOrderedXformOps()) is turned
    up = world.GetLocalTransformation().TransformDir(Gf.Vec3d(*(-np.array(gravity) / 9.8).tolist()))
    np.testing.assert_allclose(up, [0.0, axis == "Y", axis == "Z"], atol=1e-12)
