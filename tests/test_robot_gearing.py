"""Mimic joints and fixed tendons of robots: an impact in which nothing touches moves on as the swing does."""

from __future__ import annotations

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.verify.machines import robot

pytest.importorskip("mujoco")

SPAN = 4e-3
IMPACT = mca.ImpactPhase(duration=SPAN, output_interval=1e-4)
HAND = """<mujoco><compiler autolimits="true"/><option gravity="0 0 -9.81"/><worldbody>
  <body name="arm"><joint name="shoulder" axis="0 1 0" damping="0.2"/><geom size="0.05" mass="2" pos="0.2 0 0"/>
    <body name="left" pos="0.4 0.02 0"><joint name="l" type="slide" axis="0 1 0" armature="0.02" damping="3"/>
      <geom size="0.01" mass="0.05" pos="0.01 0 0"/></body>
    <body name="right" pos="0.4 -0.02 0" quat="0 0 0 1"><joint name="r" type="slide" axis="0 1 0"/>
      <geom size="0.01" mass="0.08"/></body></body></worldbody>
  <tendon><fixed name="split"{spring}><joint joint="l" coef="0.5"/><joint joint="r" coef="{coef}"/></fixed></tendon>
  {equality}<actuator><general name="grip" tendon="split" {limits} gainprm="30" biastype="affine"
  biasprm="0 -3000 -{kv}"/></actuator></mujoco>"""
EQUAL = '<equality><joint joint1="l" joint2="r" polycoef="{} {} 0 0 0"/></equality>'
START = {"shoulder": 0.3, "l": 0.02, "r": 0.02}


def apart(machine: mca.Robot, before: float = 2e-3, warned: str | None = None, caplog=None):
    """Coordinates after an impact without touch less those of the swing, and the way in between."""
    swing = machine.swing(t_end=before)
    result = mca.run(machine.strike(impact=IMPACT, swing=swing), precision="float64", figures="none")
    names = machine._machine().names.joints
    found = np.array([result.summary["joints"][name]["position"][0]["value"] for name in names])
    exact = machine.swing(t_end=before + SPAN)
    if warned is not None and caplog is not None:
        assert sum(warned in line for line in caplog.messages) == 1
    return found - exact.qpos, np.abs(exact.qpos - swing.qpos), result


@pytest.mark.parametrize("limits", ['forcerange="-100 100"', 'forcerange="-4 4"'])
@pytest.mark.parametrize("ratio", [1.0, -1.5])
def test_fingers_with_one_drive_move_as_in_the_swing(tmp_path, limits, ratio):
    text = HAND.format(spring="", coef=0.5, equality=EQUAL.format(0.02 - 0.02 * ratio, ratio), limits=limits, kv=30)
    start = {"shoulder": 1.0, "l": 0.4 * ratio, "r": 0.4}
    off, way, result = apart(robot(text, tmp_path, qpos=START, qvel=start, ctrl={"grip": 10.0}))
    assert (way > 1e-4).all() and np.abs(off).max() < 2e-5 * way.min()
    assert result.summary["energy_error"] < 1e-6


def test_springs_of_tendons_and_gears_of_gears(tmp_path):
    """The spring pulls with 0.05 l - 0.3 r of geared joints, and l follows r, which follows the shoulder."""
    more = EQUAL.format(0.0, 1.0).replace(
        "</equality>", '<joint joint1="r" joint2="shoulder" polycoef="-0.1 0.4"/></equality>'
    )
    spring = ' stiffness="4e3" damping="40" springlength="0.003"'
    text = HAND.format(spring=spring, coef=-0.3, equality=more, limits="", kv=0)
    start = {"shoulder": 1.0, "l": 0.4, "r": 0.4}
    machine = robot(text, tmp_path, qpos=START, qvel=start, ctrl={"grip": 0.0})
    off, way, _ = apart(machine)
    assert (way > 1e-4).all() and np.abs(off).max() < 2e-5 * way.min()


@pytest.mark.parametrize("limits", ['forcerange="-100 100"', 'forcerange="-4 4"', ""])
def test_a_tendon_of_joints_that_are_free_of_each_other_pulls_them_on(tmp_path, limits):
    """Its spring, damper and actuator follow its length, 0.5 l + 0.7 r + 0.1 shoulder."""
    spring = ' stiffness="2e3" damping="20" springlength="0.003"'
    text = HAND.format(spring=spring, coef=0.7, equality="", limits=limits, kv=30)
    text = text.replace("</fixed>", '<joint joint="shoulder" coef="0.1"/></fixed>')
    machine = robot(text, tmp_path, qpos=START, qvel={"l": 0.4, "r": -0.3, "shoulder": 0.5}, ctrl={"grip": 2.0})
    off, way, result = apart(machine)
    assert (way > 1e-4).all() and np.abs(off).max() < 2e-5 * way.min()
    assert result.summary["energy_error"] < 1e-6


def test_a_polynomial_is_linear_in_an_impact_and_says_so(tmp_path, caplog):
    equality = EQUAL.format(0.02 - 0.5 * 0.02**2, 0.0).replace("0.0 0 0 0", "0 0.5 0 0")
    text = HAND.format(spring="", coef=0.5, equality=equality, limits="", kv=0)
    machine = robot(text, tmp_path, qpos=START, qvel={"l": 0.02 * 0.5, "r": 0.5}, ctrl={"grip": 1.0})
    off, way, _ = apart(machine, warned="of the way would change", caplog=caplog)
    assert np.abs(off[1:]).max() < 0.2 * way[1:].min()


def test_mimic_joints_of_a_urdf_share_the_impulse_of_a_strike(tmp_path):
    """A finger hits a wall: 2 v over the mobility of both, (m_1 + r^2 m_2)."""
    inertia = (
        '<inertial><mass value="{}"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    ball = '<collision><geometry><sphere radius="0.01"/></geometry></collision>'
    slide = """<joint name="{0}" type="prismatic"><parent link="base"/><child link="{1}"/><origin xyz="0 {3} 0"/>
      <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/>{2}</joint>"""
    mimic = '<mimic joint="one" multiplier="-2" offset="0"/>'
    text = f"""<robot name="gripper"><link name="base"/>
      <link name="a">{inertia.format(0.3)}{ball}</link><link name="b">{inertia.format(0.1)}</link>
      {slide.format("one", "a", "", 0)}{slide.format("two", "b", mimic, 0.5)}</robot>"""
    wall = mca.RigidPlane(point=(0.02, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    machine = robot(text, tmp_path, "hand.urdf", qvel={"one": 1.0, "two": -2.0}, against=(wall,))
    swing = machine.swing()
    assert swing.touch is not None
    assert swing.touch.effective_mass == pytest.approx(0.3 + 4 * 0.1, rel=1e-9)
    impact = mca.ImpactPhase(duration=6e-4, output_interval=1e-6)
    scene = machine.strike(impact=impact, swing=swing, stiffness=1e8)
    result = mca.run(scene, precision="float64", figures="none")
    assert 1e-6 * result.F_n.sum() == pytest.approx(2.0 * 0.7, rel=0.005)
    back = machine.after(swing, scene, result).robot
    assert back.qvel == pytest.approx((-1.0, 2.0), rel=0.005)
