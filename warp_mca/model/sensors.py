"""Owns where probes and sections lie in the meshes of a scene, and in a model of several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import offsets
from warp_mca.geometry.boxes import cell_boxes
from warp_mca.geometry.cell_types import linear_type
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.point_location import LOCATE
from warp_mca.physics.elements.cells import nodal_masses

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.scene import Probe, Scene, Section


CHANNELS = 6  # of a probe, position [m] and velocity [m/s]; of a section, force [N] and moment [N m]


@dataclass(frozen=True)
class Spot:
    """Where a probe lies.

    Attributes:
        body: its body.
        node: nodes, shape (count,), int32.
        weight: of each in the mean [-], shape (count,), float64; they add up to 1.
    """

    body: str
    node: Index
    weight: Array


@dataclass(frozen=True)
class Cut:
    """Where a section lies.

    Attributes:
        body: its body.
        first: first node of the body.
        height: of each node of the body above the plane, in its undeformed frame [m], shape (node_count,), float64.
    """

    body: str
    first: int
    height: Array

    def interface(self, cells: Sequence[Index]) -> tuple[list[NDArray[np.bool_]], Index]:
        """Cells above the plane that share nodes with those below, and these nodes; by the mean of their corners.

        Args:
            cells: nodes of the cells of the body, each shape (count, corners), int32, as the model counts them.
        """
        above = [self.height[c - self.first].mean(axis=1) > 0.0 for c in cells]
        flat = [np.zeros(0, np.int32)]
        upper = np.concatenate(flat + [c[up].ravel() for c, up in zip(cells, above, strict=True)])
        lower = np.concatenate(flat + [c[~up].ravel() for c, up in zip(cells, above, strict=True)])
        shared = np.intersect1d(upper, lower).astype(np.int32)
        return [up & np.isin(c, shared).any(axis=1) for c, up in zip(cells, above, strict=True)], shared


@dataclass(frozen=True)
class Sensors:
    """Probes and sections of a scene, in the numbers of their bodies' meshes or, once placed, of the model."""

    spots: tuple[Spot, ...] = ()
    cuts: tuple[Cut, ...] = ()

    @property
    def channels(self) -> int:
        """Numbers in a record."""
        return CHANNELS * (len(self.spots) + len(self.cuts))

    def placed(self, node_start: Mapping[str, int], start: int = 0) -> Sensors:
        """In the numbers of a model whose bodies begin at `node_start`, behind `start` others."""
        first = {name: start + begin for name, begin in node_start.items()}
        return Sensors(
            tuple(replace(spot, node=(spot.node + first[spot.body]).astype(np.int32)) for spot in self.spots),
            tuple(replace(cut, first=cut.first + first[cut.body]) for cut in self.cuts),
        )


NO_SENSORS = Sensors()


def locate_sensors(scene: Scene, meshes: Mapping[str, Mesh]) -> Sensors:
    """Find the nodes around probes, and the cells on both sides of sections.

    Raises:
        RequestError: a probe lies outside its body, its body has no such node set, or a plane misses its body.
    """
    masses = nodal_masses(scene, meshes) if any(probe.nodes is not None for probe in scene.probes) else {}
    spots = (
        _around(probe, meshes[probe.body]) if probe.nodes is None else _of_set(probe, meshes[probe.body], masses)
        for probe in scene.probes
    )
    return Sensors(tuple(spots), tuple(_cut(section, meshes[section.body]) for section in scene.sections))


def around_point(field: str, body: str, place: Array, mesh: Mesh) -> tuple[Index, Array]:
    """The corners of the cell around a point of a body [m], shape (3,), with its shape functions there as weights.

    Raises:
        RequestError: the point, of the named field, lies outside the body.
    """
    at = place[None]
    found = []
    for name, cells in mesh.cells.items():
        if len(cells):
            linear = linear_type(name)
            corners = cells[:, : linear.corners]
            found.append(LOCATE[linear.name](at, mesh.points, corners, cell_boxes(mesh.points, corners)))
    corner, weight, apart, allowed = min(found, key=lambda cell: float(cell[2][0] - cell[3][0]))
    if apart[0] > allowed[0]:
        remedy = f"this point lies {apart[0]:.3g} m outside the body {body}; give one of it, in its own frame"
        raise bad_value(field, tuple(place.tolist()), remedy)
    kept = weight[0] != 0.0
    return corner[0][kept].astype(np.int32), weight[0][kept]


def weighted_set(node: Index, mass: Array) -> tuple[Index, Array]:
    """The nodes of a set, weighted with their part of the `mass` of a body's nodes; slaves of ties have none."""
    weight = mass[node] if mass[node].any() else np.ones(len(node))
    return node.astype(np.int32), weight / weight.sum()


def _around(probe: Probe, mesh: Mesh) -> Spot:
    place = np.array(probe.at, dtype=np.float64)
    return Spot(probe.body, *around_point(f"{probe.title}.at", probe.body, place, mesh))


def _of_set(probe: Probe, mesh: Mesh, masses: Mapping[str, Array]) -> Spot:
    assert probe.nodes is not None
    return Spot(probe.body, *weighted_set(mesh.nodes(probe.nodes), masses[probe.body]))


def _cut(section: Section, mesh: Mesh) -> Cut:
    normal = np.array(section.normal) / np.linalg.norm(section.normal)
    cut = Cut(section.body, 0, (mesh.points - np.array(section.at)) @ normal)
    if not len(cut.interface(list(mesh.cells.values()))[1]):
        remedy = f"the plane leaves all of body {section.body} on one side; give a point inside it, in its own frame"
        raise bad_value(f"{section.title}.at", section.at, remedy)
    return cut


def join_sensors(parts: Sequence[tuple[Sensors, Model]]) -> list[Sensors]:
    """Those of each scene of a batch, in the numbers of the batch model."""
    start = offsets([model.node_count for _, model in parts])
    return [sensors.placed(model.node_start, int(first)) for (sensors, model), first in zip(parts, start, strict=False)]
