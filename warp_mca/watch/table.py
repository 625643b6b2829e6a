"""Owns the table of all guards, warnings and advice, in the order in which a run tells them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.watch import (
    articulations,
    bending,
    bolts,
    contacts,
    elements,
    energy,
    folding,
    guards,
    histories,
    inertia,
    meshes,
    motion,
    passing,
    units,
    vibration,
)
from warp_mca.watch.row import Context, Finished, Row, When

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.scene import Scene
    from warp_mca.system.model import Model


def _rows(*modules: ModuleType) -> tuple[Row, ...]:
    """The rows of modules, in the order in which they stand there."""
    return tuple(item for module in modules for item in vars(module).values() if isinstance(item, Row))


FIGURES = _rows(elements, inertia, bending, folding, energy, contacts, motion, bolts)
SCENES = _rows(meshes, units, articulations)
EVENTS = _rows(passing, histories, vibration)
TABLE = (*_rows(guards), *FIGURES, *SCENES, *EVENTS)


def told_before(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> tuple[str, ...]:
    """What is worth a look in a scene before it runs, one sentence each.

    Args:
        scene: the scene.
        meshes: of its bodies, by name.
        model: assembled of them.
    """
    return _told(
        [item for item in SCENES if item.when is When.BEFORE], Context(scene=scene, meshes=meshes, model=model)
    )


def told_at_the_end(finished: Finished, before: Sequence[str]) -> tuple[str, ...]:
    """All that a run says of itself, one sentence each, with what was told `before` it."""
    late = [item for item in SCENES if item.when is not When.BEFORE]
    return (*_told(FIGURES, finished), *before, *_told((*late, *EVENTS), finished))


@np.errstate(over="ignore", invalid="ignore")  # of absurd values, which are told or stopped elsewhere
def _told(rows: Sequence[Row], context: Context) -> tuple[str, ...]:
    return tuple(sentence for item in rows for sentence in item.told(context))
