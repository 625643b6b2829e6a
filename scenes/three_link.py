"""A falling three-link manipulator strikes a plate with its hemispherical tip."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param
from warp_mca.scenes._arm import arm

PRESETS: dict[str, dict[str, object]] = {
    "quick": {},
    "fine": {
        "section": 12,
        "ring": 4,
        "axial": 30,
        "focus_size": 0.33e-3,
        "focus_layers": 7,
        "plate_core": 18,
        "plate_core_depth": 5,
        "plate_layers": 12,
        "plate_extension": 20,
    },
}


def build(
    *,
    mu: Annotated[float, Param("coefficient of friction", low=0.0, high=10.0)] = 0.47,
    H: Annotated[float, Param("height of hinge O above the plate", unit="m", low=0.0, exclusive=True)] = 0.38,
    gravity: Annotated[float, Param("acceleration of gravity", unit="m/s^2", low=0.0, exclusive=True)] = 9.8,
    theta_OA: Annotated[
        float, Param("initial angle of OA from the downward vertical", unit="deg", low=-180.0, high=180.0)
    ] = 90.0,
    theta_AB: Annotated[
        float, Param("initial angle of AB from the downward vertical", unit="deg", low=-180.0, high=180.0)
    ] = 90.0,
    theta_BC: Annotated[
        float, Param("initial angle of BC from the downward vertical", unit="deg", low=-180.0, high=180.0)
    ] = 90.0,
    length: Annotated[float, Param("length of each rod", unit="m", low=0.0, exclusive=True)] = 0.15,
    radius: Annotated[float, Param("radius of rods and tip", unit="m", low=0.0, exclusive=True)] = 0.013,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 2700.0,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.27,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 70e9,
    E_t: Annotated[float, Param("tangent modulus", unit="Pa", low=0.0)] = 27e9,
    sigma_y: Annotated[float, Param("yield stress", unit="Pa", low=0.0, exclusive=True)] = 110e6,
    beta: Annotated[float, Param("hardening: 0 kinematic, 1 isotropic", low=0.0, high=1.0)] = 0.0,
    rigid_inertia: Annotated[str, Param("inertia in the rigid phase", choices=("slender", "mesh"))] = "mesh",
    hinge: Annotated[
        str,
        Param(
            "plain: joint_nodes of rods that meet on the axis; lug: fork and eye, with a pin in their holes",
            choices=("plain", "lug"),
        ),
    ] = "plain",
    joint_nodes: Annotated[str, Param("nodes tied at each hinge", choices=("axis", "ends", "pin"))] = "axis",
    pin_radius: Annotated[
        float | None,
        Param(
            "reach of a pin around the axis, with joint_nodes=pin; None: 0.75 radius",
            unit="m",
            low=0.0,
            exclusive=True,
        ),
    ] = None,
    rigid_bodies: Annotated[str | None, Param("bodies that stay rigid in the impact, as OA,AB; None: none")] = None,
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True, words=("auto",))] = 0.1,
    t_end: Annotated[
        float | None,
        Param(
            "end of a run of swings and impacts in turn, from the release; None: one impact",
            unit="s",
            low=0.0,
            exclusive=True,
        ),
    ] = None,
    duration: Annotated[
        float,
        Param("simulated time after contact, with t_end of each impact at most", unit="s", low=0.0, exclusive=True),
    ] = 0.6e-3,
    output_interval: Annotated[
        float, Param("time between rows of the history", unit="s", low=0.0, exclusive=True)
    ] = 1e-6,
    section: Annotated[int, Param("cells along each side of a rod's core, even", low=2)] = 4,
    ring: Annotated[int, Param("cells from a rod's core to its surface", low=1)] = 2,
    axial: Annotated[int, Param("cells along each rod's cylinder", low=1)] = 12,
    focus_size: Annotated[
        float, Param("cell size at the contact, on the tip and on the plate", unit="m", low=0.0, exclusive=True)
    ] = 0.6e-3,
    focus_layers: Annotated[int, Param("cells from the fine patch of the tip to its coarse mesh", low=1)] = 4,
    plate_core: Annotated[int, Param("fine cells of the plate along x and along z, even", low=2)] = 8,
    plate_core_depth: Annotated[int, Param("fine cells of the plate downwards", low=1)] = 3,
    plate_layers: Annotated[int, Param("cells from the plate's fine core to its local box", low=1)] = 8,
    plate_extension: Annotated[int, Param("cells along x from the local box to each end", low=1)] = 10,
) -> mca.Scene:
    """Rods OA, AB and BC of aluminium, and a plate of the same that slides freely along x."""
    metal = mca.J2Bilinear(E=E, nu=nu, rho=rho, sigma_y=sigma_y, E_t=E_t, beta=beta)
    rod = {"section": section, "ring": ring, "axial": axial}
    return arm(
        "three_link",
        ("OA", "AB", "BC"),
        theta=(math.radians(theta_OA), math.radians(theta_AB), math.radians(theta_BC)),
        length=length,
        radius=radius,
        H=H,
        gravity=gravity,
        rods=(rod, rod, rod),
        focus={"focus_size": focus_size, "focus_layers": focus_layers},
        materials={"body": metal, "tip": metal, "plate": metal},
        plate=mca.Plate(
            length=1.2,
            width=0.1,
            height=0.05,
            core=(plate_core, plate_core),
            core_depth=plate_core_depth,
            core_size=focus_size,
            layers=plate_layers,
            extension=plate_extension,
        ),
        v_plate=0.0,
        contact={"mu": mu, "penalty": penalty},
        hinge=hinge,
        joint_nodes=joint_nodes,
        pin_radius=pin_radius,
        rigid_inertia=rigid_inertia,
        t_end=t_end,
        rigid_bodies=rigid_bodies,
        impact=mca.ImpactPhase(duration=duration, output_interval=output_interval),
    )


def check(result: mca.Result) -> list[str]:
    """What a default run must show: the tip meets the plate, nothing is lost at hand-off, and one impact."""
    found = []
    reach = [0.15 * math.cos(theta) for theta in result.summary["theta"]]
    height = sum(reach[:2]) + (0.15 - 0.013) * math.cos(result.summary["theta"][2]) + 0.013
    if abs(height - 0.38) > 1e-12:
        found.append(f"the tip touches {height:.15g} m below O, the plate lies 0.38 m below")
    worst = max(result.summary["handoff_mismatch"].values())
    if worst > 1e-12:
        found.append(f"hand-off changes momenta or energy by {worst:.2g} of themselves")
    if len(result.summary["contacts"]) != 1:
        found.append(f"expected one contact, found {result.summary['contacts']}")
    return found
