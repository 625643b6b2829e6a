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
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.point_location import around_point, weighted_set
from warp_mca.physics.elements.cells import nodal_masses

if TYPE_CHECKING:
    from warp_mca.scene import Probe, Scene, Section
    from warp_mca.system.model import Model


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
        _around(probe, meshes[probe.body], scene.body(probe.body).is_inertia)
        if probe.nodes is None
        else _of_set(probe, meshes[probe.body], masses)
        for probe in scene.probes
    )
    return Sensors(tuple(spots), tuple(_cut(section, meshes[section.body]) for section in scene.sections))


def _around(probe: Probe, mesh: Mesh, inertia: bool) -> Spot:
    place = np.array(probe.at, dtype=np.float64)
    return Spot(probe.body, *around_point(f"{probe.title}.at", probe.body, place, mesh, inertia))


def _of_set(probe: Probe, mesh: Mesh, masses: Mapping[str, Array]) -> Spot:
    assert probe.nodes is not None
    return Spot(probe.body, *weighted_set(mesh.nodes(probe.nodes), masses[probe.body]))


def _cut(section: Section, mesh: Mesh) -> Cut:
    normal = np.array(section.normal) / np.linalg.norm(section.normal)
    cut = Cut(section.body, 0, (mesh.points - np.array(section.at)) @ normal)
    if not len(cut.interface(list(mesh.cells.values()))[1]):
        own = f"the plane leaves all of body {section.body} on one side, where cells belong to that of their middle"
        remedy = f"{own}; give a point farther inside, in its own frame"
        raise bad_value(f"{section.title}.at", section.at, remedy)
    return cut


def join_sensors(parts: Sequence[tuple[Sensors, Model]]) -> list[Sensors]:
    """Those of each scene of a batch, in the numbers of the batch model."""
    start = offsets([model.node_count for _, model in parts])
    return [sensors.placed(model.node_start, int(first)) for (sensors, model), first in zip(parts, start, strict=False)]
