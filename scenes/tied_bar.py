"""A pulse runs along a bar from a fine mesh to a coarse one that is tied to it."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"axial_fine": 200, "axial": 100}}

_TABLE = 800  # entries of the table of the driven end's velocity


def build(
    *,
    v: Annotated[float, Param("greatest speed of the driven end", unit="m/s")] = 1.0,
    pulse: Annotated[float, Param("length of the pulse", unit="m", low=0.0, exclusive=True)] = 0.12,
    length: Annotated[float, Param("length of each half of the bar", unit="m", low=0.0, exclusive=True)] = 0.3,
    side: Annotated[float, Param("side of its section", unit="m", low=0.0, exclusive=True)] = 0.012,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 200e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.0,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 7800.0,
    fine: Annotated[int, Param("cells along the side of the section of the fine half", low=1)] = 4,
    coarse: Annotated[int, Param("the same of the coarse half", low=1)] = 2,
    axial_fine: Annotated[int, Param("cells along the fine half", low=1)] = 100,
    axial: Annotated[int, Param("cells along the coarse half", low=1)] = 50,
) -> mca.Scene:
    """A bar along x whose end x = 0 is driven, for as long as what the tie sends back needs to come halfway back."""
    c = math.sqrt(E / rho)
    end, duration = pulse / c, (1.5 * length + pulse) / c
    times = tuple(end * i / _TABLE for i in range(_TABLE + 1))

    def half(name: str, x: float, divisions: tuple[int, int, int]) -> mca.Body:
        box = mca.Box(size=(length, side, side), divisions=divisions, origin=(x, -0.5 * side, -0.5 * side))
        return mca.Body(name=name, geometry=box, material=mca.Elastic(E=E, nu=nu, rho=rho))

    def axis(name: str, x: float) -> mca.Line:
        return mca.Line(body=name, start=(x, 0.0, 0.0), end=(x + length, 0.0, 0.0), position=x)

    return mca.Scene(
        name="tied_bar",
        bodies=(half("fine", 0.0, (axial_fine, fine, fine)), half("coarse", length, (axial, coarse, coarse))),
        ties=(mca.Tie(slave=mca.Surface(body="fine", nodes="xmax"), master=mca.Surface(body="coarse", nodes="xmin")),),
        prescribed=(
            mca.Prescribed(
                body="fine",
                nodes="xmin",
                axis="x",
                times=times,
                velocities=tuple(v * math.sin(math.pi * t / end) ** 2 for t in times),
            ),
        ),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 600.0),
        paths=(mca.Path(name="axis", lines=(axis("fine", 0.0), axis("coarse", length)), spacing=length / 20.0),),
        tip=mca.Point(body="coarse", at=(1.5 * length, 0.0, 0.0)),
    )


def check(result: mca.Result) -> list[str]:
    """What a run with the default parameters must show."""
    error = float(result.summary["energy_error"])
    return [f"the energy balance is off by {error:.2g}"] if error > 1e-3 else []
