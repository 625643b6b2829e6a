"""Owns the frames of a run: what the device reduced, on its way to the recorders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.recorders.recorder import SurfaceMesh

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.model import Model


def skins(model: Model, meshes: Mapping[str, Mesh]) -> dict[str, SurfaceMesh]:
    """The skin of each body in the model's numbering."""
    found = {}
    for body, mesh in meshes.items():
        quads, _ = mesh.boundary
        nodes = np.unique(quads)
        local = np.searchsorted(nodes, quads).astype(np.int32)
        found[body] = SurfaceMesh((nodes + model.node_start[body]).astype(np.int32), local)
    return found
