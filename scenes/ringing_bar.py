"""A bar in flight whose ends are stopped at once: it rings in standing waves of known length, along or across it."""

from __future__ import annotations

from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"axial": 40, "section": 8}}


def build(
    *,
    motion: Annotated[str, Param("direction of flight, to the bar", choices=("along", "across"))] = "along",
    shape: Annotated[str, Param("of its section", choices=("round", "square"))] = "round",
    v: Annotated[float, Param("speed of flight", unit="m/s", low=0.0, exclusive=True)] = 1.0,
    length: Annotated[float, Param("of the bar", unit="m", low=0.0, exclusive=True)] = 0.05,
    thickness: Annotated[float, Param("diameter, or side of its section", unit="m", low=0.0, exclusive=True)] = 0.02,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 200e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.3,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 7800.0,
    duration: Annotated[float, Param("simulated time", unit="s", low=0.0, exclusive=True)] = 200e-6,
    rows: Annotated[int, Param("of the history", low=1)] = 1000,
    axial: Annotated[int, Param("cells along the bar", low=1)] = 20,
    section: Annotated[int, Param("cells across a square section, or across the core of a round one", low=2)] = 4,
) -> mca.Scene:
    """A bar along x; stress is recorded at its nodes on the axis, or on its upper side where it flies across."""
    radius = 0.5 * thickness
    if shape == "round":
        ring = max(1, section // 2)
        bar = mca.Rod(radius=radius, length=length, tip="flat", section=section, ring=ring, axial=axial)
        ends = ("start", "end")
    else:
        size = (length, thickness, thickness)
        bar = mca.Box(size=size, divisions=(axial, section, section), origin=(0.0, -radius, -radius))
        ends = ("xmin", "xmax")
    # Ends that keep their place along the motion are planes of symmetry of the standing waves; across the bar, a plane
    # of antisymmetry has no displacement in itself at all.
    moving, held = ("x", "") if motion == "along" else ("y", "z")
    height = 0.0 if motion == "along" else radius
    return mca.Scene(
        name="ringing_bar",
        bodies=(
            mca.Body(
                name="bar",
                geometry=bar,
                material=mca.Elastic(E=E, nu=nu, rho=rho),
                velocity=(v, 0.0, 0.0) if motion == "along" else (0.0, v, 0.0),
                exact_mass=False,  # published figures of this scene are of the mass of its cells
            ),
        ),
        fixed=tuple(mca.Fixed(body="bar", nodes=end, axes=held) for end in ends if held),
        prescribed=tuple(
            mca.Prescribed(body="bar", nodes=end, axis=moving, times=(0.0,), velocities=(0.0,)) for end in ends
        ),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / rows),
        paths=(
            mca.Path(
                name="line",
                lines=(mca.Line(body="bar", start=(0.0, height, 0.0), end=(length, height, 0.0)),),
                spacing=length / axial,
            ),
        ),
        tip=mca.Point(body="bar", at=(0.5 * length, 0.0, 0.0)),
    )
