"""Owns looks at the bending of scenes side by side: cells of equal kind and material go through numpy together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from warp_mca.system.model import Model
from warp_mca.watch.bending import greater
from warp_mca.watch.bent_cells import COLUMNS, Array, Cells
from warp_mca.watch.bent_hexahedra import JOINED

MOST = 2048  # cells that are looked at together: more leave the cache, and take longer each


class Together:
    """Cells of several scenes that are looked at."""

    def __init__(self, scenes: Sequence[tuple[Model, Sequence[Cells]]]) -> None:
        """Take the model and the cells of each scene; nodes are counted from scene to scene."""
        first = np.cumsum([0, *(len(model.X) for model, _ in scenes)])
        self._nodes = [slice(a, b) for a, b in pairwise(first)]
        self._bodies = [len(model.element_start) for model, _ in scenes]
        X = np.concatenate([model.X for model, _ in scenes])
        kinds: dict[object, list[tuple[int, Cells]]] = {}
        for scene, (_, samples) in enumerate(scenes):
            for number, item in enumerate(samples):
                joined = item.energies in JOINED
                kind = (item.energies, item.K, item.G, item.sigma_y) if joined else (scene, number)
                kinds.setdefault(kind, []).append((scene, item))
        self._lots = [
            (lot, _joined([replace(item, conn=item.conn + np.int32(first[scene]), X=X) for scene, item in lot]))
            for own in kinds.values()
            for lot in _lots(own)
        ]

    @np.errstate(all="ignore")  # as in `seen`
    def seen(self, u: Array, before: Sequence[Array]) -> list[Array]:
        """`SceneRecords.stiffened` of each scene with displacements u of all of them [m], shape (node_count, 3).

        They are those of `bending.seen` but for round-off.
        """
        found = [np.zeros((count, COLUMNS)) for count in self._bodies]
        for lot, cells in self._lots:
            for (scene, item), row in zip(lot, cells.energies(u, cells).reshape(-1, COLUMNS), strict=True):
                found[scene][item.body] += item.share * row
        for row, nodes in zip(found, self._nodes, strict=True):
            row *= np.isfinite(u[nodes]).all()
            row[np.isnan(row)] = 0.0
        return [greater(new, old) for new, old in zip(found, before, strict=True)]


def _lots(own: Sequence[tuple[int, Cells]]) -> list[list[tuple[int, Cells]]]:
    """Cells of one kind in lots of `MOST`, or of one scene where that has more."""
    lots: list[list[tuple[int, Cells]]] = []
    total = MOST
    for scene, item in own:
        total += len(item.conn)
        if total > MOST:
            lots.append([])
            total = len(item.conn)
        lots[-1].append((scene, item))
    return lots


def _joined(lot: Sequence[Cells]) -> Cells:
    """Cells of one kind and material as one."""
    if len(lot) == 1:
        return lot[0]
    ends = tuple(np.cumsum([len(item.conn) for item in lot]).tolist())
    return replace(lot[0], conn=np.concatenate([item.conn for item in lot]), looked_at=ends[-1], ends=ends)
