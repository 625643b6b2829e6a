"""Recipes and measures that tests of geometry share."""

from __future__ import annotations

import math

import numpy as np

from warp_mca.geometry import Mesh, Plate, Rod

R, LENGTH, FOCUS = 0.013, 0.21, math.radians(36.43)


def rod(**changes) -> Rod:
    return Rod(**{"radius": R, "length": LENGTH, "focus_angle": FOCUS, "axial": 4, **changes})


def plate(**changes) -> Plate:
    return Plate(**{"length": 1.2, "width": 0.1, "height": 0.05, **changes})


def area(mesh: Mesh, name: str) -> float:
    """Area of the faces in a node set, each as two triangles [m^2]."""
    p = mesh.points[mesh.surface(name)[0]]
    normals = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])
    return sum(0.5 * np.linalg.norm(normal, axis=1).sum() for normal in normals)
