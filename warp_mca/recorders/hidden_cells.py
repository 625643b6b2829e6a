"""Owns how a VTKHDF file hides elements that have failed: VTK draws no cells whose `vtkGhostType` is HIDDEN."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import h5py

HIDDEN = 32  # vtkDataSetAttributes::HIDDENCELL


class HiddenCells:
    """Which cells each frame of a file hides."""

    def __init__(self, root: h5py.Group, frames: int, cells: int) -> None:
        """Give `frames` their places in the group VTKHDF of a mesh of so many cells."""
        self.cells = cells
        shape = (frames * cells,)
        self.values = root.create_dataset("CellData/vtkGhostType", shape=shape, dtype=np.uint8)
        root["Steps/CellDataOffsets/vtkGhostType"] = cells * np.arange(frames)

    def write(self, frame: int, failed: NDArray[np.bool_]) -> None:
        """Hide cells that have failed in a frame; shape (cell_count,), bool."""
        self.values[frame * self.cells : (frame + 1) * self.cells] = HIDDEN * failed.astype(np.uint8)
