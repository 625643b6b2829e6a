"""Owns the parameters that the arms of one, two and three links have in common: type, meaning, unit and limits."""

from __future__ import annotations

from typing import Annotated

from warp_mca import Param

Friction = Annotated[float, Param("coefficient of friction", low=0.0, high=10.0)]
Gravity = Annotated[float, Param("acceleration of gravity", unit="m/s^2", low=0.0, exclusive=True)]
Density = Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)]
PoissonRatio = Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)]
YoungModulus = Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)]
TangentModulus = Annotated[float, Param("tangent modulus", unit="Pa", low=0.0)]
YieldStress = Annotated[float, Param("yield stress", unit="Pa", low=0.0, exclusive=True)]
Hardening = Annotated[float, Param("hardening: 0 kinematic, 1 isotropic", low=0.0, high=1.0)]
RigidInertia = Annotated[str, Param("inertia in the rigid phase", choices=("slender", "mesh"))]
Hinge = Annotated[
    str,
    Param(
        "plain: joint_nodes of rods that meet on the axis; lug: fork and eye, with a pin in their holes",
        choices=("plain", "lug"),
    ),
]
JointNodes = Annotated[str, Param("nodes tied at each hinge", choices=("axis", "ends", "pin"))]
PinRadius = Annotated[
    float | None,
    Param("reach of a pin around the axis, with joint_nodes=pin; None: 0.75 radius", unit="m", low=0.0, exclusive=True),
]
PenaltyFactor = Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True, words=("auto",))]
EndTime = Annotated[
    float | None,
    Param(
        "end of a run of swings and impacts in turn, from the release; None: one impact",
        unit="s",
        low=0.0,
        exclusive=True,
    ),
]
Duration = Annotated[
    float, Param("simulated time after contact, with t_end of each impact at most", unit="s", low=0.0, exclusive=True)
]
OutputInterval = Annotated[float, Param("time between rows of the history", unit="s", low=0.0, exclusive=True)]
FocusSize = Annotated[
    float, Param("cell size at the contact, on the tip and on the plate", unit="m", low=0.0, exclusive=True)
]
FocusLayers = Annotated[int, Param("cells from the fine patch of the tip to its coarse mesh", low=1)]
PlateCore = Annotated[int, Param("fine cells of the plate along x and along z, even", low=2)]
PlateCoreDepth = Annotated[int, Param("fine cells of the plate downwards", low=1)]
PlateLayers = Annotated[int, Param("cells from the plate's fine core to its local box", low=1)]
PlateExtension = Annotated[int, Param("cells along x from the local box to each end", low=1)]
HeightOfO = Annotated[float, Param("height of hinge O above the plate", unit="m", low=0.0, exclusive=True)]
AngleOA = Annotated[float, Param("initial angle of OA from the downward vertical", unit="deg", low=-180.0, high=180.0)]
AngleAB = Annotated[float, Param("initial angle of AB from the downward vertical", unit="deg", low=-180.0, high=180.0)]
RodLength = Annotated[float, Param("length of each rod", unit="m", low=0.0, exclusive=True)]
RodRadius = Annotated[float, Param("radius of rods and tip", unit="m", low=0.0, exclusive=True)]
Section = Annotated[int, Param("cells along each side of a rod's core, even", low=2)]
Ring = Annotated[int, Param("cells from a rod's core to its surface", low=1)]
