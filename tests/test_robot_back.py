"""Machines after an impact: momenta are kept, and the swing goes on to the next touch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.rotation import rotation_matrix
from warp_mca.verify.machines import ARM, FOUR_BAR, STOP, robot

pytest.importorskip("mujoco")

STEEL = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=250e6, E_t=1e9)
# A free chain of three links: springs in its hinges drive a ball at its end against an anvil on its base.
CHAIN = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0" density="0"/></default>
  <worldbody><body name="base"><freejoint name="free"/>
    <inertial pos="0.02 0.01 0" mass="2" diaginertia="0.02 0.03 0.025"/>
    <geom name="anvil" type="box" size="0.03 0.015 0.05" pos="0.05 0.12 0" contype="1" conaffinity="1"/>
    <body name="mid" pos="0.1 0 0"><joint name="a" axis="0.1 0 1" stiffness="8" springref="0.6" armature="0.001"/>
      <inertial pos="0.05 0 0" mass="0.6" diaginertia="0.002 0.003 0.0025"/>
      <body name="tip" pos="0.1 0 0"><joint name="b" axis="0 0.2 1" stiffness="4" springref="2"/>
        <inertial pos="0.03 0 0.01" mass="0.5" diaginertia="0.001 0.0015 0.0012"/>
        <geom name="ball" type="sphere" size="0.025" pos="0.1 0 0" contype="1" conaffinity="1"/>
  </body></body></body></worldbody></mujoco>"""
START = {"qvel": {"free": (0.1, 0.2, -0.1, 0.5, 0.3, -1.0), "a": 1.0, "b": 3.0}, "qpos": {"a": 0.2, "b": 0.8}}
IMPACT = mca.ImpactPhase(duration=1.8e-4, output_interval=1e-5)


def momenta(machine, swing):
    """Linear and angular momentum about the origin of all links at the end of a swing."""
    scene = machine.strike(impact=IMPACT, swing=swing)
    P, L = np.zeros(3), np.zeros(3)
    for body in (body for body in scene.bodies if body.mass is not None):
        R, spin = rotation_matrix(body.rotation), np.array(body.angular_velocity)
        arm = R @ np.array(body.centre)
        momentum = body.mass * (np.array(body.velocity) + np.cross(spin, arm))
        P += momentum
        L += np.cross(np.array(body.position) + arm, momentum) + R @ np.array(body.inertia) @ R.T @ spin
    return P, L


def test_free_chain_keeps_its_momenta_through_five_swings_and_impacts(tmp_path):
    """The rotor of 1e-3 kg m^2 takes no part in the momenta of the whole: its reaction is that of the hinge."""
    machine = robot(CHAIN.replace(' armature="0.001"', ""), tmp_path, **START)
    swing = machine.swing()
    P, L = momenta(machine, swing)
    for _ in range(5):
        scene = machine.strike(impact=IMPACT, swing=swing, stiffness=1e8)
        back = machine.after(swing, scene, mca.run(scene, precision="float64", figures="none"))
        assert abs(back.vibration) < 1e-6 * swing.kinetic_energy
        machine = back.robot
        swing = machine.swing()
        assert swing.touch is not None and swing.t_end > 0.05
        P1, L1 = momenta(machine, swing)
        assert np.abs(P1 - P).max() < 1e-10 * np.linalg.norm(P)
        assert np.abs(L1 - L).max() < 1e-10 * np.linalg.norm(L)


