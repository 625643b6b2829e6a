"""An elastic sphere strikes a rigid plane, or a large block of its own material."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"section": 16, "pole_size": 5e-5}}


def build(
    *,
    v: Annotated[float, Param("speed of the sphere", unit="m/s", low=0.0, exclusive=True)] = 1.0,
    radius: Annotated[float, Param("radius of the sphere", unit="m", low=0.0, exclusive=True)] = 0.01,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 210e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.3,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 7850.0,
    E_ratio: Annotated[float, Param("Young's modulus of the sphere over E", low=0.0, exclusive=True)] = 1.0,
    rigid_sphere: Annotated[bool, Param("the sphere stays rigid")] = False,
    target: Annotated[str, Param("what is struck", choices=("plane", "block"))] = "plane",
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True, words=("auto",))] = 3.0,
    section: Annotated[int, Param("cells across the fine patch at the pole, even", low=2)] = 8,
    pole_size: Annotated[float, Param("edge of the cells there", unit="m", low=0.0, exclusive=True)] = 1e-4,
    pole_layers: Annotated[int, Param("cells from the patch to the coarse mesh around it", low=1)] = 8,
) -> mca.Scene:
    """A quarter of the sphere, which moves along -y onto y = 0, with its planes of symmetry held."""
    ring = max(2, section // 2)
    patch = {"section": section, "ring": ring, "pole_size": pole_size, "pole_layers": pole_layers}
    moving = mca.Body(
        name="sphere",
        geometry=mca.Sphere(radius=radius, part="quarter", **patch),  # pyright: ignore[reportArgumentType]
        material=mca.Elastic(E=E_ratio * E, nu=nu, rho=rho),
        rigid=rigid_sphere,
        position=(0.0, radius, 0.0),
        rotation=(0.0, 0.0, -0.5 * math.pi),  # the pole points downwards
        velocity=(0.0, -v, 0.0),
        exact_mass=False,  # published figures of this scene are of the mass of its cells
    )
    bodies = [moving]
    fixed = [mca.Fixed(body="sphere", nodes="ymin", axes="x"), mca.Fixed(body="sphere", nodes="zmin", axes="z")]
    master: mca.Surface | mca.RigidPlane = mca.RigidPlane()
    if target == "block":
        block = mca.Plate(
            length=20.0 * radius,
            width=20.0 * radius,
            height=10.0 * radius,
            core=(section, section),
            core_depth=ring,
            core_size=pole_size,
            layers=2 * pole_layers,
            part="quarter",
        )
        bodies.append(mca.Body(name="block", geometry=block, material=mca.Elastic(E=E, nu=nu, rho=rho)))
        held = {"xmin": "x", "zmin": "z", "bottom": "y"}
        fixed += [mca.Fixed(body="block", nodes=nodes, axes=axes) for nodes, axes in held.items()]
        master = mca.Surface(body="block", nodes="contact")
    slave = mca.Surface(body="sphere", nodes="pole")
    # Hertz's duration of the impact on a plane, with half as much again
    mass = 4.0 / 3.0 * math.pi * radius**3 * rho
    modulus = E / (1.0 - nu**2) / (1.0 if target == "plane" else 2.0)
    duration = 1.5 * 2.868 * (mass**2 / (modulus**2 * radius * v)) ** 0.2
    return mca.Scene(
        name="hertz_sphere",
        bodies=tuple(bodies),
        contacts=(mca.Contact(slave=slave, master=master, penalty=penalty),),
        fixed=tuple(fixed),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 600.0),
        tip=mca.Point(body="sphere", at=(0.0, 0.0, 0.0)),
    )
