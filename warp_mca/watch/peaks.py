"""Owns what the summary of a run says of the greatest stress and plastic strain of each body."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.kernels.records.extremes import PLASTIC_STRAIN, VON_MISES
from warp_mca.system.reading import on_host

if TYPE_CHECKING:
    from warp_mca.base.arrays import Array, Index
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.scene import Scene
    from warp_mca.step.solver import Solver
    from warp_mca.step.steps import Steps
    from warp_mca.system.state import State

Peak = dict[str, Any]
ROWS = {"max_von_mises": VON_MISES, "max_plastic_strain": PLASTIC_STRAIN}


def peak_report(
    scene: Scene, meshes: Mapping[str, Mesh], solver: Solver, state: State, index: int, steps: Steps
) -> dict[str, dict[str, Peak]]:
    """Of each flexible body, by name, `max_von_mises` [Pa] and `max_plastic_strain` [-] of any record of the impact.

    Each is a dict: `value` at an integration point; `at`, the middle of its element in the frame of the body, as meshed
    [m]; `time` of the record since the start of the impact [s]. The latter two are None where the value is 0.

    Args:
        scene: number `index` in the layout of the solver.
        meshes: of its bodies, by name.
        solver: that ran it.
        state: at its end.
        steps: of the run.
    """
    return {
        body.name: _greatest(body.name, meshes[body.name], solver, state, index, steps)
        for body in scene.bodies
        if not body.rigid
    }


def greatest_peaks(reports: Sequence[Mapping[str, Mapping[str, Any]]], offsets: Sequence[float]) -> dict[str, Any]:
    """The greatest of several impacts, whose times begin at `offsets` [s], and all else of the first one."""
    found = {name: dict(entry) for name, entry in reports[0].items()}
    for name, entry in found.items():
        for key in ROWS.keys() & entry.keys():
            peaks = [(report[name][key], offset) for report, offset in zip(reports, offsets, strict=True)]
            peak, offset = max(peaks, key=lambda item: item[0]["value"])
            entry[key] = peak if peak["time"] is None else {**peak, "time": peak["time"] + offset}
    return found


def _greatest(name: str, mesh: Mesh, solver: Solver, state: State, index: int, steps: Steps) -> dict[str, Peak]:
    key = name if solver.model.batch is None else f"{index}/{name}"
    parts, found = list(_of_blocks(solver, state, index, key, mesh)), {}
    for figure, row in ROWS.items():
        greatest: tuple[float, int, Index] = 0.0, 0, np.zeros(0, np.int32)
        for peak, own, conn in parts:
            k = own[np.argmax(peak[row, own])] if row < len(peak) else -1
            if k >= 0 and peak[row, k] > greatest[0]:
                greatest = float(peak[row, k]), int(peak[row + 1, k]), conn[:, k]
        value, record, nodes = greatest
        at = mesh.points[nodes - solver.model.node_start[key]].mean(axis=0).tolist() if value else None
        found[figure] = {"value": value, "at": at, "time": steps.time(record) if value else None}
    return found


def _of_blocks(
    solver: Solver, state: State, index: int, key: str, mesh: Mesh
) -> Iterator[tuple[Array, Index, NDArray[np.int32]]]:
    """Peaks and nodes of the elements of each block, and which of them are a body's, where there are any."""
    model, start = solver.model, solver.model.element_start[key]
    for stage, (first, end) in zip(solver.elements, solver.layout.elements[index].tolist(), strict=True):
        element = model.element_of[first:end]
        own = np.flatnonzero((element >= start) & (element < start + mesh.cell_count)) + first - stage.block.first
        if len(own):
            yield on_host(state.elements[stage.index].peak), own, stage.block.conn
