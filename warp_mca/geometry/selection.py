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
        faces = (self.faces,) if isinstance(self.faces, str | int) else tuple(self.faces)
        object.__setattr__(self, "faces", faces)
        vectors = {key: getattr(self, key) for key in ("low", "high", "point", "normal")}
        for key in (key for key, value in vectors.items() if value is not None):
            validate.vectors("Select", **{key: vectors[key]})
            object.__setattr__(self, key, tuple(float(x) for x in vectors[key]))
        validate.texts("Select", name=self.name)
        if not self.name:
            raise bad_value("Select.name", self.name, "give the node set a name")
        box, plane = (tuple(vectors[key] is not None for key in pair) for pair in (("low", "high"), ("point", "normal")))
        if sum((bool(faces), any(box), any(plane))) != 1 or any(box) != all(box) or any(plane) != all(plane):
            raise bad_value("Select", self.name, "give faces, or low and high of a box, or point and normal of a plane")
        for face in faces:
            validate.kind_of("Select.faces", face, (str, int), "give names or numbers of faces")
        if self.normal is not None and not any(self.normal):
            raise bad_value("Select.normal", self.normal, "give a direction other than zero")

    def nodes(self, mesh: Mesh) -> NDArray[np.int32]:
        """Node indices, sorted, shape (count,), int32.

        Raises:
            RequestError: the mesh has no such face, or no node lies there.
        """
        if self.faces:
            names = [f"face_{face}" if isinstance(face, int) else face for face in self.faces]
            return np.unique(np.concatenate([mesh.nodes(name) for name in names]))
        tolerance = _TOLERANCE * np.ptp(mesh.points, axis=0).max()
        if self.low is not None:
            inside = (mesh.points >= np.array(self.low) - tolerance) & (mesh.points <= np.array(self.high) + tolerance)
            found = np.flatnonzero(inside.all(axis=1))
        else:
            unit = np.array(self.normal) / np.linalg.norm(self.normal)
            found = np.flatnonzero(np.abs((mesh.points - np.array(self.point)) @ unit) <= tolerance)
        if not len(found):
            low, high = (np.array2string(f(mesh.points, axis=0), precision=4) for f in (np.min, np.max))
            raise bad_value("Select", self.name, f"no node lies there; the part lies between {low} and {high} m")
        return found.astype(np.int32)


def check_selections(owner: str, select: Sequence[Select]) -> None:
    """Raise RequestError unless these are selections with names of their own."""
    validate.members(owner, Select, select=select)
    names = [item.name for item in select]
    if len(set(names)) < len(names):
        raise bad_value(f"{owner}.select", names, "give each selection a name of its own")


def with_selections(mesh: Mesh, select: Sequence[Select]) -> Mesh:
    """The mesh with the node sets of the selections beside its own; a selection replaces a set of its name."""
    more: Mapping[str, NDArray[np.int32]] = {item.name: item.nodes(mesh) for item in select}
    return replace(mesh, node_sets={**mesh.node_sets, **more})
