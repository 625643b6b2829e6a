"""Owns the robot files of the verification cases, as texts."""

from __future__ import annotations

import struct
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from warp_mca.base.arrays import Array
from warp_mca.robots.robot import Robot

# A six-axis arm whose wrist axes meet in a point; position servos; a steel bar as its tool; it strikes a table.
ARM = """<mujoco model="arm">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.0005" gravity="0 0 -9.81" integrator="RK4"/>
  <default><geom contype="0" conaffinity="0" density="0"/><joint damping="0.2"/></default>
  <worldbody>
    <geom name="table" type="box" pos="0.45 0 0.02" size="0.25 0.25 0.02" contype="1" conaffinity="1"/>
    <body name="shoulder" pos="0 0 0.2">
      <inertial pos="0 0 0.02" mass="4.0" diaginertia="0.012 0.012 0.010"/>
      <joint name="j1" axis="0 0 1" range="-2.9 2.9"/>
      <geom type="cylinder" size="0.06 0.06"/>
      <body name="upper" pos="0 0 0.10">
        <inertial pos="0 0 0.15" mass="5.0" diaginertia="0.060 0.060 0.009"/>
        <joint name="j2" axis="0 1 0" range="-2.1 2.1"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.30" size="0.045"/>
        <body name="fore" pos="0 0 0.30">
          <inertial pos="0.02 0 0.12" mass="3.0" diaginertia="0.030 0.030 0.004"/>
          <joint name="j3" axis="0 1 0" range="-2.6 2.6" damping="0.1"/>
          <geom type="capsule" fromto="0 0 0 0 0 0.25" size="0.035"/>
          <body name="wrist1" pos="0 0 0.25">
            <inertial pos="0 0 0" mass="0.8" diaginertia="0.0008 0.0008 0.0006"/>
            <joint name="j4" axis="0 0 1" damping="0.05"/>
            <geom type="sphere" size="0.03"/>
            <body name="wrist2">
              <inertial pos="0 0 0.01" mass="0.6" diaginertia="0.0005 0.0005 0.0004"/>
              <joint name="j5" axis="0 1 0" range="-2.2 2.2" damping="0.05"/>
              <geom type="sphere" size="0.028"/>
              <body name="flange">
                <inertial pos="0 0 0.03" mass="0.4" diaginertia="0.0003 0.0003 0.0002"/>
                <joint name="j6" axis="0 0 1" damping="0.02"/>
                <geom type="cylinder" fromto="0 0 0.02 0 0 0.04" size="0.025"/>
                <body name="tool" pos="0 0 0.04">
                  <inertial pos="0 0 0.07868" mass="0.24832" diaginertia="0.0005166 0.0005166 0.000007893"/>
                  <geom name="tool" type="capsule" fromto="0 0 0.008 0 0 0.152" size="0.008"
                    contype="1" conaffinity="1"/>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="j1" joint="j1" kp="400" kv="20" forcerange="-80 80"/>
    <position name="j2" joint="j2" kp="800" kv="40" forcerange="-120 120"/>
    <position name="j3" joint="j3" kp="500" kv="25" forcerange="-80 80"/>
    <position name="j4" joint="j4" kp="80" kv="4" forcerange="-20 20"/>
    <position name="j5" joint="j5" kp="80" kv="4" forcerange="-20 20"/>
    <position name="j6" joint="j6" kp="40" kv="2" forcerange="-10 10"/>
  </actuator>
  <keyframe>
    <key name="strike" qpos="0.15 0.75 1.15 0.30 1.10 0" qvel="0.10 0.40 0.20 0 -0.15 0"
      ctrl="0.15 1.10 1.42 0.30 0.75 0"/>
  </keyframe>
</mujoco>
"""

# Crank 0.1 m, coupler 0.35 m and rocker 0.25 m between pivots at (0, 0) and (0.3, -0.2) m, slender; g along -z.
FOUR_BAR = """<mujoco model="four_bar">
  <compiler angle="radian"/><option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="crank"><joint name="crank" axis="0 -1 0"/>
      <inertial pos="0.05 0 0" mass="0.3" diaginertia="1e-9 0.00025 0.00025"/>
      <body name="coupler" pos="0.1 0 0"><joint name="coupler" axis="0 -1 0"/>
        <inertial pos="0.175 0 0" mass="0.9" diaginertia="1e-9 0.0091875 0.0091875"/>
      </body>
    </body>
    <body name="rocker" pos="0.3 0 -0.2"><joint name="rocker" axis="0 -1 0"/>
      <inertial pos="0.075 0 0.1" mass="0.6" diaginertia="0.002 0.003125 0.0015"/>
    </body>
  </worldbody>
  <equality><connect body1="coupler" body2="rocker" anchor="0.35 0 0"/></equality>
</mujoco>
"""

# A wheel that runs into the limit of its hinge at 0.5 rad.
STOP = """<mujoco model="stop">
  <compiler angle="radian" autolimits="true"/><option gravity="0 0 0"/>
  <worldbody>
    <body name="wheel"><joint name="hinge" axis="0 0 1" range="-1 0.5"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.02"/>
    </body>
  </worldbody>
</mujoco>
"""

# A disc that flies freely.
DISC = """<mujoco model="disc">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="disc"><freejoint name="free"/><inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.018"/></body>
  </worldbody>
</mujoco>
"""


def robot(text: str, folder: str | Path, name: str = "machine.xml", **more: Any) -> Robot:
    """A robot of a text, written to a file of that folder."""
    path = Path(folder) / name
    path.write_text(text, encoding="utf-8")
    return Robot(path, **more)


def write_stl(path: Path, triangles: Array) -> None:
    """Write a surface as a binary STL file; corners [m], shape (triangle_count, 3, 3)."""
    with path.open("wb") as file:
        file.write(bytes(80) + struct.pack("<I", len(triangles)))
        for corners in triangles:
            file.write(struct.pack("<12fH", 0.0, 0.0, 0.0, *corners.reshape(-1), 0))


def swung(text: str, *, t_end: float | None = None, **more: Any) -> Any:
    """The swing of a robot of a text, to a touch or a time [s]."""
    with TemporaryDirectory() as folder:
        return robot(text, folder, **more).swing(t_end=t_end)
