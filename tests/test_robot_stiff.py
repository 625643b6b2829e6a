"""Swings of machines whose servos are stiff: as right as others, in steps of the motion that is left."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from warp_mca.robots.machine import Machine
from warp_mca.robots.stepping import Stepper
from warp_mca.verify.machines import robot

pytest.importorskip("mujoco")

MASS, KP, KV, TARGET, WALL = 0.01, 4000.0, 2000.0, -0.3, -0.2
TEXT = f"""<mujoco><option gravity="0 0 0"/><worldbody>
  <geom name="wall" type="box" size="0.1 0.1 0.1" pos="{WALL - 0.11} 0 0"/>
  <body name="head"><joint name="x" type="slide" axis="1 0 0"/><geom size="0.01" mass="{MASS}"/></body></worldbody>
  <actuator><position name="servo" joint="x" kp="{KP}" kv="{KV}"/></actuator></mujoco>"""


def way(t: float) -> tuple[float, float]:
    """Place [m] and rate [m/s] of m x'' = kp (target - x) - kv x' from rest at 0: rates of decay are 2 and 2e5 1/s."""
    fast, slow = np.roots([MASS, KV, KP])
    a = TARGET * np.array([slow, -fast]) / (fast - slow)
    terms = a * np.exp(np.array([fast, slow]) * t)
    return TARGET + terms.sum(), float(terms @ [fast, slow])


def when(place: float) -> float:
    """Time at which it is at a place [s]."""
    return float(brentq(lambda t: way(t)[0] - place, 1e-3, 2.0, xtol=1e-14))  # pyright: ignore


@pytest.mark.parametrize("period", [None, 1e-4])
def test_a_stiff_servo_brings_its_head_to_the_wall_as_its_equation_says(tmp_path, period):
    """With a controller, too, whose samples are shorter than the steps."""
    start = when(WALL + 5e-3) if period else 0.0
    x, v = way(start)
    control: dict[str, Any] = (
        {"ctrl": (TARGET,)} if period is None else {"controller": lambda t, q, v: [TARGET], "period": period}
    )
    swing = robot(TEXT, tmp_path, qpos=(x,), qvel=(v,), **control).swing()
    exact = when(WALL)
    assert start + swing.t_end == pytest.approx(exact, abs=1e-9)
    assert swing.qvel[0] == pytest.approx(way(exact)[1], abs=1e-9)
    assert swing.drives[0] == pytest.approx(KP * (TARGET - WALL) - KV * way(exact)[1], abs=1e-5)


def test_steps_are_those_of_the_slow_motion(tmp_path):
    """An explicit scheme would take 30,000 of them."""
    machine = Machine(robot(TEXT, tmp_path, ctrl=(TARGET,)))
    stepper, count = Stepper(machine), 0
    stepper.begin(0.0, np.append(machine.start, [0.0, 0.0]), 1.0)
    while stepper.running:
        assert stepper.step() is None
        count += 1
    assert stepper.stiff and count < 1500
    assert stepper.y[:2] == pytest.approx(way(1.0), abs=1e-10)


ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="a"><joint name="s" axis="0 1 0"/>
  <inertial pos="0.15 0 0" mass="1.2" diaginertia="0.001 0.01 0.01"/>
  <body name="b" pos="0.3 0 0"><joint name="e" axis="0 1 0"/>
    <inertial pos="0.1 0 0" mass="0.7" diaginertia="0.001 0.003 0.003"/></body></body></worldbody><actuator>
  <position name="s" joint="s" kp="2e5" kv="2e3" forcelimited="true" forcerange="-80 80"/>
  <position name="e" joint="e" kp="1e5" kv="300"/></actuator></mujoco>"""


def test_a_machine_that_its_stiff_servos_have_brought_to_rest_goes_on_in_long_steps(tmp_path):
    """Rounding of their torques moves rates by 1e-14 rad/s: a step that asks for less never ends."""
    target = np.array([0.4, -0.3])
    machine = Machine(robot(ARM, tmp_path, ctrl=tuple(target)))
    stepper, count = Stepper(machine), 0
    stepper.begin(0.0, np.append(machine.start, [0.0, 0.0]), 0.3)
    while stepper.running and count < 3000:
        assert stepper.step() is None
        count += 1
    assert stepper.t == 0.3
    upper, lower = 0.7 * 9.81 * 0.1 * np.cos(target.sum()), 9.81 * (1.2 * 0.15 + 0.7 * 0.3) * np.cos(target[0])
    assert stepper.y[:2] == pytest.approx(target + np.array([upper + lower, upper]) / (2e5, 1e5), abs=1e-8)
