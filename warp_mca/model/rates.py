"""Owns groups of elements that take steps of their own: level k takes a step of 2^k times that of level 0.

Lew, Marsden, Ortiz and West, Int. J. Numer. Meth. Engng 60 (2004) 153: asynchronous variational integrators. An element
of level k gives its nodes the impulse 2^k dt f once in 2^k substeps; a node of level k, that of its fastest element,
moves on its way once in 2^k substeps. Elements around a node of a lower level take that level too: without this ring
the impulses of slow elements resonate with the vibration of fast ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Index
from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.physics.elements import ELEMENTS
from warp_mca.physics.elements.patches import compact_order
from warp_mca.system.time_step import Rates

if TYPE_CHECKING:
    from warp_mca.system.block import Block
    from warp_mca.system.model import Model

Levels = NDArray[np.int64]


def follow(model: Model, level: Levels) -> tuple[Levels, Rates]:
    """Levels of the elements once they follow their fastest nodes, and the rates that come of them.

    Args:
        model: of one scene.
        level: that each element could have by itself, in the model's order, shape (element_count,).
    """
    tied = _tied_nodes(model)
    level = _uniform(model, level)
    node = _least(model, level)
    node[tied] = node[tied].min(initial=127)
    level = level.copy()
    for block in model.blocks:
        part = _part(block)
        level[part] = np.minimum(level[part], node[block.conn].min(axis=0))
    level = _uniform(model, level)
    node, touched = _least(model, level), _touched_nodes(model)
    top = int(level.max())
    common = int(node[touched].min(initial=top))
    node[touched] = common
    counts = np.bincount(level, minlength=top + 1)
    return level, Rates(
        top=top, common=common, node_level=node.astype(np.uint8), elements=tuple(int(count) for count in counts)
    )


def grouped(model: Model, level: Levels, rates: Rates) -> Model:
    """The model with the elements of each block sorted by level and chain, and these rates; arguments of `follow`.

    The chain of an element is the least level of its nodes. Few elements of a level have another chain than their own.
    """
    blocks, order = [], []
    chain = _uniform(model, _least_of_nodes(model, rates.node_level))
    levels = range(rates.top + 1)
    for block in model.blocks:
        own, own_chain = level[_part(block)], chain[_part(block)]
        found: list[NDArray[np.intp]] = []
        for k, c in product(levels, levels):
            mine = np.flatnonzero((own == k) & (own_chain == c))
            if len(mine) and ELEMENTS[block.element].patches:
                mine = mine[compact_order(model.X, np.ascontiguousarray(block.conn[:, mine].T), PATCH)]
            found.append(mine)
        place = np.concatenate(found)
        ends = tuple(np.cumsum([len(part) for part in found]).tolist())
        blocks.append(replace(block.part(place), first=block.first, part_ends=ends))
        order.append(model.element_of[_part(block)][place])
    rest = model.element_of[model.element_count :]  # of rigid bodies
    return replace(model, blocks=tuple(blocks), element_of=np.concatenate([*order, rest]), rates=rates)


def _part(block: Block) -> slice:
    """Where a block's elements lie in the model."""
    return slice(block.first, block.first + block.conn.shape[1])


def _uniform(model: Model, level: Levels) -> Levels:
    """Levels with one for all elements of a formulation whose forces depend on neighbouring elements."""
    found = level.copy()
    for block in model.blocks:
        if getattr(ELEMENTS[block.element], "one_rate", False):
            found[_part(block)] = found[_part(block)].min()
    return found


def _least(model: Model, level: Levels) -> Levels:
    """Least level of the elements around each node, shape (node_count,)."""
    node = np.full(model.node_count, 127, dtype=np.int64)
    for block in model.blocks:
        for corner in block.conn:
            np.minimum.at(node, corner, level[_part(block)])
    return node


def _least_of_nodes(model: Model, node_level: NDArray[np.uint8]) -> Levels:
    """Least level of the nodes of each element, shape (element_count,)."""
    parts = [node_level[block.conn].min(axis=0) for block in model.blocks]
    return np.concatenate([np.zeros(0, np.int64), *parts]).astype(np.int64)


def _joined(parts: Sequence[Index]) -> Index:
    return np.unique(np.concatenate([np.zeros(0, np.int32), *parts])).astype(np.int32)


def _tied_nodes(model: Model) -> Index:
    """Nodes that joints bind to each other, rails and bases included: they move as one."""
    free = np.ones(len(model.joint_first), dtype=bool)
    for item in model.couplings:  # they have a motion in common, and each its own
        free[item.start : item.end] = False
    second = model.joint_second[free]
    return _joined([model.joint_first[free], second[second >= 0]])


def _touched_nodes(model: Model) -> Index:
    """Nodes that something else than elements, gravity and dashpots acts on.

    Those of absorbing boundaries move with their elements: dashpots that act more often than these would take up more
    than they bring, see docs/theory.md.
    """
    hinges = [side for load in model.hinge_loads for side in (load.inner, load.outer)]
    contacts = [nodes for item in model.passes for nodes in (item.slave, item.master)]
    joints = [model.joint_first, model.joint_second[model.joint_second >= 0], model.prescribed_node]
    others = [model.ties.slave, model.ties.carriers, *(item.node for items in model.loads.values() for item in items)]
    return _joined([*joints, *others, *(body.nodes for body in model.rigid_bodies), *hinges, *contacts])
