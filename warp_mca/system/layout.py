"""Owns where each scene of a batch lies in the arrays of a model; a single scene fills them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Index
from warp_mca.base.joining import offsets

if TYPE_CHECKING:
    from warp_mca.system.model import Model


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Arrays hold one scene after the other; elements do so within each block.

    Attributes:
        nodes: first node of each scene, and the number of all, shape (scene_count + 1,), int32.
        joints: first joint of each scene, and the number of all, shape (scene_count + 1,), int32.
        elements: first and end of each scene's elements in each block, in the model's order, shape
            (scene_count, block_count, 2), int32.
    """

    nodes: Index
    joints: Index
    elements: Index

    @property
    def count(self) -> int:
        """Number of scenes."""
        return len(self.nodes) - 1

    def records(self, records: Mapping[str, NDArray], scene: int) -> dict[str, NDArray]:
        """What `Solver.records` holds of one scene, without paths: as `Ledger.read` takes it."""
        points = records["point_velocity"].shape[1] // self.count
        return {
            "flag": records["flag"][scene],
            "partial": records["partial"][:, scene],
            "point_velocity": records["point_velocity"][:, points * scene : points * (scene + 1)],
        }


def layout_of(model: Model) -> Layout:
    """The layout of a batch, or of a model of one scene."""
    if model.batch is not None:
        return model.batch
    ends = [[block.first, block.first + block.conn.shape[1]] for block in model.blocks]
    return Layout(
        nodes=offsets([model.node_count]),
        joints=offsets([len(model.joints)]),
        elements=np.array(ends, dtype=np.int32).reshape(1, len(ends), 2),
    )
