"""Owns which variants have the same meshes: counts of cells are rounded, and two values of refine may mean one mesh."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Mapping
from dataclasses import fields

import numpy as np

from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import McaError
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.meshing import mesh
from warp_mca.scene import Scene


class Meshes:
    """What variants of a scene mesh; meshes are made, compared by their digests and let go.

    Attributes:
        scene: as written.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._digests: dict[Hashable, Hashable] = {}

    def key(self, variant: Variant) -> Hashable:
        """Equal for variants that have the same meshes and are otherwise changed alike."""
        rest = {name: value for name, value in variant.knobs.items() if name != "refine"}
        return self._of(variant), tuple(sorted(rest.items()))

    def _of(self, variant: Variant) -> Hashable:
        """Equal for variants with the same meshes; a variant that cannot be meshed is like itself alone."""
        asked = variant.refine, tuple(sorted(variant.parameters.items()))
        if asked not in self._digests:
            try:
                made = mesh(Variant(refine=variant.refine, parameters=variant.parameters).applied(self.scene))
                self._digests[asked] = _digest(made)
            except (McaError, MemoryError):  # its run says why
                self._digests[asked] = asked
        return self._digests[asked]


def _digest(meshes: Mapping[str, Mesh]) -> str:
    """Of the arrays of all meshes."""
    found = hashlib.sha256()
    for name, made in meshes.items():
        found.update(name.encode())
        for field in fields(made):
            value = getattr(made, field.name)
            for key, array in value.items() if isinstance(value, Mapping) else [("", value)]:
                found.update(f"{field.name} {key} {np.shape(array)}".encode())
                found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()
