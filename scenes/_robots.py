"""Builds scenes of machines from the text of a robot file, for `arm_strike`, `leg_landing` and `gripper`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import warp_mca as mca
from warp_mca import Param

STEEL = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=1.5e9, E_t=2e9)  # of tools
ALUMINIUM = mca.J2Bilinear(E=70e9, nu=0.33, rho=2700.0, sigma_y=240e6, E_t=0.7e9)

Duration = Annotated[float, Param("of the impact", unit="s", low=0.0, exclusive=True)]
Stiffness = Annotated[float, Param("of contact between rigid links, at each node", unit="N/m", low=0.0, exclusive=True)]
Friction = Annotated[float, Param("coefficient of friction", unit="-", low=0.0)]


def struck(name: str, text: str, machine: Mapping[str, Any], duration: float, **strike: Any) -> mca.Scene:
    """The impact of a machine that swings until it touches something, from the text of its MJCF file.

    Args:
        name: of the scene.
        text: of the file.
        machine: further arguments of `mca.Robot`.
        duration: of the impact [s].
        strike: further arguments of `mca.Robot.strike`.

    Raises:
        RequestError: MuJoCo is not installed.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.xml"
        path.write_text(text, encoding="utf-8")
        impact = mca.ImpactPhase(duration=duration, output_interval=duration / 200)
        scene = mca.Robot(path, **machine).strike(impact=impact, drawn=True, name=name, **strike)
    return replace(scene, up=(0.0, 0.0, 1.0))
