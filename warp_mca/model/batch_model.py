"""Owns the model of a batch: the models of its scenes concatenated; each scene computes what it would compute alone."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Index
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import join, offsets
from warp_mca.physics.contact.skin_edges import EdgePass, no_edges
from warp_mca.physics.loads.nodal import check_batch
from warp_mca.scene.contact_laws import DampedPenalty, Penalty
from warp_mca.scene.loads import ThermalStrain
from warp_mca.system.block import Block
from warp_mca.system.body_joints import check_alike
from warp_mca.system.contact import ContactPass
from warp_mca.system.failing import joined
from warp_mca.system.layout import Layout
from warp_mca.system.model import Model
from warp_mca.system.time_step import MassScaling

# what the numbers in a model's arrays count, and how many of them a model has
_COUNTS: dict[str, Callable[[Model], int]] = {
    "nodes": lambda model: model.node_count,
    "elements": lambda model: len(model.element_of),
    "pairs": lambda model: len(model.joint_first),
    "couplings": lambda model: len(model.couplings),
    "tables": lambda model: len(model.table_offset) - 1,
    "table entries": lambda model: len(model.table_time),
    "rigid bodies": lambda model: len(model.rigid_bodies),
    "rigid pins": lambda model: len(model.rigid_pins),
    "body joints": lambda model: len(model.body_joints),
}


def join_models(models: Sequence[Model]) -> Model:
    """Concatenate the models of several scenes; the model of a single scene is returned as it is.

    Each field is joined by its own rule, see `base/joining.py`. Contact passes are not merged: they are listed scene by
    scene, and the solver launches the k-th passes of all scenes together.

    Raises:
        RequestError: scenes have different kinds of loads, or one that no batch can.
        TypeError: a field has no rule by which it is joined.
        ValueError: a model has what no batch can.
    """
    if len(models) == 1:
        return models[0]
    check_batch([model.loads for model in models])
    check_alike(models)
    if any(model.fails and model.passes for model in models):
        remedy = "contact follows it in single runs alone; use run in place of run_batch"
        raise bad_value("failure of materials of scenes", _failing(models), remedy)
    if len({model.fails for model in models}) > 1:
        remedy = "others have none; run these in batches apart"
        raise bad_value("failure of materials of scenes", _failing(models), remedy)
    starts = {kind: offsets([count(model) for model in models]) for kind, count in _COUNTS.items()}
    nodes, elements = starts["nodes"], starts["elements"]
    blocks, order, ranges = _blocks(models, nodes, elements)
    fastest = int(np.argmin([model.stable.dt for model in models]))
    stable = models[fastest].stable
    return join(
        models,
        starts,
        blocks=blocks,
        law=_laws(models),
        node_start=_starts(models, "node_start", nodes),
        element_start=_starts(models, "element_start", elements),
        element_of=order,
        stable=replace(stable, element=stable.element + int(elements[fastest])),
        scaling=_scaling(models),
        rigid_blocks=(),  # nothing shows the bodies of a batch
        batch=Layout(nodes=nodes, joints=offsets([len(model.joints) for model in models]), elements=ranges),
    )


def _failing(models: Sequence[Model]) -> list[int]:
    """Numbers of the scenes whose elements may fail."""
    return [k for k, model in enumerate(models) if model.fails]


def with_alike_passes(models: Sequence[Model]) -> list[Model]:
    """Models of which each has a pass of edges, perhaps an empty one, where another's contact has one.

    So with dashpots: where bodies of one scene rest on each other, a contact that another scene leaves to the program
    has one that takes nothing.

    Raises:
        RequestError: a contact keeps out the nodes of both sides in some models only.
    """
    sides = [[(item.contact, item.sign) for item in model.passes if not isinstance(item, EdgePass)] for model in models]
    for k, own in enumerate(sides):
        if own != sides[0]:
            raise bad_value(
                f"contacts of scenes[{k}]", len(own), "some are two-way in it only: give two_way in all scenes"
            )
    edged = {item.contact for model in models for item in model.passes if isinstance(item, EdgePass)}
    damped = {item.contact for model in models for item in model.passes if item.law == DampedPenalty.law}
    return [replace(model, passes=_padded(_damped(model.passes, damped), edged)) for model in models]


def _damped(passes: Sequence[ContactPass], damped: Collection[int]) -> list[ContactPass]:
    idle = {"law": DampedPenalty.law, "parameters": (0.0, 0.0), "damping": np.finfo(float).tiny}
    return [replace(item, **idle) if item.contact in damped and item.law == Penalty.law else item for item in passes]


def _padded(passes: Sequence[ContactPass], edged: Collection[int]) -> tuple[ContactPass, ...]:
    found: list[ContactPass] = []
    for k, item in enumerate(passes):
        found.append(item)
        last = k + 1 == len(passes) or passes[k + 1].contact != item.contact
        if last and item.contact in edged and not isinstance(item, EdgePass):
            found.append(no_edges(item))
    return tuple(found)


def _blocks(models: Sequence[Model], nodes: Index, elements: Index) -> tuple[tuple[Block, ...], Index, Index]:
    """Blocks of all scenes, the order of the elements in the joined meshes, and `Layout.elements`."""
    laws = offsets([len(model.law) for model in models])
    strains = offsets([len(model.loads.get(ThermalStrain.__name__, ())) for model in models])
    heated = np.stack([strains, np.zeros_like(strains)])
    # in the order that a scene alone has them in, so that sums over elements come out alike
    kinds = sorted({block.kind for model in models for block in model.blocks})
    blocks, order, first = [], [np.zeros(0, dtype=np.int32)], 0
    ranges = np.zeros((len(models), len(kinds), 2), dtype=np.int32)
    for column, kind in enumerate(kinds):
        conn, material, viscosity, thermal, failing, end = [], [], [], [], [], first
        for k, model in enumerate(models):
            ranges[k, column] = end
            for block in model.blocks:
                if block.kind == kind:
                    count = block.conn.shape[1]
                    conn.append(block.conn + nodes[k])
                    material.append(block.material + laws[k])
                    viscosity += [] if block.viscosity is None else [block.viscosity]
                    if block.thermal is not None:
                        thermal.append(block.thermal + heated[:, k : k + 1] * (block.thermal >= 0.0))
                    failing.append(block.failing)
                    order.append(model.element_of[block.first : block.first + count] + elements[k])
                    end += count
            ranges[k, column, 1] = end
        blocks.append(
            replace(
                next(block for model in models for block in model.blocks if block.kind == kind),
                conn=np.ascontiguousarray(np.concatenate(conn, axis=1)),
                material=np.concatenate(material),
                viscosity=np.concatenate(viscosity, axis=1) if viscosity else None,
                thermal=np.concatenate(thermal, axis=1) if thermal else None,
                failing=joined(failing),
                first=first,
                ends=tuple((ranges[:, column, 1] - first).tolist()),
                part_ends=(),  # of elements with steps of their own, which batches have not
            )
        )
        first = end
    return tuple(blocks), np.concatenate(order), ranges


def _scaling(models: Sequence[Model]) -> MassScaling | None:
    """What mass scaling added in all scenes, or None where none has it."""
    found = [
        model.scaling or MassScaling(added=0.0 * model.mass, elements=0, plain_dt=model.stable.dt) for model in models
    ]
    if all(model.scaling is None for model in models):
        return None
    return MassScaling(
        added=np.concatenate([item.added for item in found]),
        elements=sum(item.elements for item in found),
        plain_dt=min(item.plain_dt for item in found),
    )


def _laws(models: Sequence[Model]) -> NDArray[np.float64]:
    """Parameters of the materials of all scenes, as `Model.law`."""
    width = max(model.law.shape[1] for model in models)
    return np.concatenate([np.pad(model.law, ((0, 0), (0, width - model.law.shape[1]))) for model in models])


def _starts(models: Sequence[Model], name: str, first: Index) -> dict[str, int]:
    """First node or element of each body; bodies go by the number of their scene and their name."""
    return {
        f"{k}/{body}": start + int(first[k])
        for k, model in enumerate(models)
        for body, start in getattr(model, name).items()
    }
