"""Owns what the summary of a run says of elements that failed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.geometry.quality import volumes
from warp_mca.physics.elements.cells import densities
from warp_mca.system.reading import on_host

if TYPE_CHECKING:
    from collections.abc import Mapping

    from warp_mca.base.arrays import Array, Index
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.scene import Scene
    from warp_mca.step.solver import Solver
    from warp_mca.system.state import State


def failure_report(
    scene: Scene, meshes: Mapping[str, Mesh], solver: Solver, state: State, index: int
) -> dict[str, dict[str, object]]:
    """Of each body whose elements may fail, by name: number of elements that failed and their mass [kg], time after the
    first contact [s] and place [m] of the first; these two are None where none failed.

    Args:
        scene: number `index` in the layout of the solver.
        meshes: of its bodies, by name.
        solver: that ran it.
        state: at its end.
    """
    element, steps, place = _failed(solver, state, index)
    found: dict[str, dict[str, object]] = {}
    for name in scene.failing:
        mesh = meshes[name]
        start = solver.model.element_start[name if solver.model.batch is None else f"{index}/{name}"]
        own = np.flatnonzero((element >= start) & (element < start + mesh.cell_count))
        mass = densities(scene.body(name), mesh) * volumes(mesh)
        first = own[np.argmin(steps[own])] if len(own) else None
        found[name] = {
            "elements": len(own),
            "mass": float(mass[element[own] - start].sum()),
            "time": None if first is None else float(steps[first] * solver.dt),
            "at": None if first is None else place[first].tolist(),
        }
    return found


def _failed(solver: Solver, state: State, index: int) -> tuple[Index, Index, Array]:
    """Elements of a scene that failed, as counted in the concatenated meshes; steps and place [m] of each then."""
    element, steps, place = [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros((0, 3))]
    model = solver.model
    for stage, (first, end) in zip(solver.elements, solver.layout.elements[index].tolist(), strict=True):
        own = state.elements[stage.index].failing
        if own is None:
            continue
        age = on_host(own.age)[first - stage.block.first : end - stage.block.first]
        mine = np.flatnonzero(age < 0)
        corners = stage.block.conn[:, mine + first - stage.block.first]
        u = on_host(own.u).reshape(*stage.block.conn.shape, 3)[:, mine + first - stage.block.first]
        element.append(model.element_of[mine + first])
        steps.append(-1 - age[mine])
        place.append((model.X[corners] + u).mean(axis=0))
    return np.concatenate(element), np.concatenate(steps), np.concatenate(place)
