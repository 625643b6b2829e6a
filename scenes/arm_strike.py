"""A six-axis arm with servos strikes a table with a flexible steel bar; needs the extra robots."""

from __future__ import annotations

from typing import Annotated

import warp_mca as mca
from warp_mca import Param
from warp_mca.scenes._robots import STEEL, Duration, Friction, struck

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"cells": 4, "axial": 40}}

FILE = """<mujoco model="arm"><compiler angle="radian" autolimits="true"/>
  <default><geom contype="0" conaffinity="0" density="0"/><joint damping="0.2"/></default>
  <worldbody>
    <geom name="table" type="box" pos="0.45 0 0.02" size="0.25 0.25 0.02" contype="1" conaffinity="1"/>
    <geom name="base" type="cylinder" pos="0 0 0.07" size="0.07 0.07"/>
    <body name="shoulder" pos="0 0 0.2"><inertial pos="0 0 0.02" mass="4" diaginertia="0.012 0.012 0.01"/>
      <joint name="j1" axis="0 0 1" range="-2.9 2.9"/><geom type="cylinder" size="0.06 0.06"/>
      <body name="upper" pos="0 0 0.1"><inertial pos="0 0 0.15" mass="5" diaginertia="0.06 0.06 0.009"/>
        <joint name="j2" axis="0 1 0" range="-2.1 2.1"/><geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.045"/>
        <body name="fore" pos="0 0 0.3"><inertial pos="0.02 0 0.12" mass="3" diaginertia="0.03 0.03 0.004"/>
          <joint name="j3" axis="0 1 0" range="-2.6 2.6"/><geom type="capsule" fromto="0 0 0 0 0 0.25" size="0.035"/>
          <body name="wrist" pos="0 0 0.25"><inertial pos="0 0 0" mass="0.8" diaginertia="0.0008 0.0008 0.0006"/>
            <joint name="j4" axis="0 0 1"/><geom type="sphere" size="0.03"/>
            <body name="cross"><inertial pos="0 0 0.01" mass="0.6" diaginertia="0.0005 0.0005 0.0004"/>
              <joint name="j5" axis="0 1 0" range="-2.2 2.2"/><geom type="sphere" size="0.028"/>
              <body name="flange"><inertial pos="0 0 0.03" mass="0.4" diaginertia="0.0003 0.0003 0.0002"/>
                <joint name="j6" axis="0 0 1"/><geom type="cylinder" fromto="0 0 0.02 0 0 0.04" size="0.025"/>
                <body name="tool" pos="0 0 0.04">
                  <inertial pos="0 0 0.08" mass="0.2462" diaginertia="0.000529 0.000529 0.000008"/>
                  <geom type="capsule" fromto="0 0 0.008 0 0 0.152" size="0.007" contype="1" conaffinity="1"/>
  </body></body></body></body></body></body></body></worldbody>
  <actuator>
    <position name="j1" joint="j1" kp="400" kv="20"/><position name="j2" joint="j2" kp="800" kv="40"/>
    <position name="j3" joint="j3" kp="500" kv="25"/><position name="j4" joint="j4" kp="80" kv="4"/>
    <position name="j5" joint="j5" kp="80" kv="4"/><position name="j6" joint="j6" kp="40" kv="2"/>
  </actuator>
  <keyframe><key name="strike" qpos="0.1517 1.0864 1.3844 0.2994 0.8088 0" qvel="-0.032 2.658 1.785 -0.09 -1.041 0"
    ctrl="0.15 1.1 1.42 0.3 0.75 0"/></keyframe>
</mujoco>"""


def build(
    *,
    duration: Duration = 1.2e-3,
    mu: Friction = 0.2,
    cells: Annotated[int, Param("across the bar", low=1)] = 2,
    axial: Annotated[int, Param("cells along the bar", low=1)] = 20,
) -> mca.Scene:
    """The bar, 160 mm long and 14 mm wide, stands for the link `tool`; all other links are rigid."""
    bar = mca.Box(size=(0.014, 0.014, 0.16), divisions=(cells, cells, axial), origin=(-0.007, -0.007, 0.0))
    machine = {"keyframe": "strike", "flexible": {"tool": bar}, "material": STEEL, "mounts": {"tool": "zmin"}}
    return struck("arm_strike", FILE, machine, duration, mu=mu)


def check(result: mca.Result) -> list[str]:
    """What a run with the default parameters must show."""
    stress = result.summary["bodies"]["tool"]["max_von_mises"]["value"]
    return [] if stress > 20e6 else [f"expected the bar to be stressed, found {stress:.3g} Pa"]
