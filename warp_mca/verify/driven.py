"""Owns one cube whose corners follow a given deformation gradient: what cases of laws impose on one element."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.material import displacement

SIZE, TURNS = 1e-3, 3  # edge of the cube [m], turns of those that turn


def turned(U: Array) -> Array:
    """Deformation gradients, turned three times around (1, 2, 2), from rest to rest; shape (row_count, 3, 3)."""
    from scipy.spatial.transform import Rotation

    s = np.linspace(0.0, 1.0, len(U))
    angle = 2.0 * np.pi * TURNS * (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))
    return Rotation.from_rotvec(angle[:, None] * (np.array([1.0, 2.0, 2.0]) / 3.0)).as_matrix() @ U


def driven_cube(material: mca.Elastic, F: Array, duration: float, **body: Any) -> mca.Scene:
    """A cube of one hexahedron, or of what `element` cuts it to, that is deformed all alike.

    Args:
        material: of the cube.
        F: deformation gradient at equal steps of time, I at first, shape (row_count, 3, 3).
        duration: [s].
        body: fields of `Body`.
    """
    s = np.linspace(0.0, 1.0, len(F))
    rate = np.gradient(F, duration * s, axis=0, edge_order=2)
    mesh = mca.Box(size=(SIZE, SIZE, SIZE), divisions=(1, 1, 1)).build()
    corners = {f"corner{i}": np.array([i], dtype=np.int32) for i in range(8)}
    mesh = dataclasses.replace(mesh, node_sets={**mesh.node_sets, **corners})
    times, middle = tuple((duration * s).tolist()), 0.5 * SIZE
    driven = tuple(
        mca.Prescribed(body="cube", nodes=f"corner{i}", axis=axis, times=times, velocities=tuple(speed.tolist()))
        for i, X in enumerate(mesh.points)
        for axis, speed in zip("xyz", (rate @ X).T, strict=True)
    )
    line = mca.Line(body="cube", start=(0.0, middle, middle), end=(SIZE, middle, middle))
    return mca.Scene(
        name="driven_cube",
        bodies=(mca.Body(name="cube", geometry=mesh, material=material, **body),),
        prescribed=driven,
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 50.0, energy_tolerance=0.1),
        paths=(mca.Path(name="axis", lines=(line,), spacing=middle),),
    )


def imposed(scene: mca.Scene, time: Array) -> Array:
    """Deformation gradients of `driven_cube` at these times [s], shape (row_count, 3, 3)."""
    F = np.zeros((len(time), 3, 3)) + np.eye(3)
    points: Array = scene.bodies[0].geometry.points  # pyright: ignore[reportAttributeAccessIssue]
    for item in scene.prescribed:
        X = points[int(str(item.nodes).removeprefix("corner"))]
        if np.count_nonzero(X) == 1:  # along one axis
            F[:, "xyz".index(item.axis), int(X.argmax())] += displacement(item, time) / SIZE
    return F
