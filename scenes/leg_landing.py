"""A leg with a servo in its knee lands with a flexible shin; needs the extra robots."""

from __future__ import annotations

from typing import Annotated

import warp_mca as mca
from warp_mca import Param
from warp_mca.scenes._robots import ALUMINIUM, Duration, Friction, Stiffness, struck

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "high": {"speed": 4.0}}

FILE = """<mujoco model="leg"><compiler angle="radian"/>
  <default><geom contype="0" conaffinity="0" density="0"/></default>
  <worldbody>
    <geom name="ground" type="box" pos="0 0 -0.02" size="0.15 0.1 0.02" contype="1" conaffinity="1"/>
    <body name="trunk" pos="0 0 0.325"><joint name="height" type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="3" diaginertia="0.02 0.02 0.02"/><geom type="box" size="0.08 0.05 0.03"/>
      <body name="thigh" quat="0.9238795 0 0.3826834 0"><joint name="hip" axis="0 1 0"/>
        <inertial pos="0 0 -0.08" mass="0.8" diaginertia="0.004 0.004 0.0006"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.025"/>
        <body name="shin" pos="0 0 -0.2" quat="0.7071068 0 -0.7071068 0"><joint name="knee" axis="0 1 0"/>
          <inertial pos="0 0 -0.11" mass="0.10584" diaginertia="3.545e-4 3.545e-4 3.46e-6"/>
          <body name="foot" pos="0 0 -0.22"><inertial pos="0 0 0" mass="0.1" diaginertia="4e-5 4e-5 4e-5"/>
            <geom name="sole" type="sphere" size="0.025" contype="1" conaffinity="1"/>
  </body></body></body></body></worldbody>
  <actuator>
    <position name="hip" joint="hip" kp="80" kv="2"/><position name="knee" joint="knee" kp="80" kv="2"/>
  </actuator>
</mujoco>"""


def build(
    *,
    speed: Annotated[float, Param("of the fall at the start", unit="m/s", low=0.0, exclusive=True)] = 2.0,
    duration: Duration = 2e-3,
    stiffness: Stiffness = 2e6,
    mu: Friction = 0.6,
    axial: Annotated[int, Param("cells along the shin", low=1)] = 16,
) -> mca.Scene:
    """The shin is an aluminium bar of 14 mm by 14 mm, 0.2 m long, between knee and foot."""
    machine = {
        "qvel": {"height": -speed},
        "flexible": {
            "shin": mca.Box(size=(0.014, 0.014, 0.2), divisions=(2, 2, axial), origin=(-0.007, -0.007, -0.21))
        },
        "material": ALUMINIUM,
        "mounts": {"shin": {"thigh": "zmax", "foot": "zmin"}},
    }
    return struck("leg_landing", FILE, machine, duration, stiffness=stiffness, mu=mu)


def check(result: mca.Result) -> list[str]:
    """What a run with the default parameters must show."""
    force = result.F_n.max()
    return [] if force > 100.0 else [f"expected the foot to press the ground, found {force:.3g} N at most"]
