"""One rod falls about a hinge and strikes a plate with its hemispherical tip: the smallest chain of the rigid phase."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param
from warp_mca.scenes import _arm_parameters as common
from warp_mca.scenes._arm import arm, fine

PRESETS: dict[str, dict[str, object]] = {
    "quick": {},
    "fine": fine(axial=38),
}


def build(
    *,
    mu: common.Friction = 0.47,
    H: Annotated[float, Param("height of the hinge above the plate", unit="m", low=0.0, exclusive=True)] = 0.15,
    gravity: common.Gravity = 9.8,
    theta: Annotated[
        float, Param("initial angle of the rod from the downward vertical", unit="deg", low=-180.0, high=180.0)
    ] = 90.0,
    length: Annotated[float, Param("length of the rod", unit="m", low=0.0, exclusive=True)] = 0.21,
    radius: Annotated[float, Param("radius of rod and tip", unit="m", low=0.0, exclusive=True)] = 0.013,
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
    rigid_bodies: Annotated[str | None, Param("bodies that stay rigid in the impact, as plate; None: none")] = None,
    penalty: common.PenaltyFactor = 0.1,
    t_end: common.EndTime = None,
    duration: common.Duration = 0.6e-3,
    output_interval: common.OutputInterval = 1e-6,
    section: Annotated[int, Param("cells along each side of the rod's core, even", low=2)] = 4,
    ring: Annotated[int, Param("cells from the rod's core to its surface", low=1)] = 2,
    axial: Annotated[int, Param("cells along the cylinder of the rod", low=1)] = 14,
    focus_size: common.FocusSize = 0.6e-3,
    focus_layers: common.FocusLayers = 4,
    plate_core: common.PlateCore = 6,
    plate_core_depth: common.PlateCoreDepth = 3,
    plate_layers: common.PlateLayers = 6,
    plate_extension: common.PlateExtension = 4,
) -> mca.Scene:
    """The rod OA of aluminium, and a plate of the same that slides freely along x."""
    metal = mca.J2Bilinear(E=E, nu=nu, rho=rho, sigma_y=sigma_y, E_t=E_t, beta=beta)
    return arm(
        "single_link",
        ("OA",),
        theta=(math.radians(theta),),
        length=length,
        radius=radius,
        H=H,
        gravity=gravity,
        rods=({"section": section, "ring": ring, "axial": axial},),
        focus={"focus_size": focus_size, "focus_layers": focus_layers},
        materials={"body": metal, "tip": metal, "plate": metal},
        plate=mca.Plate(
            length=0.4,
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
    """What a default run must show: theta_dot^2 = 3 g cos(theta) / length at contact, and one impact."""
    found = []
    summary = result.summary
    cosine = (0.15 - 0.013) / (0.21 - 0.013)
    rate = math.sqrt(3.0 * 9.8 * cosine / 0.21)
    if abs(summary["theta"][0] - math.acos(cosine)) > 1e-9:
        found.append(f"contact at {summary['theta'][0]:.6f} rad instead of {math.acos(cosine):.6f} rad")
    if abs(-summary["theta_dot"][0] / rate - 1.0) > 0.02:
        found.append(f"angular velocity {summary['theta_dot'][0]:.4g} rad/s is not within 2 % of {-rate:.4g} rad/s")
    if len(summary["contacts"]) != 1:
        found.append(f"expected one contact, found {summary['contacts']}")
    return found