# Springs, dampers, dry friction, limits, servos, motors, rotors, balls, loops, fixed links and zeros of joints.
BALLS = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="a"><joint name="s" type="ball" damping="0.02"/>
    <inertial pos="0.02 0 -0.1" mass="1" diaginertia="0.01 0.012 0.004"/>
    <body name="b" pos="0 0 -0.2" quat="0.9 0.1 0.2 0.3"><joint name="t" type="ball"/>
      <inertial pos="0.03 0.01 -0.1" mass="0.5" diaginertia="0.004 0.005 0.002"/></body></body></worldbody></mujoco>"""
SOCKETS = BALLS.replace('damping="0.02"', 'damping="0.02" stiffness="3" armature="0.02" frictionloss="0.02"')
SOCKETS = SOCKETS.replace('name="t" type="ball"', 'name="t" type="ball" stiffness="0.7" armature="0.003"')
SPRUNG = SOCKETS.replace(' frictionloss="0.02"', "").replace(
    '<body name="a">', '<body name="a" quat="0.5 0.4 -0.3 0.2">'
)
# A joint that is held, twice and with two drives, between others.
HELD = BALLS.replace('name="s" type="ball" damping="0.02"', 'name="h" axis="0.1 1 0"').replace(
    'name="t" type="ball"', 'name="x" type="slide" axis="1 0 0"/><joint name="k" axis="0 1 0.3"'
)
HELD = HELD.replace(
    "</mujoco>",
    """<equality><joint joint1="x" polycoef="0.02"/><joint joint1="x" polycoef="0.02"/></equality><actuator>
      <position joint="x" kp="9" forcerange="-2 2"/><velocity joint="x" kv="1" forcerange="-1 1"/>
      </actuator></mujoco>""",
)
CART = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
  <body name="cart"><joint name="x" type="slide" axis="1 0.2 0" range="-1 0.01" damping="1"/>
    <inertial pos="0 0.01 0" mass="2" diaginertia="0.01 0.01 0.01"/>
    <body name="bob" pos="0 0 -0.1"><joint name="h" axis="0 1 0" ref="0.3"/>
      <joint name="g" axis="1 0 0" pos="0 0 0.05"/>
      <inertial pos="0 0 -0.1" mass="0.7" diaginertia="0.004 0.005 0.002"/>
      <body name="fixed" pos="0.1 0 0"><inertial pos="0 0 0" mass="0.2" diaginertia="0.0004 0.0005 0.0002"/></body>
  </body></body></worldbody>
  <actuator><velocity joint="h" kv="0.3" forcerange="-0.2 0.2" name="v"/><motor joint="x" name="m"/>
  </actuator></mujoco>"""
DRY = 'frictionloss="0.05" stiffness="3" springref="0.4" damping="0.01" armature="0.01"'
LOOP = {"crank": 3.0, "coupler": -3.0 * (1.0 + 0.1 / 0.35), "rocker": 0.0}
PIECES = {
    "rotors": (CHAIN.replace('armature="0.001"', 'armature="0.02"'), START, 0.02),
    "loop": (FOUR_BAR, {"qvel": LOOP}, 0.02),
    "balls": (BALLS, {"qvel": (1.0, 2.0, 3.0, -2.0, 1.0, 4.0), "qpos": {"s": (0.8, 0.6, 0.0, 0.0)}}, 0.02),
    "springs and rotors of balls": (
        SPRUNG,
        {"qvel": (1.0, 2.0, 3.0, -2.0, 1.0, 4.0), "qpos": {"s": (0.8, 0.6, 0.0, 0.0), "t": (0.7, -0.2, 0.6, 0.1)}},
        0.02,
    ),
    "held": (HELD, {"qvel": {"h": 1.0, "k": -2.0}, "qpos": {"x": 0.02}}, 0.02),
    "friction": (STOP.replace('range="-1 0.5"', DRY), {"qvel": (0.5,)}, 0.01),
    "limit": (CART, {"qvel": (1.2, 3.0, -2.0), "ctrl": (2.0, 1.5)}, 0.009),
}


@pytest.mark.parametrize("name", PIECES)
def test_an_impact_without_a_touch_is_a_piece_of_the_swing(tmp_path, name):
    """Bodies, joints and forces are those of the swing, there and back: the schemes agree to second order."""
    text, start, t = PIECES[name]
    machine = robot(text, tmp_path, **start)
    swing = machine.swing(t_end=t)
    scene = machine.strike(impact=replace(IMPACT, duration=1e-3, output_interval=2e-6), swing=swing)
    back = machine.after(swing, scene, mca.run(scene, precision="float64"))
    assert back.robot.clock == pytest.approx(t + 1e-3, abs=1e-5)
    later = machine.swing(t_end=back.robot.clock)
    assert np.array(back.robot.qpos) == pytest.approx(later.qpos, abs=1e-8)
    assert np.array(back.robot.qvel) == pytest.approx(later.qvel, abs=1e-5)
    assert abs(back.vibration) < 1e-9


