"""A falling two-link manipulator strikes a rough moving plate with its tip.

Parameters are those of Table 1 of "Frictional impact analysis of an elastoplastic multi-link robotic system using a
multi-timescale modelling approach"; where the table contradicts itself, the rods have a radius of 13 mm.
"""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param
from warp_mca.scenes import _arm_parameters as common
from warp_mca.scenes._arm import arm
from warp_mca.scenes._tied import with_coarse_rods, with_nested_plate

PRESETS: dict[str, dict[str, object]] = {
    "quick": {},
    "standard": {
        "section": 12,
        "ring": 4,
        "axial_OA": 41,
        "axial_AB": 38,
        "focus_size": 0.33e-3,
        "focus_layers": 7,
        "plate_core_x": 18,
        "plate_core_z": 10,
        "plate_core_depth": 5,
        "plate_layers": 12,
        "plate_extension": 20,
    },
    "paper": {
        "section": 20,
        "ring": 6,
        "axial_OA": 61,
        "axial_AB": 58,
        "focus_size": 0.2e-3,
        "focus_layers": 10,
        "plate_core_x": 28,
        "plate_core_z": 20,
        "plate_core_depth": 8,
        "plate_layers": 15,
        "plate_extension": 28,
    },
}


def _paths(length: float, radius: float) -> tuple[mca.Path, ...]:
    """Paths 1, 2 and 3 of Fig. 10: upper surface, axis and lower surface of both rods, from the tip to hinge O.

    As in Fig. 11, positions count from the tip's end, and the hinges and the tip are left out.
    """
    end, hinge = 1.14 * radius, 1.45 * radius

    def path(name: str, title: str, y: float) -> mca.Path:
        lower = mca.Line(body="AB", start=(length - end, y, 0.0), end=(hinge, y, 0.0), position=end)
        upper = mca.Line(body="OA", start=(length - hinge, y, 0.0), end=(end, y, 0.0), position=length + hinge)
        return mca.Path(name=name, lines=(lower, upper), spacing=length / 84.0, title=title)

    sides = (("upper surface", -radius), ("axis", 0.0), ("lower surface", radius))
    return tuple(path(f"Path {k}", title, y) for k, (title, y) in enumerate(sides, 1))


