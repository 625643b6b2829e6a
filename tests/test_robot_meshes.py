"""Robot files as they are published: concave meshes, floors that are planes, meshes named by package."""

from __future__ import annotations

import math

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.geometry.quality import check
from warp_mca.robots.geoms import filled
from warp_mca.robots.skins import Skin
from warp_mca.verify.machines import robot, write_stl

pytest.importorskip("mujoco")

IMPACT = mca.ImpactPhase(duration=6e-4, output_interval=1e-6)


def channel():
    """A U of 60 x 40 x 30 mm around z, open upwards: its groove is 20 mm wide and 20 mm deep; 2 x 3600 mm^2 x 20 mm."""
    outline = np.array([[-3, -2], [3, -2], [3, 2], [1, 2], [1, 0], [-1, 0], [-1, 2], [-3, 2]]) * 0.01
    low, high = (np.column_stack([outline[:, 0], np.full(8, y), outline[:, 1]]) for y in (0.015, -0.015))
    caps = np.array([[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4], [0, 5, 6], [0, 6, 7]])
    k, nxt = np.arange(8), (np.arange(8) + 1) % 8
    sides = np.concatenate([np.stack([k, nxt, 8 + nxt], axis=1), np.stack([k, 8 + nxt, 8 + k], axis=1)])
    return np.vstack([low, high]), np.concatenate([caps[:, ::-1], 8 + caps, sides]).astype(np.int32)


def machine(tmp_path, falling: str, more: str = "", **fields):
    points, faces = channel()
    write_stl(tmp_path / "channel.stl", points[faces])
    text = f"""<mujoco><option gravity="0 0 0"/><asset><mesh name="channel" file="channel.stl"/></asset>
      <worldbody>{more}<body name="hammer" pos="0 0 0.1"><joint name="drop" type="slide" axis="0 0 1"/>
      <geom name="head" {falling} mass="2"/></body></worldbody></mujoco>"""
    return robot(text, tmp_path, qvel={"drop": -1.0}, **fields)


def test_a_concave_surface_has_its_own_faces():
    points, faces = channel()
    mesh = filled("channel", (points, faces), "skin")
    check(mesh, "channel")
    assert {frozenset(face) for face in mesh.surface("skin")[0].tolist()} == {
        frozenset(face) for face in faces.tolist()
    }
    with pytest.raises(mca.RequestError, match=r"geom = 'channel': its surface is open \(3 open edges\)"):
        filled("channel", (points, faces[1:]), "skin")
    with pytest.raises(mca.RequestError, match="faces inwards"):
        filled("channel", (points, faces[:, ::-1]), "skin")


def test_distance_of_points_around_and_in_a_channel():
    """The deepest point counts, even where another one lies just above the surface."""
    skin = Skin(*channel())
    for points, exact, which in (
        ([[0.0, 0.0, 0.03], [0.0, 0.0, 0.005]], 0.005, 1),  # above the groove, and in it
        ([[0.0, 0.0, 0.001], [0.0, 0.0, -0.008], [0.02, 0.0, 0.01]], -0.01, 2),
        ([[0.0, 0.0, 1e-5], [0.0, 0.0, -0.009]], -0.009, 1),
        ([[0.04, 0.0, 0.03], [9.0, 0.0, 0.0]], math.hypot(0.01, 0.01), 0),
        ([[0.0, 0.025, 5.0], [0.02, 0.025, 0.02]], 0.01, 1),
    ):
        found = skin.nearest(np.array(points))
        assert found[:2] == (pytest.approx(exact, rel=1e-12), which)
        assert np.linalg.norm(found[2] - points[which]) == pytest.approx(abs(exact), rel=1e-12)


