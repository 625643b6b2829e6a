"""Owns `hex8`: the fully integrated hexahedron with mean dilatation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from warp_mca.physics.elements.element import Array
from warp_mca.physics.elements.hexahedron import eigenvalue_bounds, largest_eigenvalues, lumped_masses, mean_gradients

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.system.block import Block


class Hex8:
    """See `warp_mca.kernels.elements.hex8`; wedges and pyramids are hexahedra whose corners coincide."""

    name = "hex8"
    cell = "hexahedron"
    patches = True
    lumped_masses = staticmethod(lumped_masses)
    mean_gradients = staticmethod(mean_gradients)
    eigenvalue_bounds = staticmethod(eigenvalue_bounds)
    largest_eigenvalues = staticmethod(largest_eigenvalues)

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        from warp_mca.kernels.elements import hex8, hex8_patch
        from warp_mca.physics.elements.patch_stage import hexahedral_stage

        return hexahedral_stage(block, X, precision, hex8, hex8_patch, points=8)
