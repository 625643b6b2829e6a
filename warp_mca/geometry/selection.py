"""Owns `Select`: node sets of a part from its faces, from a box or from a plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.geometry.mesh import Mesh

Vec3 = tuple[float, float, float]
_VECTORS = ("low", "high", "point", "normal")
_TOLERANCE = 1e-6  # share of the part's extent within which nodes count as on a plane or in a box


@dataclass(frozen=True)
class Select:
    """A node set: nodes of faces, or those in a box, or those on a plane.

    Attributes:
        name: of the node set.
        faces: node sets that the part has, by name, or by number N for "face_N".
        low, high: corners of a box along the axes, in the part's frame [m].
        point, normal: of a plane there [m], [-].
    """

    name: str
    faces: tuple[str | int, ...] = ()
    low: Vec3 | None = None
    high: Vec3 | None = None
    point: Vec3 | None = None
    normal: Vec3 | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        if isinstance(self.faces, str | int):
            object.__setattr__(self, "faces", (self.faces,))
        validate.texts("Select", name=self.name)
        if not self.name:
            raise bad_value("Select.name", self.name, "give the node set a name")
        validate.kind_of("Select.faces", self.faces, tuple, "give names or numbers of faces")
        for face in self.faces:
            if not isinstance(face, str | int) or isinstance(face, bool):
                raise bad_value("Select.faces", validate.brief(face), "give names or numbers of faces")
        given = {key: value for key in _VECTORS if (value := getattr(self, key)) is not None}
        validate.vectors("Select", **given)
        if set(given) not in (({"low", "high"}, {"point", "normal"}) if not self.faces else (set(),)):
            raise bad_value("Select", self.name, "give faces, or low and high of a box, or point and normal of a plane")
        if self.normal is not None:
            validate.directions("Select", normal=self.normal)

    def nodes(self, mesh: Mesh) -> NDArray[np.int32]:
        """Node indices, sorted, shape (count,), int32.

        Raises:
            RequestError: the mesh has no such face, or no node lies there.
        """
        if self.faces:
            names = [f"face_{face}" if isinstance(face, int) else face for face in self.faces]
            return np.unique(np.concatenate([mesh.nodes(name) for name in names]))
        tolerance = _TOLERANCE * np.ptp(mesh.points, axis=0).max()
        if self.low is not None and self.high is not None:
            inside = (mesh.points >= np.array(self.low) - tolerance) & (mesh.points <= np.array(self.high) + tolerance)
            found = np.flatnonzero(inside.all(axis=1))
        else:
            point, normal = np.array(self.point, dtype=np.float64), np.array(self.normal, dtype=np.float64)
            height = (mesh.points - point) @ (normal / np.linalg.norm(normal))
            found = np.flatnonzero(np.abs(height) <= tolerance)
        if not len(found):
            low, high = (np.array2string(f(mesh.points, axis=0), precision=4) for f in (np.min, np.max))
            raise bad_value("Select", self.name, f"no node lies there; the part lies between {low} and {high} m")
        return found.astype(np.int32)


def check_selections(owner: str, select: Sequence[Select]) -> None:
    """Raise RequestError unless these are selections with names of their own."""
    validate.members(owner, Select, select=select)
    validate.unique(f"{owner}.select", [item.name for item in select], "selection")


def with_selections(mesh: Mesh, select: Sequence[Select]) -> Mesh:
    """The mesh with the node sets of the selections beside its own; a selection replaces a set of its name."""
    more: Mapping[str, NDArray[np.int32]] = {item.name: item.nodes(mesh) for item in select}
    return replace(mesh, node_sets={**mesh.node_sets, **more})