def test_a_pair_that_was_far_is_met_after_another_one_was_near(tmp_path):
    """A ball on a spring, x = 0.1 sin 10 t, turns 1 mm before one wall and meets the other one on its way back."""
    walls = (("right", 0.1 + 0.001 + 0.01 + 0.02), ("left", -0.05 - 0.01 - 0.02))
    boxes = "".join(f'<geom name="{n}" type="box" size="0.02 0.1 0.1" pos="{x} 0 0"/>' for n, x in walls)
    text = f"""<mujoco><option gravity="0 0 0"/><worldbody>{boxes}<body name="ball">
      <joint name="x" type="slide" axis="1 0 0" stiffness="100"/><geom name="head" size="0.01" mass="1"/></body>
      </worldbody></mujoco>"""
    swing = robot(text, tmp_path, qvel={"x": 1.0}).swing()
    assert swing.touch is not None and "left" in (swing.touch.first, swing.touch.second)
    assert swing.t_end == pytest.approx(0.1 * (math.pi + math.asin(0.5)), abs=1e-9)


def test_a_box_falls_into_the_groove_of_a_mesh(tmp_path):
    """The hull of the mesh is level at 20 mm; the box of 16 mm touches the groove's ground at 0 mm."""
    held = '<geom name="groove" type="mesh" mesh="channel"/>'
    falling = machine(tmp_path, 'type="box" size="0.008 0.008 0.008"', held)
    swing = falling.swing()
    assert swing.t_end == pytest.approx(0.1 - 0.008, abs=1e-6)
    assert swing.touch is not None and swing.touch.effective_mass == pytest.approx(2.0)
    scene = falling.strike(impact=IMPACT, swing=swing, stiffness=1e8)
    result = mca.run(scene, precision="float64")
    assert 1e-6 * result.F_n.sum() == pytest.approx(4.0, rel=0.01)


def test_a_mesh_falls_on_a_plane_of_the_file(tmp_path):
    floor = '<geom name="floor" type="plane" size="0 0 1" pos="0 0 -0.03"/>'
    falling = machine(tmp_path, 'type="mesh" mesh="channel"', floor)
    swing = falling.swing()
    assert swing.touch is not None and (swing.touch.first, swing.touch.second) == ("head", "floor")
    assert swing.t_end == pytest.approx(0.1 + 0.03 - 0.02, abs=1e-6)
    result = mca.run(falling.strike(impact=IMPACT, swing=swing, stiffness=1e8), precision="float64")
    assert 1e-6 * result.F_n.sum() == pytest.approx(4.0, rel=0.01)


def test_a_flexible_link_without_geoms_touches_the_floor_of_the_file(tmp_path):
    """A bar of 0.1 m above the floor by 0.05 m, at 1 m/s."""
    text = """<mujoco><option gravity="0 0 0"/><worldbody><geom name="floor" type="plane" size="0 0 1"/>
      <body name="bar" pos="0 0 0.05"><joint name="drop" type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0.05" mass="1" diaginertia="1e-3 1e-3 1e-4"/></body></worldbody></mujoco>"""
    box = mca.Box(size=(0.02, 0.02, 0.1), divisions=(1, 1, 5), origin=(-0.01, -0.01, 0.0))
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    machine = robot(text, tmp_path, flexible={"bar": box}, material=steel, qvel={"drop": -1.0})
    swing = machine.swing()
    assert swing.touch is not None and (swing.touch.first, swing.touch.second) == ("bar", "floor")
    assert swing.t_end == pytest.approx(0.05, abs=1e-6)


def test_meshes_of_a_package_are_found_above_the_file(tmp_path):
    meshes, files = tmp_path / "cup_description" / "meshes", tmp_path / "cup_description" / "urdf"
    meshes.mkdir(parents=True)
    files.mkdir()
    points, faces = channel()
    write_stl(meshes / "cup.stl", points[faces])
    text = """<robot name="cup"><link name="cup"><inertial><mass value="1"/>
      <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>
      <mesh filename="package://cup_description/meshes/cup.stl"/></geometry></collision></link></robot>"""
    assert robot(text, files, "cup.urdf")._machine().model.nmesh == 1
    said = r"no folder other_description beside the file or above it has meshes/cup\.stl"
    with pytest.raises(mca.RequestError, match=said):
        robot(text.replace("cup_description", "other_description"), files, "cup.urdf")._machine()
