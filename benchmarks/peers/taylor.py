"""Owns Taylor's impact test as every code solves it: a copper bar at 227 m/s, its foot held on the wall from t = 0 on.

Scripts take the path of a mesh, which `write_mesh` makes, as their last word. Needs NumPy only, because other codes'
interpreters import it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import bar
import numpy as np

E, NU, RHO = 117e9, 0.35, 8930.0
YIELD, E_T = 400e6, 100e6  # [Pa]; hardening is isotropic
HARDENING = E * E_T / (E - E_T)
LENGTH, RADIUS, SPEED = 32.4e-3, 3.2e-3, 227.0  # [m], [m/s], along x onto the wall
DURATION = 80e-6
STEPS = 4800  # a tenth of the first stable step: cells of the foot flatten
DT = DURATION / STEPS
CELLS = {"section": 4, "ring": 2, "axial": 24}
FOOT = 7.22e-3  # radius on converged meshes [m]: Foulk et al., Int. J. Numer. Meth. Engng (2021)


def write_mesh(path: Path) -> None:
    """Points [m], bricks in VTK's order and nodes of the foot, of warp_mca's own mesh, for all codes."""
    import warp_mca as mca

    made = mca.Rod(radius=RADIUS, length=LENGTH, tip="flat", **CELLS).build()
    np.savez(path, points=made.points, bricks=made.hexahedra, foot=made.node_sets["end"])


def mesh() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `write_mesh` wrote."""
    with np.load(sys.argv[-1]) as data:
        return data["points"], data["bricks"].astype(np.int64), data["foot"].astype(np.int64)


def shape(points: np.ndarray, u: np.ndarray, foot: np.ndarray) -> tuple[float, float]:
    """Length, and mean radius of the foot's rim [m], after displacements u [m]."""
    rim = foot[np.hypot(*points[foot, 1:].T) > 0.999 * RADIUS]
    x = points + u
    return float(np.ptp(x[:, 0])), float(np.hypot(*x[rim, 1:].T).mean())


def say(code: str, version: str, element: str, wall: float, cells: int, final: tuple[float, float]) -> None:
    """The line of JSON."""
    length, radius = final
    row = {
        "problem": "taylor",
        "code": code,
        "version": version,
        "element": element,
        "n_elements": cells,
        "n_steps": STEPS,
        "dt": DT,
        "wall": wall,
        "rate": cells * STEPS / wall,
        "length": length,
        "radius": radius,
        "error": abs(radius / FOOT - 1.0),
    }
    print(json.dumps(row))


clock, one_thread = bar.clock, bar.one_thread
