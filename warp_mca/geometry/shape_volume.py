"""Owns the volume of the shape that a mesh stands for, over that of its cells: `Mesh.volume_ratio`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.quality import volumes

if TYPE_CHECKING:
    from warp_mca.geometry.recipe import Recipe


ROUNDING = 1e-9  # of a ratio: cells that fill their shape that well fill it exactly
STRANGE = 4.0  # ratio of volumes that no mesh of the shape has: a triangular prism in a cylinder has 2.4


def with_volumes(mesh: Mesh, volume: float | Mapping[str, float]) -> Mesh:
    """The mesh of a shape of this volume [m^3], or of one with this volume in each of the cell sets that divide it."""
    own = volumes(mesh)
    if isinstance(volume, Mapping):
        ratio = np.ones(mesh.cell_count)
        for name, exact in volume.items():
            cells = mesh.cell_sets[name]
            ratio[cells] = exact / own[cells].sum()
    else:
        ratio = np.array([volume / own.sum()])
    return with_ratios(mesh, ratio)


def with_ratios(mesh: Mesh, ratio: Array) -> Mesh:
    """The mesh with `volume_ratio`, shape (cell_count,) or (1,), those of rounding set to 1 and equal ones joined."""
    ratio = np.where(np.abs(ratio - 1.0) < ROUNDING, 1.0, ratio)
    return mesh.with_ratio(ratio[:1] if (ratio == ratio[0]).all() else ratio)


def of_cells(mesh: Mesh) -> Array:
    """`Mesh.volume_ratio` of each cell [-], shape (cell_count,); 1 where the cells are the shape."""
    return np.broadcast_to(mesh.volume_ratio if len(mesh.volume_ratio) else np.ones(1), mesh.cell_count)


def divided(cut: Mesh, mesh: Mesh, owner: NDArray[np.integer]) -> Mesh:
    """A mesh whose cells are parts of those of another one, `owner` by `owner`, for the same shape.

    Warped faces that are cut to triangles change the volume of the cells.
    """
    if not len(mesh.volume_ratio):
        return cut
    whole, own, old = volumes(mesh), volumes(cut), of_cells(mesh)
    ratio = old[owner]
    for value in np.unique(old):
        parts = old[owner] == value
        ratio[parts] *= whole[old == value].sum() / own[parts].sum()
    return with_ratios(cut, ratio)


def built(owner: str, recipe: Recipe) -> Mesh:
    """The mesh of a recipe, which may be the user's own; `volume` of the recipe [m^3] counts if the mesh has none.

    Raises:
        RequestError: the volume is no positive number, or nowhere near that of the mesh.
    """
    mesh = recipe.build()
    if not isinstance(mesh, Mesh) or len(mesh.volume_ratio) or (volume := getattr(recipe, "volume", None)) is None:
        return mesh
    validate.positive(owner, volume=volume)
    mesh = with_volumes(mesh, volume)
    ratio = float(mesh.volume_ratio[0])
    if not 1.0 / STRANGE < ratio < STRANGE:
        remedy = f"its mesh has {volume / ratio:.4g} m^3; give the volume of the shape in m^3, or leave volume out"
        raise bad_value(f"{owner}.volume", volume, remedy)
    return mesh
