"""Owns `Finer`: smaller cells in a place of a CAD part, as where it strikes, and how sizes grow from there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.geometry.cell_types import TETRA10, linear_type

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh

Vec3 = tuple[float, float, float]
_ASKED = 0.9  # size for which gmsh makes edges of length 1 on average [-]


@dataclass(frozen=True)
class Finer:
    """Smaller cells of a `Cad` behind a plane; before it their size grows with the distance to what it is elsewhere.

    Attributes:
        point, normal: of the plane, in the part's frame [m], [-]; what lies against the normal is behind it.
        size: greatest edge of a cell there [m].
        growth: of that size over the distance from the plane [-].
    """

    point: Vec3
    normal: Vec3
    size: float
    growth: float = 0.3

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.vectors("Finer", point=self.point, normal=self.normal)
        validate.directions("Finer", normal=self.normal)
        validate.within("Finer", 1e-12, 1e6, size=self.size)
        validate.within("Finer", 0.01, 10.0, growth=self.growth)

    def refined(self, factor: float) -> Finer:
        """The same with cells `factor` times smaller."""
        return replace(self, size=self.size / factor)


def set_finer(gmsh: Any, finer: Sequence[Finer], coarse: Mesh, scale: float) -> None:
    """Set the sizes of cells of gmsh's model: those of a mesh without such places, or theirs where these are less.

    The sizes of that mesh stand for walls and curvature, since gmsh has one least size for the whole model.

    Args:
        gmsh: with the model.
        finer: places, in metres.
        coarse: the mesh without them.
        scale: metres for one unit of the model.
    """
    field, option = gmsh.model.mesh.field, gmsh.option
    view = gmsh.view.add("sizes")
    corners = coarse.others[TETRA10.name][:, : linear_type(TETRA10.name).corners]
    size = _ASKED * node_sizes(coarse.points, corners)
    data = np.concatenate([coarse.points[corners].transpose(0, 2, 1).reshape(-1, 12), size[corners]], axis=1) / scale
    gmsh.view.addListData(view, "SS", len(corners), data.ravel().tolist())
    tags = [field.add("PostView")]
    field.setNumber(tags[0], "ViewTag", view)
    for place in finer:
        normal = np.array(place.normal) / np.linalg.norm(place.normal)
        (a, b, c), offset = normal, normal @ np.array(place.point) / scale
        distance = f"(({a:.15f})*x+({b:.15f})*y+({c:.15f})*z-({offset:.15e}))"
        tags.append(field.add("MathEval"))
        grown = f"{place.size / scale:.15e}+{0.5 * place.growth:.15f}*({distance}+abs({distance}))"
        field.setString(tags[-1], "F", grown)
    least = field.add("Min")
    field.setNumbers(least, "FieldsList", tags)
    field.setAsBackgroundMesh(least)
    for name in ("FromPoints", "FromCurvature", "ExtendFromBoundary"):
        option.setNumber(f"Mesh.MeshSize{name}", 0.0)
    option.setNumber("Mesh.MeshSizeMin", min(float(size[size > 0.0].min()), *(place.size for place in finer)) / scale)
    option.setNumber("Mesh.MeshSizeMax", float(size.max()) / scale)


def node_sizes(points: Array, corners: NDArray[np.int32]) -> Array:
    """Mean length of the edges of tetrahedra at each node, 0 where none is, in the unit of `points`, shape (count,).

    Args:
        points: of all nodes, shape (count, 3).
        corners: of tetrahedra, shape (cell_count, 4), int32.
    """
    total, number = np.zeros(len(points)), np.zeros(len(points))
    for one, other in combinations(range(corners.shape[1]), 2):
        length = np.linalg.norm(points[corners[:, one]] - points[corners[:, other]], axis=1)
        for end in (one, other):
            np.add.at(total, corners[:, end], length)
            np.add.at(number, corners[:, end], 1.0)
    return total / np.maximum(number, 1.0)
