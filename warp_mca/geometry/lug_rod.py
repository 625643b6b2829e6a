"""Owns `LugRod`: a rod whose hinges are as built, each a fork or an eye with a shaft hole."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.geometry.cell_types import HEXAHEDRON
from warp_mca.geometry.lug import HOLE, ROOT, WELD, lug, lug_volume
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.rod import Rod
from warp_mca.geometry.shape_volume import with_volumes


@dataclass(frozen=True, kw_only=True)
class LugRod(Rod):
    """A rod with a fork or an eye at its start, and at its end where its tip is flat; symmetric about z = 0.

    Lugs are cut out of the round rod. They begin 1.45 radii before the hinge axis and end in a ball of one radius
    around it, with a shaft hole of 0.3 radii along z: at the origin, and at x = length. The eye is 0.72 radii thick,
    the fork's slot 0.76 wide, so that fork and eye of two rods of equal radius turn freely around each other. `axial`
    counts the cells along a cylinder without lugs, of which the part between the lugs gets its share.

    Node sets: hole and end_hole (surfaces of the shaft holes, where there are such), side, tip, contact; start and end
    where the rod is flat. Cell sets: body (with the lugs), and tip.

    Attributes:
        start: shape of the rod at the origin.
        end: shape of the rod at x = length; a hemispherical tip has none.
    """

    start: Literal["flat", "fork", "eye"] = "eye"
    end: Literal["flat", "fork", "eye"] = "flat"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.choice("LugRod", ("flat", "fork", "eye"), start=self.start, end=self.end)
        if self.tip != "flat" and self.end != "flat":
            raise bad_value("LugRod.end", self.end, "the rod ends in a hemisphere; leave end out, or take tip = flat")
        if self._between_lugs <= 0.0:
            least = self.length - self._between_lugs
            raise bad_value("LugRod.length", self.length, f"lugs and tip need more than {least:.4g} m")
        if self._ends and self.section < 4:
            remedy = "fork and eye share the layers of cells across the section; give 4 or more"
            raise bad_value("LugRod.section", self.section, remedy)

    @property
    def hole_radius(self) -> float:
        """Radius of the shaft holes [m]."""
        return HOLE * self.radius

    @property
    def _ends(self) -> list[str]:
        """Which ends have lugs."""
        return [name for name in ("start", "end") if getattr(self, name) != "flat"]

    @property
    def _between_lugs(self) -> float:
        """Length of the cylinder without the lugs [m]."""
        return self._cylinder - len(self._ends) * ROOT * self.radius

    @property
    def _volumes(self) -> dict[str, float]:
        lugs = [lug_volume(kind) for name in self._ends if (kind := getattr(self, name)) != "flat"]
        body = math.pi * self.radius**2 * self._between_lugs + sum(lugs) * self.radius**3
        return super()._volumes | {"body": body}

    def build(self) -> Mesh:
        """The mesh of a shorter `Rod`, with the lugs joined to its flat ends."""
        lugs = self._ends
        values: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(Rod)}
        cells = max(1, round(self.axial * self._between_lugs / self._cylinder))
        length = self.length - len(lugs) * ROOT * self.radius
        mesh = Rod(**values | {"axial": cells, "length": length}).build()
        if "start" in lugs:
            mesh = _joined(_moved(mesh, ROOT * self.radius), self._lug(self.start), "start", "hole")
        if "end" in lugs:
            shape = self._lug(self.end)
            turned = shape.hexahedra[:, list(HEXAHEDRON.mirrored)]
            points = shape.points * [-1.0, 1.0, 1.0] + [self.length, 0.0, 0.0]
            mesh = _joined(mesh, Mesh(points, turned, shape.node_sets), "end", "end_hole")
        return with_volumes(mesh, self._volumes)

    def _lug(self, kind: Literal["flat", "fork", "eye"]) -> Mesh:
        assert kind != "flat"
        shape = lug(kind, self.section, self.ring)
        return Mesh(shape.points * self.radius, shape.hexahedra, shape.node_sets)


def _moved(mesh: Mesh, way: float) -> Mesh:
    return Mesh(mesh.points + np.array([way, 0.0, 0.0]), mesh.hexahedra, mesh.node_sets, mesh.cell_sets)


def _joined(rod: Mesh, shape: Mesh, face: str, hole: str) -> Mesh:
    """A rod with a lug on the node set `face`, which goes; the lug's hole becomes the node set `hole`."""
    from scipy.spatial import KDTree

    own, root = rod.nodes(face), shape.nodes("root")
    away, place = KDTree(rod.points[own]).query(shape.points[root])
    assert len(own) == len(root) and away.max() < WELD * np.ptp(rod.points, axis=0).max(), "sections of other cells"
    index = np.empty(len(shape.points), dtype=np.int32)
    kept = np.setdiff1d(np.arange(len(index)), root)
    index[root] = own[np.asarray(place)]
    index[kept] = len(rod.points) + np.arange(len(kept), dtype=np.int32)
    added = len(rod.hexahedra) + np.arange(len(shape.hexahedra), dtype=np.int32)
    node_sets = {name: nodes for name, nodes in rod.node_sets.items() if name != face}
    return Mesh(
        np.concatenate([rod.points, shape.points[kept]]),
        np.concatenate([rod.hexahedra, index[shape.hexahedra]]),
        node_sets | {hole: np.sort(index[shape.nodes("hole")])},
        rod.cell_sets | {"body": np.append(rod.cell_sets["body"], added).astype(np.int32)},
    )
