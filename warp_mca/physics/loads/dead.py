"""Owns loads that keep their direction: forces on node sets and points, and on whole bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.joining import AS_IS, joinable
from warp_mca.kernels.loads.nodes import push_nodes
from warp_mca.physics.loads.faces import corner_areas, lone_corners
from warp_mca.physics.loads.pushed import PushedNodes, TimedNodes
from warp_mca.scene.loads import LOADS, BodyForce, Force
from warp_mca.scene.probes import Point
from warp_mca.system.bodies import Bodies
from warp_mca.system.stage import Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System

Index = NDArray[np.int32]
Array = NDArray[np.float64]


@joinable
@dataclass(frozen=True, kw_only=True)
class DeadLoad(TimedNodes):
    """One load that keeps its direction.

    Attributes:
        share: what each node takes of `vector`: of a force [-], of an acceleration [kg], shape (count,), float64.
        vector: [N] or [m/s^2], at factor 1, shape (3,), float64.
    """

    share: Array = field(metadata=AS_IS)
    vector: Array = field(metadata=AS_IS)


def build(load: Force | BodyForce, assembly: Bodies) -> DeadLoad:
    """Arrays of a load.

    Raises:
        RequestError: its node set is unknown or covers no face, or its point lies off the body.
    """
    if isinstance(load, BodyForce):
        own = assembly.all_nodes(load.body)
        node, share, vector = np.arange(own.start, own.stop), assembly.mass[own], load.acceleration
    else:
        (node, share), vector = _shares(load, assembly), load.force
    return DeadLoad(
        node=node.astype(np.int32),
        times=np.array(load.table.times),
        values=np.array(load.table.values),
        force=float(np.linalg.norm(vector) * share.sum()),
        share=share,
        vector=np.array(vector),
    )


def _shares(load: Force, assembly: Bodies) -> tuple[Index, Array]:
    """Nodes of a force, and the share of each, which sum up to 1."""
    if load.at is not None:
        return np.array([assembly.nearest(Point(body=load.body, at=load.at))]), np.ones(1)
    assert load.nodes is not None
    if load.spread == "equal":
        node = np.unique(assembly.nodes(load.body, load.nodes))
        return node, np.full(len(node), 1.0 / len(node))
    mesh = assembly.meshes[load.body]
    face, _ = mesh.surface(load.nodes)
    area = corner_areas(mesh.points[face], lone_corners(mesh, face))
    node, place = np.unique(face, return_inverse=True)
    share = np.bincount(place.ravel(), area.ravel())
    return node + assembly.node_start[load.body], share / share.sum()


class Stage(PushedNodes):
    """Device side of forces, or of forces on bodies."""

    def __init__(self, solver: System, name: str) -> None:
        """Allocate on the current device."""
        super().__init__(solver, name)
        load = np.repeat(np.arange(len(self.items)), [len(item.node) for item in self.items])
        share = np.concatenate([item.share for item in self.items])
        self.load, self.share = (
            wp.array(load[self.order], dtype=wp.int32),
            wp.array(share[self.order], dtype=wp.float64),
        )
        self.vector = wp.array([item.vector for item in self.items], dtype=wp.vec3d)
        if LOADS[name] is not BodyForce:  # that acts on mass, as weight does
            self.may_end(self.listed(self.items)[self.order, None], self.share)

    def listed(self, items: Sequence[Any]) -> Index:
        """Nodes of all loads."""
        return np.concatenate([item.node for item in items])

    def kernels(self) -> list[Any]:
        """That of the forces."""
        return [push_nodes, *(self.lasting.kernels() if self.lasting else [])]

    def push(self, step: Step, start: bool = False) -> None:
        """Forces on nodes, and their work."""
        self.launch(push_nodes, [self.load, self.share, self.vector, self.tables], step, start)
