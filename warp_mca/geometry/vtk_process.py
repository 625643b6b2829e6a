"""Owns the script that reads a VTK file with VTK in a process of its own, which a damaged file may crash.

Run as `python vtk_process.py FILE`: writes points, types, offsets, connectivity and the numbers of physical groups to
standard output as an .npz archive, or why it cannot to standard error. It imports nothing of warp_mca.
"""

from __future__ import annotations

import io
import sys
from typing import Any

import numpy as np


def read(path: str) -> dict[str, np.ndarray]:
    """The arrays of the unstructured grid of a file; a structured one is made one."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersCore import vtkAppendFilter
    from vtkmodules.vtkIOLegacy import vtkDataSetReader
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    reader: Any = vtkXMLUnstructuredGridReader() if path.lower().endswith(".vtu") else vtkDataSetReader()
    reader.SetFileName(path)
    reader.Update()
    found = reader.GetOutput()
    if reader.GetErrorCode() or found is None or not found.GetNumberOfCells():
        raise ValueError("VTK finds no cells in it")
    joined = vtkAppendFilter()
    joined.AddInputData(found)
    joined.Update()
    grid: Any = joined.GetOutput()
    try:
        types = grid.GetCellTypes()
    except TypeError:  # before VTK 9.6
        types = grid.GetCellTypesArray()
    physical = grid.GetCellData().GetArray("gmsh:physical")
    arrays = {
        "points": grid.GetPoints().GetData(),
        "types": types,
        "offsets": grid.GetCells().GetOffsetsArray(),
        "connectivity": grid.GetCells().GetConnectivityArray(),
        **({"physical": physical} if physical is not None else {}),
    }
    return {name: vtk_to_numpy(array) for name, array in arrays.items()}


if __name__ == "__main__":
    archive = io.BytesIO()
    try:
        np.savez(archive, **read(sys.argv[1]))  # type: ignore[arg-type]
    except Exception as error:
        sys.exit(f"\n{error}")
    sys.stdout.buffer.write(archive.getvalue())
