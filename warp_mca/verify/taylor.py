"""Owns the case of Taylor's impact test: a cylinder of copper that mushrooms on a rigid wall."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.recorders.recorder import Cadence, FramesOnly
from warp_mca.verify.case import Row, Setup, case

if TYPE_CHECKING:
    from warp_mca.recorders.recorder import Frame


class Foot(FramesOnly):
    """A recorder that keeps the final shape of `taylor_bar`.

    Attributes:
        length: greatest extent along x [m].
        radius: mean distance of the nodes of the foot's rim from the axis [m].
    """

    name = "foot"
    needs = frozenset(("surface",))

    def __init__(self, length: float, radius: float) -> None:
        self.cadence = Cadence(frames=2)
        self._end, self._rim = length, radius
        self._nodes: NDArray[np.intp] | None = None
        self.length = self.radius = math.nan

    def frame(self, frame: Frame) -> None:
        """Choose the rim in the first frame, measure in each."""
        x, y, z = np.asarray(frame.points["bar"], dtype=np.float64).T
        distance = np.hypot(y, z)
        if self._nodes is None:
            self._nodes = np.flatnonzero((x > 0.9999 * self._end) & (distance > 0.999 * self._rim))
        self.length, self.radius = float(np.ptp(x)), float(distance[self._nodes].mean())


@case(
    group="impact",
    title="A copper cylinder strikes a rigid wall at 227 m/s and mushrooms as other codes have it",
    reference="Taylor's impact test. Foot held on the wall, as in publications: radius 7.22 mm of converged "
    "hexahedra, Foulk et al., Int. J. Numer. Meth. Engng (2021); 7.0 to 7.2 mm on the meshes of earlier "
    "authors, as Simo, Comput. Meth. Appl. Mech. Engng 99 (1992) 61, and Camacho and Ortiz, ibid. 142 (1997) 269. "
    "Length, and all of a foot that is free to leave the wall: axisymmetric elements with a multiplicative law, "
    "benchmarks/taylor_axisymmetric.py, taken to the limit.",
)
def taylor_bar(setup: Setup) -> list[Row]:
    """L = 32.4 mm, R = 3.2 mm, E = 117 GPa, nu = 0.35, 8930 kg/m^3, sigma_y = 400 MPa, E_t = 100 MPa; finite strain.

    The radius is the mean over the rim's nodes, which lay on the circle: the corners of the core lead to rim nodes up
    to 1 % farther out. Free, the rim lifts off the wall by 0.3 mm and spreads farther. Cells of the foot flatten, so
    that the step is a small share of the first stable one.
    """
    counts = setup.choose((24,), (24, 36))
    rows, sizes = [], tuple(1.0 / count for count in counts)
    for foot, final_length, final_radius in setup.choose(_FEET[:1], _FEET):
        length, radius = zip(*(mushroom(setup, count, foot) for count in counts), strict=True)
        coarse = 24.0 / counts[-1]
        left = (
            coarse * setup.by_element(0.10, hex8r=0.32),
            coarse * setup.by_element(0.22, hex8i=0.24, hex8r=0.34, tet4=0.30),
        )
        alone = setup.by_element(
            "",
            hex8i="; nodes of the foot alone lag: the section a cell above is as wide as with hex8 (0.003 mm), and "
            "36 and 48 cells of either lead to 7.22 mm, with the order 1.2 between them",
        )
        found = (("length", final_length, length), ("radius", final_radius, radius))
        for (what, exact, measured), mesh in zip(found, left, strict=True):
            why = f"the references agree within 0.03 mm; order 1 leaves {mesh:.2f} mm on the finest mesh, as the "
            why += "change from 24 to 36 cells shows" + alone * (what == "radius")
            rows.append(
                Row(f"final {what}, foot {foot}", exact, measured, "mm", (0.03 + mesh) / exact, why, sizes=sizes)
            )
    return rows


_FEET = (("held", 21.42, 7.22), ("free", 21.47, 7.38))  # with final length and radius of the foot [mm]


def mushroom(setup: Setup, count: int, foot: str) -> tuple[float, float]:
    """Final length and radius of the foot [mm], with `count` cells along the bar, a sixth as many over its radius."""
    shape = Foot(0.0324, 0.0032)
    scale = setup.by_element(0.15, hex8r=0.12) * 24.0 / count
    mesh = {"axial": count, "section": count // 6, "ring": count // 12}
    setup.run(setup.scene("taylor_bar", foot=foot, time_step_scale=scale, **mesh), recorders=[shape])
    return 1e3 * shape.length, 1e3 * shape.radius
