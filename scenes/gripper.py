"""A gripper, whose motors push two round fingers, closes on an aluminium part; needs the extra robots."""

from __future__ import annotations

from typing import Annotated

import warp_mca as mca
from warp_mca import Param
from warp_mca.scenes._robots import ALUMINIUM, Duration, Friction, struck

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fast": {"speed": 1.0}}

FILE = """<mujoco model="gripper"><option gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0" density="0"/><joint type="slide" axis="1 0 0" damping="2"/></default>
  <worldbody>
    <geom name="palm" type="box" pos="0 0 0.07" size="0.05 0.02 0.01"/>
    <body name="left" pos="-0.0305 0 0"><joint name="left"/>
      <inertial pos="0 0 0.03" mass="0.08" diaginertia="3e-5 3e-5 1e-5"/>
      <geom type="box" pos="0 0 0.035" size="0.006 0.01 0.025"/>
      <geom name="left tip" type="sphere" size="0.01" contype="1" conaffinity="1"/></body>
    <body name="right" pos="0.0305 0 0"><joint name="right"/>
      <inertial pos="0 0 0.03" mass="0.08" diaginertia="3e-5 3e-5 1e-5"/>
      <geom type="box" pos="0 0 0.035" size="0.006 0.01 0.025"/>
      <geom name="right tip" type="sphere" size="0.01" contype="1" conaffinity="1"/></body>
  </worldbody>
  <actuator><motor name="left" joint="left"/><motor name="right" joint="right" gear="-1"/></actuator>
</mujoco>"""


def build(
    *,
    speed: Annotated[float, Param("of each finger at the start", unit="m/s", low=0.0)] = 0.4,
    force: Annotated[float, Param("of each motor", unit="N", low=0.0)] = 40.0,
    duration: Duration = 2e-4,
    mu: Friction = 0.4,
    cells: Annotated[int, Param("cells along each edge of the part, even", low=2)] = 4,
) -> mca.Scene:
    """The part is a block of 40 mm by 30 mm by 30 mm that floats between the fingers, each 0.5 mm away."""
    block = mca.Box(size=(0.04, 0.03, 0.03), divisions=(cells, cells, cells), origin=(-0.02, -0.015, -0.015))
    part = mca.Body(name="part", geometry=block, material=ALUMINIUM)
    machine = {"qvel": {"left": speed, "right": -speed}, "ctrl": {"left": force, "right": force}, "against": (part,)}
    return struck("gripper", FILE, machine, duration, mu=mu)


def check(result: mca.Result) -> list[str]:
    """What a run with the default parameters must show."""
    pressed = [abs(item["F_max"][0]) for item in result.summary["contacts_by_pair"]]
    return [] if min(pressed) > 10.0 else [f"expected both fingers to press the part, found {pressed} N"]
