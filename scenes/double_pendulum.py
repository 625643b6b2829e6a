"""Two links on hinges swing under gravity, already in motion: elastic ones, or rigid ones, which these come near."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np

import warp_mca as mca
from warp_mca import Param
from warp_mca.rigid.chain import link_axes, perpendicular

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "stiff": {"E": 2e9}}


def build(
    *,
    theta_OA: Annotated[float, Param("initial angle of OA from the downward vertical", unit="rad")] = 1.2,
    theta_AB: Annotated[float, Param("initial angle of AB from the downward vertical", unit="rad")] = 0.4,
    rate_OA: Annotated[float, Param("initial rate of that angle of OA", unit="rad/s")] = -1.0,
    rate_AB: Annotated[float, Param("initial rate of that angle of AB", unit="rad/s")] = 3.0,
    gravity: Annotated[float, Param("acceleration of gravity, along -y", unit="m/s^2")] = 9.8,
    length: Annotated[float, Param("length of each link", unit="m", low=0.0, exclusive=True)] = 1.0,
    depth: Annotated[float, Param("depth of the links, along y", unit="m", low=0.0, exclusive=True)] = 0.2,
    width: Annotated[float, Param("width of the links, along z", unit="m", low=0.0, exclusive=True)] = 0.1,
    rigid: Annotated[bool, Param("the links stay rigid")] = False,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 200e6,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.3,
    rho_OA: Annotated[float, Param("density of OA", unit="kg/m^3", low=0.0, exclusive=True)] = 1000.0,
    rho_AB: Annotated[float, Param("density of AB", unit="kg/m^3", low=0.0, exclusive=True)] = 2000.0,
    joint_nodes: Annotated[str, Param("nodes tied at each hinge", choices=("axis", "ends", "pin"))] = "axis",
    pin_radius: Annotated[
        float, Param("reach of a pin around the axis, with joint_nodes=pin", unit="m", low=0.0, exclusive=True)
    ] = 0.08,
    duration: Annotated[float, Param("simulated time", unit="s", low=0.0, exclusive=True)] = 0.4,
    samples: Annotated[int, Param("rows of the history", low=1)] = 1000,
    axial: Annotated[int, Param("cells along each link", low=1)] = 10,
    deep: Annotated[int, Param("cells along the depth, even", low=2)] = 2,
    wide: Annotated[int, Param("cells along the width", low=1)] = 1,
) -> mca.Scene:
    """Angles as in `RigidPhase`; hinges lie in the middle of the links' end faces. plate_vx is that of hinge A."""
    box = mca.Box(size=(length, depth, width), divisions=(axial, deep, wide), origin=(0.0, -0.5 * depth, -0.5 * width))
    arm = length * link_axes(np.array(theta_OA))[0]
    vx, vy = -rate_OA * perpendicular(arm)
    places = ((0.0, 0.0, 0.0), (float(arm[0]), float(arm[1]), 0.0))
    speeds = ((0.0, 0.0, 0.0), (float(vx), float(vy), 0.0))
    bodies = tuple(
        mca.Body(
            name=name,
            geometry=box,
            material=mca.Elastic(E=E, nu=nu, rho=rho),
            position=place,
            rotation=(0.0, 0.0, -theta - 0.5 * math.pi),
            velocity=speed,
            angular_velocity=(0.0, 0.0, -rate),
            rigid=rigid,
        )
        for name, rho, place, theta, speed, rate in zip(
            ("OA", "AB"), (rho_OA, rho_AB), places, (theta_OA, theta_AB), speeds, (rate_OA, rate_AB), strict=True
        )
    )
    tied: dict[str, Any] = {"nodes": joint_nodes} | ({"pin_radius": pin_radius} if joint_nodes == "pin" else {})
    return mca.Scene(
        name="double_pendulum",
        bodies=bodies,
        joints=(
            mca.Revolute(name="O", body="OA", at=(0.0, 0.0, 0.0), **tied),
            mca.Revolute(name="A", body="OA", at=(length, 0.0, 0.0), other="AB", **tied),
        ),
        gravity=(0.0, -gravity, 0.0),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / samples),
        tip=mca.Point(body="AB", at=(length, 0.0, 0.0)),
        target=mca.Point(body="OA", at=(length, 0.0, 0.0)),
    )
