"""A falling three-link manipulator strikes a plate with its hemispherical tip."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param
from warp_mca.scenes import _arm_parameters as common
from warp_mca.scenes._arm import arm, fine

PRESETS: dict[str, dict[str, object]] = {
    "quick": {},
    "fine": fine(axial=30),
}


def build(
    *,
    mu: common.Friction = 0.47,
    H: common.HeightOfO = 0.38,
    gravity: common.Gravity = 9.8,
    theta_OA: common.AngleOA = 90.0,
    theta_AB: common.AngleAB = 90.0,
    theta_BC: Annotated[
        float, Param("initial angle of BC from the downward vertical", unit="deg", low=-180.0, high=180.0)
    ] = 90.0,
    length: common.RodLength = 0.15,
    radius: common.RodRadius = 0.013,
    rho: common.Density = 2700.0,
    nu: common.PoissonRatio = 0.27,
    E: common.YoungModulus = 70e9,
    E_t: common.TangentModulus = 27e9,
    sigma_y: common.YieldStress = 110e6,
    beta: common.Hardening = 0.0,
    rigid_inertia: common.RigidInertia = "mesh",
    hinge: common.Hinge = "plain",
    joint_nodes: common.JointNodes = "axis",
    pin_radius: common.PinRadius = None,
    rigid_bodies: Annotated[str | None, Param("bodies that stay rigid in the impact, as OA,AB; None: none")] = None,
    penalty: common.PenaltyFactor = 0.1,
    t_end: common.EndTime = None,
    duration: common.Duration = 0.6e-3,
    output_interval: common.OutputInterval = 1e-6,
    section: common.Section = 4,
    ring: common.Ring = 2,
    axial: Annotated[int, Param("cells along each rod's cylinder", low=1)] = 12,
    focus_size: common.FocusSize = 0.6e-3,
    focus_layers: common.FocusLayers = 4,
    plate_core: common.PlateCore = 8,
    plate_core_depth: common.PlateCoreDepth = 3,
    plate_layers: common.PlateLayers = 8,
    plate_extension: common.PlateExtension = 10,
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
