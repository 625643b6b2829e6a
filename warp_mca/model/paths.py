"""Owns line probes: where the scene's paths lie in its meshes, and in a model of several scenes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import offsets
from warp_mca.geometry.boxes import Boxes, cell_boxes
from warp_mca.geometry.cell_types import MAX_CORNERS, linear_type
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.point_location import LOCATE
from warp_mca.scene import Path, Scene

if TYPE_CHECKING:
    from warp_mca.system.model import Model


MAX_PROBES = 100_000  # of a line


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


NO_PROBES = Probes({}, np.zeros((0, MAX_CORNERS), np.int32), np.zeros((0, MAX_CORNERS)))
Place = tuple[NDArray[np.int32], Array]  # corners of the cells around the probes of a line, and their weights


def locate(scene: Scene, model: Model, meshes: Mapping[str, Mesh]) -> Probes:
    """Find the elements that the scene's paths run through, once in each mesh; see `Scene.stress_paths`.

    Raises:
        RequestError: a probe lies outside its body.
    """
    position: dict[str, Array] = {}
    corner, weight = [NO_PROBES.corner], [NO_PROBES.weight]
    boxes: dict[str, dict[str, Boxes]] = {}
    for path in scene.stress_paths:
        along = []
        for line in path.lines:
            mesh = meshes[line.body]
            if not line.length < MAX_PROBES * path.spacing:
                count = line.length / path.spacing
                remedy = f"a line of {line.length:g} m would have {count:.3g} probes; give a larger one"
                raise bad_value(f"Path {path.name}.spacing", path.spacing, remedy)
            share = np.linspace(0.0, 1.0, int(np.ceil(line.length / path.spacing - 1e-9)) + 1)
            key, known = (line, path.spacing), mesh.known
            if key not in known:
                at = np.asarray(line.start) + share[:, None] * np.subtract(line.end, line.start)
                if line.body not in boxes:
                    boxes[line.body] = {name: cell_boxes(mesh.points, cells) for name, cells in mesh.cells.items()}
                known[key] = _elements_around(at, mesh, boxes[line.body], path, line.body)
            nodes, weights = known[key]
            along.append(line.position + share * line.length)
            corner.append((nodes + model.node_start[line.body]).astype(np.int32))
            weight.append(weights)
        position[path.name] = np.concatenate(along)
    return Probes(position, np.concatenate(corner), np.concatenate(weight))


def _elements_around(at: Array, mesh: Mesh, boxes: Mapping[str, Boxes], path: Path, body: str) -> Place:
    """Corners of the cell around each point, shape (point_count, MAX_CORNERS), and their weights there.

    Raises:
        RequestError: a point lies outside the mesh.
    """
    found = []
    for name, cells in mesh.cells.items():
        if len(cells):
            linear = linear_type(name)
            found.append(LOCATE[linear.name](at, mesh.points, cells[:, : linear.corners], boxes[name]))
    corners, weights, apart, allowed = (np.stack(parts) for parts in zip(*found, strict=True))
    rows = np.arange(len(at))
    best = (apart - allowed).argmin(axis=0)
    apart, allowed = apart[best, rows], allowed[best, rows]
    far = int(np.argmax(apart - allowed))
    if apart[far] > allowed[far]:
        place = ", ".join(f"{x:.6g}" for x in at[far])
        remedy = f"this point lies {apart[far]:.3g} m outside the body {body}; give points of it, in its own frame"
        raise bad_value(f"Path {path.name}.lines", f"({place})", remedy)
    return corners[best, rows], weights[best, rows]


def join_probes(parts: Sequence[tuple[Probes, int]]) -> Probes:
    """Probes of all scenes, scene by scene, in the node numbers of the batch model; positions are left out.

    Args:
        parts: probes and node count of each scene.
    """
    nodes = offsets([count for _, count in parts])
    corner = [probes.corner + start for (probes, _), start in zip(parts, nodes, strict=False)]
    return Probes({}, np.concatenate(corner), np.concatenate([probes.weight for probes, _ in parts]))
