"""Owns pressures and tractions on surfaces: their faces on the host and on the device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.joining import AS_IS, joinable, of
from warp_mca.geometry.cell_types import CELL_TYPES
from warp_mca.geometry.mesh import Mesh
from warp_mca.kernels.loads.nodes import DEAD, FOLLOWS, PRESSURE, LoadedFaces, push_faces
from warp_mca.physics.loads.pushed import PushedNodes, TimedNodes
from warp_mca.scene.loads import Pressure, Traction
from warp_mca.system.bodies import Bodies
from warp_mca.system.stage import Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System

Index = NDArray[np.int32]
Array = NDArray[np.float64]


@joinable
@dataclass(frozen=True, kw_only=True)
class FaceLoad(TimedNodes):
    """One load on faces.

    Attributes:
        face: corners, triangles with the last one twice, shape (face_count, 4), int32.
        alone: corner that is no node within an edge, of parts of faces of six nodes, else -1, shape (face_count,),
            int32.
        traction: at factor 1 [Pa], (0, 0, -p) of a pressure p, shape (3,), float64.
        mode: of `kernels.loads.nodes`.
    """

    face: Index = field(metadata=of("nodes"))
    alone: Index = field(metadata=AS_IS)
    traction: Array = field(metadata=AS_IS)
    mode: int = field(metadata=AS_IS)


def lone_corners(mesh: Mesh, face: Index) -> Index:
    """Corner of each triangle whose two others lie within edges, -1 where there is none, shape (face_count,), int32."""
    middle = np.zeros(len(mesh.points), dtype=bool)
    for name, cells in mesh.cells.items():
        if CELL_TYPES[name].linear:
            middle[cells[:, CELL_TYPES[CELL_TYPES[name].linear].corners :]] = True
    within = middle[face[:, :3]]
    return np.where(within.sum(axis=1) == 2, within.argmin(axis=1), -1).astype(np.int32)


def corner_areas(x: Array, alone: Index) -> Array:
    """Integral of each corner's shape function over faces [m^2], as `share_of_face`, shape (face_count, 4)."""
    found = np.zeros(x.shape[:2])
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    for xi, eta in signs / np.sqrt(3.0):
        weight = 0.25 * (1.0 + signs[:, 0] * xi) * (1.0 + signs[:, 1] * eta)
        slopes = 0.25 * np.stack([signs[:, 0] * (1.0 + signs[:, 1] * eta), signs[:, 1] * (1.0 + signs[:, 0] * xi)])
        along, across = np.einsum("sa,fai->sfi", slopes, x)
        found += np.linalg.norm(np.cross(along, across), axis=1)[:, None] * weight
    part = alone >= 0
    whole = 0.5 * found[part].sum(axis=1)
    found[part] = whole[:, None] * (np.arange(4) < 3)
    found[np.flatnonzero(part), alone[part]] = 0.0
    return found


def build(load: Pressure | Traction, assembly: Bodies) -> FaceLoad:
    """Arrays of a load.

    Raises:
        RequestError: its node set covers no face.
    """
    mesh = assembly.meshes[load.body]
    face, _ = mesh.surface(load.nodes)
    own, alone = (face + assembly.node_start[load.body]).astype(np.int32), lone_corners(mesh, face)
    if isinstance(load, Pressure):
        mode, traction = PRESSURE, (0.0, 0.0, -load.pressure)
    else:
        mode, traction = FOLLOWS if load.follows else DEAD, load.traction
    return FaceLoad(
        node=np.unique(own).astype(np.int32),
        times=np.array(load.table.times),
        values=np.array(load.table.values),
        force=float(np.linalg.norm(traction) * corner_areas(mesh.points[face], alone).sum()),
        face=own,
        alone=alone,
        traction=np.array(traction),
        mode=mode,
    )


class Stage(PushedNodes):
    """Device side of pressures, or of tractions."""

    def __init__(self, solver: System, name: str) -> None:
        """Allocate on the current device."""
        super().__init__(solver, name)
        found = self.faces = LoadedFaces()
        items = self.items
        load = np.repeat(np.arange(len(items)), [len(item.face) for item in items])
        found.face = wp.array(np.concatenate([item.face for item in items]), dtype=wp.vec4i)
        found.alone = wp.array(np.concatenate([item.alone for item in items]), dtype=wp.int32)
        found.load = wp.array(load, dtype=wp.int32)
        found.mode = wp.array([item.mode for item in items], dtype=wp.int32)
        found.traction = wp.array([item.traction for item in items], dtype=wp.vec3d)
        self.corner = wp.array(self.order, dtype=wp.int32)
        self.may_end(np.concatenate([item.face for item in items]), found.face)

    def listed(self, items: Sequence[Any]) -> Index:
        """Corners of all faces."""
        return np.concatenate([item.face.ravel() for item in items])

    def kernels(self) -> list[Any]:
        """That of the forces."""
        return [push_faces, *(self.lasting.kernels() if self.lasting else [])]

    def push(self, step: Step, start: bool = False) -> None:
        """Forces on nodes, and their work."""
        inputs = [self.corner, self.faces, self.tables, self.work.X, step.state.u]
        self.launch(push_faces, inputs, step, start)
