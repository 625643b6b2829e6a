"""Owns line probes: where they lie in the mesh, and the stress that a run recorded along them (paths.npz)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.elements.hexahedron import shape_functions
from warp_mca.elements.tet4 import gradients
from warp_mca.geometry.boxes import cell_boxes
from warp_mca.geometry.mesh import Mesh
from warp_mca.scene import Line, Path, Scene

MOST_PROBES = 100_000  # of a line

if TYPE_CHECKING:
    from warp_mca.model.model import Model

Array = NDArray[np.float64]

CANDIDATES = 64  # elements near a probe that are tried: long thin ones have their centres far away
OUTSIDE = 0.05  # of an element's diagonal that a probe may lie outside: curved surfaces have flat faces


@dataclass(frozen=True)
class Probes:
    """Where the probes of all paths lie in the model.

    Attributes:
        position: of each probe along its path [m], shape (probe_count,), float64, by path.
        corner: nodes of the element around each probe, paths one after the other, shape (probe_count, 8), int32.
        weight: its shape functions at the probe [-], shape (probe_count, 8), float64.
    """

    position: Mapping[str, Array]
    corner: NDArray[np.int32]
    weight: Array


@dataclass(frozen=True)
class PathHistory:
    """Stress along one path in every output interval.

    Attributes:
        name: of the path.
        position: of the probes along the path [m], shape (probe_count,), float64.
        stress: xx, yy, zz, xy, yz, xz in the world frame [Pa], shape (row_count, probe_count, 6), float32.
    """

    name: str
    position: Array
    stress: NDArray[np.float32]

    @property
    def von_mises(self) -> NDArray[np.float32]:
        """Equivalent stress [Pa], shape (row_count, probe_count), float32."""
        xx, yy, zz, xy, yz, xz = np.moveaxis(self.stress, -1, 0)
        direct = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2)
        return np.sqrt(direct + 3.0 * (xy**2 + yz**2 + xz**2))

    def at(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> PathHistory:
        """The same in some output intervals: their numbers, shape (count,), or whether each is, shape (row_count,)."""
        return PathHistory(self.name, self.position, self.stress[rows])


Place = tuple[NDArray[np.int32], Array]  # corners of the cells around the probes of a line, and their weights
Boxes = tuple[Array, Array]  # as from `cell_boxes`
Found = dict[tuple[int, Line, float], Place]  # by mesh, line and spacing


def locate(scene: Scene, model: Model, meshes: Mapping[str, Mesh], found: Found | None = None) -> Probes:
    """Find the elements that the scene's paths run through.

    Args:
        scene, model, meshes: of one run.
        found: places found before, for scenes that share meshes; those found here are added.

    Raises:
        RequestError: a probe lies outside its body.
    """
    position: dict[str, Array] = {}
    corner, weight = [np.zeros((0, 8), np.int32)], [np.zeros((0, 8))]
    found = {} if found is None else found
    boxes: dict[str, list[Boxes]] = {}
    for path in scene.paths:
        along = []
        for line in path.lines:
            mesh = meshes[line.body]
            if not line.length < MOST_PROBES * path.spacing:
                count = line.length / path.spacing
                remedy = f"a line of {line.length:g} m would have {count:.3g} probes; give a larger one"
                raise bad_value(f"Path {path.name}.spacing", path.spacing, remedy)
            share = np.linspace(0.0, 1.0, int(np.ceil(line.length / path.spacing - 1e-9)) + 1)
            key = (id(mesh), line, path.spacing)
            if key not in found:
                at = np.asarray(line.start) + share[:, None] * np.subtract(line.end, line.start)
                if line.body not in boxes:
                    boxes[line.body] = [cell_boxes(mesh.points, cells) for cells in (mesh.hexahedra, mesh.tetrahedra)]
                found[key] = _elements_around(at, mesh, boxes[line.body], path)
            nodes, weights = found[key]
            along.append(line.position + share * line.length)
            corner.append((nodes + model.node_start[line.body]).astype(np.int32))
            weight.append(weights)
        position[path.name] = np.concatenate(along)
    return Probes(position, np.concatenate(corner), np.concatenate(weight))


def _elements_around(at: Array, mesh: Mesh, boxes: Sequence[Boxes], path: Path) -> Place:
    """Corners of the cell around each point, shape (point_count, 8), and their weights there.

    Raises:
        RequestError: a point lies outside the mesh.
    """
    found = []
    if len(mesh.hexahedra):
        found.append(_in_hexahedra(at, mesh, boxes[0]))
    if len(mesh.tetrahedra):
        found.append(_in_tetrahedra(at, mesh, boxes[1]))
    corners, weights, apart, allowed = (np.stack(parts) for parts in zip(*found, strict=True))
    rows = np.arange(len(at))
    best = (apart - allowed).argmin(axis=0)
    apart, allowed = apart[best, rows], allowed[best, rows]
    far = int(np.argmax(apart - allowed))
    if apart[far] > allowed[far]:
        place = ", ".join(f"{x:.6g}" for x in at[far])
        raise bad_value(f"Path {path.name}.lines", f"({place})", f"this point lies {apart[far]:.3g} m outside the body")
    return corners[best, rows], weights[best, rows]


def _nearest(at: Array, points: Array, cells: NDArray[np.int32], boxes: Boxes) -> NDArray[np.intp]:
    """The cells whose centres lie nearest to each point, shape (point_count, candidate_count).

    Only cells near the line are looked at, unless there are none: then the message tells how far it runs outside.
    """
    from scipy.spatial import KDTree

    lower, upper = boxes
    margin = OUTSIDE * np.linalg.norm(upper - lower, axis=0)
    beside = (lower - margin > at.max(axis=0)[:, None]) | (upper + margin < at.min(axis=0)[:, None])
    index = np.flatnonzero(~beside.any(axis=0))
    index = index if len(index) else np.arange(len(cells))
    _, near = KDTree(points[cells[index]].mean(axis=1)).query(at, k=min(CANDIDATES, len(index)))
    return index[np.asarray(near).reshape(len(at), -1)]


def _in_hexahedra(at: Array, mesh: Mesh, boxes: Boxes) -> tuple[NDArray[np.int32], Array, Array, Array]:
    """Best hexahedron for each point: corners, weights, distance from the point [m], and what may count as none."""
    near = _nearest(at, mesh.points, mesh.hexahedra, boxes)
    x = mesh.points[mesh.hexahedra[near]]  # (point, candidate, corner, axis)
    # No point of an element is nearer than its box: few candidates remain.
    gap = np.linalg.norm(at[:, None] - np.clip(at[:, None], x.min(axis=2), x.max(axis=2)), axis=2)
    apart, weight = np.full(near.shape, np.inf), np.zeros((*near.shape, 8))
    round_off = 1e-12 * np.ptp(x)
    tried = gap <= gap.min(axis=1, keepdims=True) + round_off
    while tried.any():
        weight[tried], apart[tried] = _weights(np.repeat(at, tried.sum(axis=1), axis=0), x[tried])
        tried = np.isinf(apart) & (gap <= apart.min(axis=1, keepdims=True) + round_off)
    alike = apart <= apart.min(axis=1, keepdims=True) + round_off  # a point on a face: the first of its cells
    best, rows = np.where(alike, near, len(mesh.hexahedra)).argmin(axis=1), np.arange(len(at))
    allowed = OUTSIDE * np.linalg.norm(np.ptp(x[rows, best], axis=1), axis=1)
    return mesh.hexahedra[near[rows, best]], weight[rows, best], apart[rows, best], allowed


def _weights(at: Array, x: Array) -> tuple[Array, Array]:
    """Shape functions at the place in a hexahedron nearest to a point, shape (count, 8), and its distance [m]."""
    xi = np.zeros_like(at)
    for _ in range(8):  # Newton's method on x(xi) = at, kept within the element
        value, slope = shape_functions(xi)
        J = np.einsum("cak,cai->cik", slope, x)
        missing = at - np.einsum("ca,cai->ci", value, x)
        # the Jacobian has no inverse where corners of a wedge or a pyramid coincide
        xi = np.clip(xi + (np.linalg.pinv(J) @ missing[..., None])[..., 0], -1.0, 1.0)
    value, _ = shape_functions(xi)
    return value, np.linalg.norm(at - np.einsum("ca,cai->ci", value, x), axis=-1)


def _in_tetrahedra(at: Array, mesh: Mesh, boxes: Boxes) -> tuple[NDArray[np.int32], Array, Array, Array]:
    """The same of tetrahedra, with their last corner repeated at no weight."""
    near = _nearest(at, mesh.points, mesh.tetrahedra, boxes)
    x = mesh.points[mesh.tetrahedra[near]]
    slope = gradients(x.reshape(-1, 4, 3)).reshape(x.shape)
    weight = np.einsum("pcai,pci->pca", slope, at[:, None] - x.mean(axis=2)) + 0.25
    weight = np.clip(weight, 0.0, None)
    weight /= weight.sum(axis=-1, keepdims=True)
    apart = np.linalg.norm(at[:, None] - np.einsum("pca,pcai->pci", weight, x), axis=-1)
    best, rows = apart.argmin(axis=1), np.arange(len(at))
    allowed = OUTSIDE * np.linalg.norm(np.ptp(x[rows, best], axis=1), axis=1)
    nodes = mesh.tetrahedra[near[rows, best]][:, [0, 1, 2, 3, 3, 3, 3, 3]]
    return nodes, np.pad(weight[rows, best], ((0, 0), (0, 4))), apart[rows, best], allowed


def path_histories(probes: Probes, rings: Sequence[NDArray[np.float32]]) -> tuple[PathHistory, ...]:
    """The paths of a run from what all probes recorded [Pa], each shape (row_count, probe_count, 6)."""
    if not probes.position:
        return ()
    ends = np.cumsum([len(position) for position in probes.position.values()])
    parts = np.split(np.concatenate(rings), ends[:-1], axis=1)
    return tuple(PathHistory(name, at, s) for (name, at), s in zip(probes.position.items(), parts, strict=True))


def save_paths(file: FilePath, time: Array, paths: Sequence[PathHistory]) -> None:
    """Write time_s, and for each path NAME/position_m, NAME/stress_Pa and NAME/von_mises_Pa, as an npz archive."""
    arrays: dict[str, NDArray] = {"time_s": time}
    for path in paths:
        arrays[f"{path.name}/position_m"] = path.position
        arrays[f"{path.name}/stress_Pa"] = path.stress
        arrays[f"{path.name}/von_mises_Pa"] = path.von_mises
    with file.open("wb") as stream:
        np.savez(stream, **arrays)  # pyright: ignore[reportArgumentType]


def load_paths(file: str | os.PathLike[str]) -> tuple[PathHistory, ...]:
    """The paths that `save_paths` wrote."""
    with np.load(file) as arrays:
        names = [key.removesuffix("/position_m") for key in arrays if key.endswith("/position_m")]
        return tuple(PathHistory(n, arrays[f"{n}/position_m"], arrays[f"{n}/stress_Pa"]) for n in names)