def build(
    *,
    mu: common.Friction = 0.47,
    v_plate: Annotated[float, Param("initial velocity of the plate along x", unit="m/s", low=-50.0, high=50.0)] = 0.0,
    H: common.HeightOfO = 0.37,
    gravity: common.Gravity = 9.8,
    theta_OA: common.AngleOA = 90.0,
    theta_AB: common.AngleAB = 90.0,
    length: common.RodLength = 0.21,
    radius: common.RodRadius = 0.013,
    plate_length: Annotated[float, Param("length of the plate, along x", unit="m", low=0.0, exclusive=True)] = 1.2,
    plate_width: Annotated[float, Param("width of the plate, along z", unit="m", low=0.0, exclusive=True)] = 0.1,
    plate_height: Annotated[float, Param("thickness of the plate", unit="m", low=0.0, exclusive=True)] = 0.05,
    rho: common.Density = 2700.0,
    nu: common.PoissonRatio = 0.27,
    E_tip: Annotated[
        float, Param("Young's modulus of the hemispherical tip", unit="Pa", low=0.0, exclusive=True)
    ] = 70e9,
    E_body: Annotated[
        float, Param("Young's modulus of the rods' cylinders", unit="Pa", low=0.0, exclusive=True)
    ] = 70e9,
    E_plate: Annotated[float, Param("Young's modulus of the plate", unit="Pa", low=0.0, exclusive=True)] = 70e9,
    E_t_tip: Annotated[float, Param("tangent modulus of the tip", unit="Pa", low=0.0)] = 27e9,
    E_t_body: Annotated[float, Param("tangent modulus of the rods' cylinders", unit="Pa", low=0.0)] = 27e9,
    E_t_plate: Annotated[float, Param("tangent modulus of the plate", unit="Pa", low=0.0)] = 27e9,
    sigma_y: common.YieldStress = 110e6,
    beta: common.Hardening = 0.0,
    plastic: Annotated[bool, Param("bodies yield; off: linear elastic")] = True,
    rigid_inertia: common.RigidInertia = "slender",
    hinge: common.Hinge = "plain",
    joint_nodes: common.JointNodes = "ends",
    pin_radius: common.PinRadius = None,
    rigid_bodies: Annotated[
        str | None, Param("bodies that stay rigid in the impact, as OA or OA,plate; None: none")
    ] = None,
    penalty: common.PenaltyFactor = 0.1,
    two_way: Annotated[bool, Param("contact checks the nodes of both sides")] = False,
    t_end: common.EndTime = None,
    duration: common.Duration = 0.6e-3,
    output_interval: common.OutputInterval = 1e-6,
    bulk_viscosity: Annotated[float, Param("linear coefficient of bulk viscosity; 0: none", low=0.0, high=10.0)] = 0.0,
    time_step_scale: Annotated[float, Param("share of the stable time step", low=0.0, high=1.0)] = 0.9,
    section: common.Section = 6,
    ring: common.Ring = 3,
    axial_OA: Annotated[int, Param("cells along OA", low=1)] = 16,
    axial_AB: Annotated[int, Param("cells along the cylinder of AB", low=1)] = 15,
    axial_ratio: Annotated[
        float, Param("length of AB's cells at the hinge over those at the tip", low=0.0, exclusive=True)
    ] = 2.0,
    focus_size: common.FocusSize = 0.6e-3,
    focus_layers: common.FocusLayers = 4,
    plate_core_x: Annotated[int, Param("fine cells of the plate along x, even", low=2)] = 10,
    plate_core_z: Annotated[int, Param("fine cells of the plate along z, even", low=2)] = 6,
    plate_core_depth: common.PlateCoreDepth = 3,
    plate_layers: common.PlateLayers = 8,
    plate_extension: common.PlateExtension = 14,
    plate_absorbs: Annotated[
        str,
        Param(
            "sides of the plate through which waves leave, so that it can be cut; all: springs are its support",
            choices=("none", "ends", "all"),
        ),
    ] = "none",
    plate_mesh: Annotated[
        str, Param("graded; nested: tied boxes, each of coarser cells around the last", choices=("graded", "nested"))
    ] = "graded",
    fine_length: Annotated[
        float | None,
        Param("length of AB's end with its fine section, tied to a coarse rod; None: all of both rods", unit="m"),
    ] = None,
    rod_section: Annotated[int, Param("section of the coarse rods, with fine_length; even", low=2)] = 4,
    rod_ring: Annotated[int, Param("ring of the coarse rods, with fine_length", low=1)] = 2,
) -> mca.Scene:
    """The scene of Table 1, Fig. 1 of the paper, with any of its values changed."""
    theta = (math.radians(theta_OA), math.radians(theta_AB))

    def aluminium(E: float, E_t: float) -> mca.Elastic:
        if plastic:
            return mca.J2Bilinear(E=E, nu=nu, rho=rho, sigma_y=sigma_y, E_t=E_t, beta=beta)
        return mca.Elastic(E=E, nu=nu, rho=rho)

    plate = mca.Plate(
        length=plate_length,
        width=plate_width,
        height=plate_height,
        core=(plate_core_x, plate_core_z),
        core_depth=plate_core_depth,
        core_size=focus_size,
        layers=plate_layers,
        extension=plate_extension,
    )
    scene = arm(
        "two_link",
        ("OA", "AB"),
        theta=theta,
        length=length,
        radius=radius,
        H=H,
        gravity=gravity,
        rods=(
            {"section": section, "ring": ring, "axial": axial_OA},
            {"section": section, "ring": ring, "axial": axial_AB, "axial_ratio": axial_ratio},
        ),
        focus={"focus_size": focus_size, "focus_layers": focus_layers},
        materials={
            "body": aluminium(E_body, E_t_body),
            "tip": aluminium(E_tip, E_t_tip),
            "plate": aluminium(E_plate, E_t_plate),
        },
        plate=plate,
        v_plate=v_plate,
        contact={"mu": mu, "penalty": penalty, "two_way": two_way},
        hinge=hinge,
        joint_nodes=joint_nodes,
        pin_radius=pin_radius,
        rigid_inertia=rigid_inertia,
        impact=mca.ImpactPhase(
            duration=duration,
            output_interval=output_interval,
            time_step_scale=time_step_scale,
            bulk_viscosity=bulk_viscosity or None,
        ),
        paths=_paths(length, radius),
        t_end=t_end,
        absorbs=plate_absorbs,
        rigid_bodies=rigid_bodies,
        element="hex8",  # the paper's
    )
    scene = with_nested_plate(scene) if plate_mesh == "nested" else scene
    return scene if fine_length is None else with_coarse_rods(scene, fine_length, rod_section, rod_ring)


def check(result: mca.Result) -> list[str]:
    """What a run with the default parameters must show."""
    found = []
    if len(result.summary["contacts"]) != 1:
        found.append(f"expected one contact, found {result.summary['contacts']}")
    if not 0.36e-3 <= result.summary["contact_duration"] <= 0.45e-3:
        found.append(f"contact lasted {result.summary['contact_duration']:.3g} s instead of 0.36 to 0.45 ms")
    if len(result.summary["F_n_peaks"]) != 2:
        found.append(f"expected two peaks of F_n, found {len(result.summary['F_n_peaks'])}")
    return found