def test_balls_with_dry_friction_go_on_to_first_order_and_say_so(tmp_path, caplog):
    """Three hinges stand for each: off by 2e-4 of the way of 5 mrad; without its springs it would be by 1e-2."""
    start = {"qvel": (1.0, 2.0, 3.0, -2.0, 1.0, 4.0), "qpos": {"s": (0.8, 0.6, 0.0, 0.0)}}
    machine = robot(SOCKETS, tmp_path, **start)
    swing = machine.swing(t_end=0.02)
    scene = machine.strike(impact=replace(IMPACT, duration=1e-3, output_interval=1e-5), swing=swing)
    turn = 1e-3 * np.linalg.norm(swing.qvel[:3])
    assert [f"wrong by up to the {turn:.2g} rad" in line for line in caplog.messages if "three hinges" in line] == [
        True
    ]
    back = machine.after(swing, scene, mca.run(scene, precision="float64"))
    later = machine.swing(t_end=back.robot.clock)
    assert np.array(back.robot.qpos) == pytest.approx(later.qpos, abs=1e-6)
    assert np.array(back.robot.qvel) == pytest.approx(later.qvel, abs=5e-3)


def test_a_ball_stops_at_its_range_in_swings_and_impacts(tmp_path):
    """Depth of a critically damped stop, v / (e w), after 1 / w in it; turned back at -3 v exp(-4) after 4 / w."""
    ball = BALLS.replace('type="ball" damping="0.02"', 'type="ball" limited="true" range="0 0.5"', 1)
    ball = ball[: ball.index('<body name="b"')] + "</body></worldbody></mujoco>"
    ball = ball.replace('pos="0.02 0 -0.1"', 'pos="0 0 0"').replace("0.01 0.012 0.004", "0.01 0.01 0.01")
    ball = ball.replace("<worldbody>", '<option gravity="0 0 0"/><worldbody>')
    n, v, w = np.array([0.6, 0.0, 0.8]), 3.0, 2000.0
    half = 0.5 * 0.49
    start = {"qpos": (np.cos(half), *(np.sin(half) * n)), "qvel": tuple(v * n)}
    machine = robot(ball, tmp_path, **start)
    angle = lambda q: 2.0 * np.arctan2(np.linalg.norm(q[1:]), q[0])  # noqa: E731
    reached = 0.01 / v
    assert angle(machine.swing(t_end=reached + 1.0 / w).qpos) == pytest.approx(0.5 + v / (np.e * w), abs=1e-9)
    assert machine.swing(t_end=reached + 4.0 / w).qvel @ n == pytest.approx(-3.0 * v * np.exp(-4.0), rel=1e-6)
    swing = machine.swing(t_end=2e-3)
    scene = machine.strike(impact=replace(IMPACT, duration=3e-3, output_interval=1e-6), swing=swing)
    back = machine.after(swing, scene, mca.run(scene, precision="float64"))
    later = machine.swing(t_end=back.robot.clock)
    assert np.array(back.robot.qvel) == pytest.approx(later.qvel, abs=2e-3)
    assert np.array(back.robot.qpos) == pytest.approx(later.qpos, abs=1e-6)
    with pytest.raises(
        mca.RequestError, match=r"Robot\.qpos of joint s \[rad\] = 0\.6: start within its range of 0\.5"
    ):
        robot(ball, tmp_path, qpos=(np.cos(0.3), *(np.sin(0.3) * n))).swing(t_end=1e-3)


def test_what_does_not_come_back_is_refused(tmp_path):
    machine = robot(CHAIN, tmp_path, **START)
    swing = machine.swing(t_end=0.02)
    scene = machine.strike(impact=replace(IMPACT, duration=1e-5, output_interval=1e-5), swing=swing)
    result = mca.run(scene, precision="float64")
    with pytest.raises(mca.RequestError, match="give the result of the scene other"):
        machine.after(swing, replace(scene, name="other"), result)
    rod = mca.Body(
        name="tool",
        geometry=mca.Rod(radius=0.008, length=0.16, section=2, ring=1, axial=4),
        material=STEEL,
        rotation=(0.0, -np.pi / 2, 0.0),
    )
    arm = robot(ARM, tmp_path, keyframe="strike", flexible={"tool": rod}, mounts={"tool": "start"})
    result.summary["max_plastic_strain"] = 0.01
    with pytest.raises(mca.RequestError, match="permanent shape would be lost"):
        arm.after(swing, scene, result)
