"""An elastic sphere that slides without spin on a rigid plane is turned by friction until it rolls."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"section": 12, "pole_size": 2e-4}}


def build(
    *,
    v: Annotated[float, Param("initial speed", unit="m/s", low=0.0, exclusive=True)] = 10.0,
    mu: Annotated[float, Param("coefficient of friction", low=0.0, exclusive=True)] = 0.3,
    g: Annotated[float, Param("acceleration of gravity", unit="m/s^2", low=0.0, exclusive=True)] = 12000.0,
    radius: Annotated[float, Param("radius of the sphere", unit="m", low=0.0, exclusive=True)] = 0.01,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 2e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.3,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 1000.0,
    sink: Annotated[float, Param("initial depth over Hertz's at rest", low=0.0)] = 1.1,
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True)] = 1.0,
    section: Annotated[int, Param("cells across the fine patch, even", low=2)] = 6,
    pole_size: Annotated[float, Param("edge of the cells there", unit="m", low=0.0, exclusive=True)] = 4e-4,
    pole_layers: Annotated[int, Param("cells from the patch to the coarse mesh around it", low=1)] = 6,
) -> mca.Scene:
    """Half of the sphere moves along +x on the plane y = 0; its fine patch is turned to where it will roll."""
    material = mca.Elastic(E=E, nu=nu, rho=rho)
    sphere = mca.Sphere(
        radius=radius, part="half", section=section, ring=section // 2, pole_size=pole_size, pole_layers=pole_layers
    )
    weight = 4.0 / 3.0 * math.pi * radius**3 * rho * g
    depth = sink * (0.75 * weight * (1.0 - nu**2) / (E * math.sqrt(radius))) ** (2.0 / 3.0)  # Hertz
    slide = 2.0 * v / (7.0 * mu * g)
    turn = 2.5 * mu * g / radius * slide**2  # half of it while sliding, as much again in half that time
    ball = mca.Body(
        name="ball",
        geometry=sphere,
        material=material,
        position=(0.0, radius - depth, 0.0),
        rotation=(0.0, 0.0, -0.5 * math.pi + 0.5 * turn),
        velocity=(v, 0.0, 0.0),
        exact_mass=False,  # published figures of this scene are of the mass of its cells
    )
    duration = 1.5 * slide
    return mca.Scene(
        name="rolling_sphere",
        bodies=(ball,),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="ball", nodes="pole"),
                master=mca.RigidPlane(),
                mu=mu,
                penalty=penalty,
                initial_overlap="press",
                law=mca.Penalty(),  # undamped, as the closed form
            ),
        ),
        fixed=(mca.Fixed(body="ball", nodes="zmin", axes="z"),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 300.0),
        gravity=(0.0, -g, 0.0),
        tip=mca.Point(body="ball", at=(0.0, 0.0, 0.0)),
    )
