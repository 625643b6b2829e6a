"""A copper cylinder strikes a rigid wall at 227 m/s and mushrooms: Taylor's impact test."""

from __future__ import annotations

from typing import Annotated, Literal

import warp_mca as mca
from warp_mca import Param

# The foot flattens to a twentieth of its height, and more the finer its cells are.
PRESETS: dict[str, dict[str, object]] = {
    "quick": {},
    "standard": {"section": 6, "ring": 3, "axial": 54, "time_step_scale": 0.1},
    "fine": {"section": 8, "ring": 6, "axial": 81, "time_step_scale": 0.045},
}


def build(
    *,
    v: Annotated[float, Param("speed of the bar", unit="m/s", low=0.0, exclusive=True)] = 227.0,
    length: Annotated[float, Param("length of the bar", unit="m", low=0.0, exclusive=True)] = 0.0324,
    radius: Annotated[float, Param("radius of the bar", unit="m", low=0.0, exclusive=True)] = 0.0032,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 117e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.35,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 8930.0,
    sigma_y: Annotated[float, Param("yield stress", unit="Pa", low=0.0, exclusive=True)] = 400e6,
    E_t: Annotated[float, Param("tangent modulus", unit="Pa", low=0.0)] = 100e6,
    beta: Annotated[float, Param("share of isotropic hardening", low=0.0, high=1.0)] = 1.0,
    foot: Annotated[str, Param("may leave the wall, or stays on it", choices=("free", "held"))] = "free",
    penalty: Annotated[float, Param("factor of the wall's stiffness", low=0.0, exclusive=True)] = 10.0,
    kinematics: Annotated[str, Param("strain measure", choices=("finite", "corotational"))] = "finite",
    duration: Annotated[float, Param("simulated time", unit="s", low=0.0, exclusive=True)] = 80e-6,
    time_step_scale: Annotated[float, Param("share of the stable time step at the start", low=0.0, high=1.0)] = 0.1,
    section: Annotated[int, Param("cells along each side of the core, even", low=2)] = 4,
    ring: Annotated[int, Param("cells from the core to the surface", low=1)] = 2,
    axial: Annotated[int, Param("cells along the bar", low=1)] = 36,
) -> mca.Scene:
    """A round bar along x, its end at the plane x = length."""
    metal = mca.J2Bilinear(E=E, nu=nu, rho=rho, sigma_y=sigma_y, E_t=E_t, beta=beta)
    rod = mca.Rod(radius=radius, length=length, tip="flat", section=section, ring=ring, axial=axial)
    wall = mca.RigidPlane(point=(length, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    end = mca.Surface(body="bar", nodes="end")
    held = mca.Prescribed(body="bar", nodes="end", axis="x", times=(0.0,), velocities=(0.0,))
    measure: Literal["finite", "corotational"] = "finite" if kinematics == "finite" else "corotational"
    return mca.Scene(
        name="taylor_bar",
        bodies=(
            mca.Body(
                name="bar",
                geometry=rod,
                material=metal,
                kinematics=measure,
                velocity=(v, 0.0, 0.0),
                exact_mass=False,  # published figures of this scene are of the mass of its cells
            ),
        ),
        contacts=(mca.Contact(slave=end, master=wall, penalty=penalty),) if foot == "free" else (),
        prescribed=(held,) if foot == "held" else (),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 160.0, time_step_scale=time_step_scale),
        tip=mca.Point(body="bar", at=(0.0, 0.0, 0.0)),
    )
