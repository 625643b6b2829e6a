"""Owns the plastic history of bodies between two impacts: taken from one model, turned, given to the next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.step.solver import Solver
from warp_mca.system.model import Model
from warp_mca.system.state import State

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class BlockHistory:
    """History of the elements of a block, in the bodies' frames.

    Attributes:
        kind: as `Block.kind`.
        element: in the concatenated meshes, increasing, shape (element_count,), int32.
        yielded: as in `ElementState`, shape (element_count,), int32.
        history: as in `ElementState`, shape (row_count, element_count), float32 or float64.
    """

    kind: tuple[bool, str, str, bool, int, str]
    element: NDArray[np.int32]
    yielded: NDArray[np.int32]
    history: NDArray


def take_history(solver: Solver, state: State, rotations: Mapping[str, Array]) -> tuple[BlockHistory, ...]:
    """The history of all blocks that can yield, turned from the world to the bodies' frames.

    Args:
        solver: of one scene.
        state: of it.
        rotations: from each body's frame to the axes of its reference positions [-], each shape (3, 3), float64.
    """
    found = []
    for stage in solver.elements:
        if not stage.block.plastic:
            continue
        element = solver.model.element_of[stage.block.first : stage.block.first + stage.count]
        order = np.argsort(element, kind="stable")
        own = state.elements[stage.index]
        turned = _of_elements(solver.model, element[order], {name: R.T for name, R in rotations.items()})
        found.append(
            BlockHistory(
                kind=stage.block.kind,
                element=element[order],
                yielded=np.asarray(own.yielded.numpy()[order], dtype=np.int32),
                history=stage.rotated(own.history.numpy()[:, order], turned),
            )
        )
    return tuple(found)


def give_history(
    solver: Solver, state: State, histories: Sequence[BlockHistory], rotations: Mapping[str, Array]
) -> None:
    """Set the history of a state of the same scene at other poses; arguments as in `take_history`."""
    by_kind = {item.kind: item for item in histories}
    for stage in solver.elements:
        if not stage.block.plastic:
            continue
        item, own = by_kind[stage.block.kind], state.elements[stage.index]
        element = solver.model.element_of[stage.block.first : stage.block.first + stage.count]
        place = np.searchsorted(item.element, element)
        own.yielded.assign(item.yielded[place])
        own.history.assign(stage.rotated(item.history[:, place], _of_elements(solver.model, element, rotations)))


def _of_elements(model: Model, element: NDArray[np.int32], rotations: Mapping[str, Array]) -> Array:
    """The rotation of the body that each element belongs to, shape (element_count, 3, 3)."""
    names = sorted(model.element_start, key=lambda name: model.element_start[name])
    first = np.array([model.element_start[name] for name in names])
    body = np.searchsorted(first, element, side="right") - 1
    return np.stack([rotations[name] for name in names])[body]
