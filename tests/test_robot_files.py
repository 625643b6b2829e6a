"""What robot files say of starts, contact and switches: flags of the option, named pairs, mimic joints with offsets."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.verify.machines import robot

pytest.importorskip("mujoco")

DROP = """<mujoco><option gravity="0 0 -10"><flag {flag}/></option><worldbody>
  <geom name="floor" type="plane" size="1 1 1" contype="{floor}"/>
  <body name="post" pos="0 0 0.1"><geom name="top" type="box" size="0.1 0.1 0.02" contype="2" conaffinity="2"/></body>
  <body name="ball" pos="0 0 0.37"><freejoint/><geom name="skin" size="0.05" mass="1" contype="0"/></body></worldbody>
  <contact>{pair}</contact></mujoco>"""
PAIR = '<pair geom1="skin" geom2="top"/>'


@pytest.mark.parametrize(("pair", "other", "way"), [(PAIR, "top", 0.2), ("", "floor", 0.32)])
def test_pairs_that_the_file_names_touch_whatever_their_bits(tmp_path, pair, other, way):
    touch = (swing := robot(DROP.format(flag="", floor=1, pair=pair), tmp_path).swing()).touch
    assert touch is not None
    assert {touch.first, touch.second} == {"skin", other}
    assert swing.t_end == pytest.approx(math.sqrt(2.0 * way / 10.0), abs=1e-9)


def test_a_file_without_contact_touches_what_stands_beside_alone(tmp_path):
    text = DROP.format(flag='contact="disable"', floor=1, pair=PAIR)
    with pytest.raises(mca.RequestError, match="nothing may touch"):
        robot(text, tmp_path).swing()
    beside = robot(text, tmp_path, against=(mca.RigidPlane(normal=(0.0, 0.0, 1.0)),)).swing()
    assert beside.touch is not None
    assert (beside.touch.first, beside.touch.second) == ("skin", "plane 1")


ARMS = """<mujoco><compiler angle="radian" autolimits="true"/>
  <option gravity="0 0 -9.81"><flag {flag}/></option><worldbody>
  <body name="arm" gravcomp="0.4"><joint name="a" axis="0 1 0" stiffness="30" damping="2" frictionloss="1.5"/>
    <geom size="0.05" mass="2" pos="0.2 0 0"/>
    <body name="hand" pos="0.4 0 0"><joint name="b" axis="0 1 0" range="-1 0.2"/>
      <geom size="0.05" mass="1" pos="0.2 0 0"/>
  </body></body><body name="fly" pos="0 1 0"><joint name="c" axis="0 1 0"/>
    <geom size="0.05" mass="1" pos="0.2 0 0"/></body>
  </worldbody><equality><joint joint1="c" joint2="a" polycoef="0 0.5 0 0 0"/></equality>
  <actuator><motor name="m" joint="b" ctrlrange="-2 2"/></actuator></mujoco>"""


@pytest.mark.parametrize(
    "off", ["", "spring", "damper", "spring damper", "frictionloss", "limit", "equality", "constraint", "clampctrl"]
)
def test_an_impact_has_what_flags_leave(tmp_path, off):
    """An impact without touch is a piece of the swing; each flag changes the motion."""
    flags = " ".join(f'{name}="disable"' for name in off.split())
    start: dict[str, Any] = {"qpos": {"a": 0.3, "b": 0.201}, "qvel": {"a": 1.0, "b": 0.5}, "ctrl": {"m": 5.0}}
    machine = robot(ARMS.format(flag=flags), tmp_path, **start)
    span, before = 4e-3, 1e-3
    swing = machine.swing(t_end=before)
    scene = machine.strike(impact=mca.ImpactPhase(duration=span, output_interval=1e-4), swing=swing)
    joints = mca.run(scene, precision="float64", figures="none").summary["joints"]
    found = np.array([joints[name]["position"][0]["value"] for name in ("a", "b", "c")])
    exact = machine.swing(t_end=before + span)
    assert found == pytest.approx(exact.qpos, abs=2e-7)
    if off:
        (tmp_path / "whole").mkdir()
        whole = robot(ARMS.format(flag=""), tmp_path / "whole", **start).swing(t_end=before + span)
        assert np.abs(exact.qpos - whole.qpos).max() > 4e-6


def test_links_touch_their_parents_where_the_file_lets_them(tmp_path):
    text = """<mujoco><option gravity="0 0 -10"><flag {}/></option><worldbody>
      <body name="cart"><joint name="x" type="slide" axis="1 0 0"/>
        <geom name="floor" type="box" size="1 1 0.1" mass="1"/>
        <body name="ball" pos="0 0 0.35"><joint name="z" type="slide" axis="0 0 1"/><geom size="0.05" mass="1"/></body>
      </body></worldbody></mujoco>"""
    with pytest.raises(mca.RequestError, match="nothing may touch"):
        robot(text.format(""), tmp_path).swing()
    swing = robot(text.format('filterparent="disable"'), tmp_path).swing()
    assert swing.t_end == pytest.approx(math.sqrt(2.0 * 0.2 / 10.0), abs=1e-9)


def test_mimic_joints_start_where_their_leaders_have_them(tmp_path):
    inertia = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    links = "".join(f'<link name="{name}">{inertia}</link>' for name in "abc")
    joint = """<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><axis xyz="0 1 0"/>
      <limit lower="-3" upper="3" effort="9" velocity="9"/>{3}</joint>"""
    mimic = '<mimic joint="{}" multiplier="{}" offset="{}"/>'
    joints = (("one", "base", "a", ""), ("two", "a", "b", mimic.format("three", 2, 0.2)))
    joints = (*joints, ("three", "base", "c", mimic.format("one", -0.5, 0.1)))
    text = f'<robot name="r"><link name="base"/>{links}{"".join(joint.format(*item) for item in joints)}</robot>'
    machine = robot(text, tmp_path, "r.urdf", qpos={"one": 0.4}, qvel={"one": 1.0})
    names, swing = machine._machine().names.joints, machine.swing(t_end=1e-9)
    assert dict(zip(names, swing.qpos, strict=True)) == pytest.approx({"one": 0.4, "three": -0.1, "two": 0.0}, abs=1e-8)
    assert dict(zip(names, swing.qvel, strict=True)) == pytest.approx(
        {"one": 1.0, "three": -0.5, "two": -1.0}, abs=1e-6
    )
    with pytest.raises(mca.RequestError, match="it opens the loops"):
        robot(text, tmp_path, "r.urdf", qpos={"one": 0.4, "two": 0.1}).swing(t_end=0.1)
    with pytest.raises(mca.RequestError, match=r"Robot\.mounts = 'a': this link is rigid; name it in flexible"):
        robot(text, tmp_path, "r.urdf", mounts={"a": "start"})


def test_swings_that_would_not_end_are_refused(tmp_path):
    text = DROP.format(flag="", floor=1, pair="")
    rates = (0.0, 0.0, 0.0, 0.0, 1e9, 0.0)
    with pytest.raises(mca.RequestError, match=r"greatest rate of the machine at t = 4.99e-08 s .* steps of 5e-11 s"):
        robot(text, tmp_path, qvel=rates).swing()
    assert robot(text, tmp_path, qvel=rates).swing(t_end=1e-9).t_end == 1e-9


def test_a_far_geom_does_not_widen_what_may_touch(tmp_path):
    """A ball that turns at 5 rad/s and falls at 2.5 m/s comes 4 mm far in the impact, and not to a shelf 0.2 m away."""
    shelf = '<geom name="shelf" type="box" pos="0.35 0 0.05" size="0.1 0.1 0.01"/><geom size="0.1" pos="900 0 0"/>'
    text = DROP.format(flag="", floor=1, pair="").replace('<body name="post"', f'{shelf}<body name="post"')
    machine = robot(text, tmp_path, qvel=(0.0, 0.0, 0.0, 0.0, 5.0, 0.0))
    scene = machine.strike(impact=mca.ImpactPhase(duration=8e-4))
    sides = [contact.sides for contact in scene.contacts if isinstance(contact, mca.Contact)]
    assert sides == [("ball", "plane")]
