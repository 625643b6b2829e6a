"""Owns the model of a batch: the models of its scenes concatenated; each scene computes what it would compute alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.model.assembly import GROUND, Block
from warp_mca.model.layout import Layout, complete, offsets
from warp_mca.model.mass_scaling import MassScaling
from warp_mca.model.model import Model
from warp_mca.physics.ties.nodes import join_ties

Index = NDArray[np.int32]

_CONCATENATED = ("X", "V", "mass", "fixed_axes", "prescribed_axis", "joint_tied", "contact_axes", "gravity")
_NODES = ("prescribed_node", "joint_first", "joint_second", "points")  # indices of nodes


def join_models(models: Sequence[Model]) -> Model:
    """Concatenate the models of several scenes; the model of a single scene is returned as it is.

    Contact passes are not merged: they are listed scene by scene, and the solver launches the k-th passes of all scenes
    together.

    Raises:
        TypeError: a field has no rule here by which it is joined.
        ValueError: a model has what no batch can.
    """
    if len(models) == 1:
        return models[0]
    nodes = offsets([model.node_count for model in models])
    elements = offsets([len(model.element_of) for model in models])
    pairs = offsets([len(model.joint_first) for model in models])
    blocks, order, ranges = _blocks(models, nodes, elements)
    fastest = int(np.argmin([model.stable.dt for model in models]))
    stable = models[fastest].stable

    return complete(
        type(models[0]),
        **{name: np.concatenate([getattr(model, name) for model in models]) for name in _CONCATENATED},
        blocks=blocks,
        law=_laws(models),
        **_tables(models),
        **{name: _shifted(models, name, nodes) for name in _NODES},
        joint_slides=_shifted(models, "joint_slides", pairs),
        **_joints(models, nodes, pairs),
        absorbing=complete(
            type(models[0].absorbing),
            node=np.concatenate([m.absorbing.node + start for m, start in zip(models, nodes, strict=False)]),
            damping=np.concatenate([model.absorbing.damping for model in models]),
            stiffness=np.concatenate([model.absorbing.stiffness for model in models]),
            velocity=np.concatenate([model.absorbing.velocity for model in models]),
        ),
        ties=join_ties([model.ties.moved(int(start)) for model, start in zip(models, nodes, strict=False)]),
        passes=tuple(
            replace(item, **{name: getattr(item, name) + start for name in ("slave", "slave_face", "face", "master")})
            for model, start in zip(models, nodes, strict=False)
            for item in model.passes
        ),
        penalties=tuple(penalty for model in models for penalty in model.penalties),
        node_start=_starts(models, "node_start", nodes),
        element_start=_starts(models, "element_start", elements),
        element_of=order,
        stable=replace(stable, element=stable.element + int(elements[fastest])),
        scaling=_scaling(models),
        rates=_none_of(models, "rates"),
        floating=_none_of(models, "floating"),  # they are found for all scenes together
        rigid_blocks=(),  # nothing shows the bodies of a batch
        batch=Layout(
            nodes=nodes,
            joints=offsets([len(model.joints) for model in models]),
            elements=ranges,
        ),
        **_rigid(models, nodes, pairs),
    )


def _shifted(models: Sequence[Model], name: str, start: Index) -> Index:
    """Indices of a field of all scenes, raised by the `start` of each scene; GROUND is kept."""
    values = [getattr(model, name) for model in models]
    return np.concatenate([np.where(v == GROUND, v, v + s) for v, s in zip(values, start, strict=False)])


def _none_of(models: Sequence[Model], name: str) -> None:
    """Refuse models that have what no batch can: None.

    Raises:
        ValueError: one has it.
    """
    if any(getattr(model, name) is not None for model in models):
        raise ValueError(f"Model.{name}: models of a batch have none")


def _blocks(models: Sequence[Model], nodes: Index, elements: Index) -> tuple[tuple[Block, ...], Index, Index]:
    """Blocks of all scenes, the order of the elements in the joined meshes, and `Layout.elements`."""
    laws = offsets([len(model.law) for model in models])
    # in the order that a scene alone has them in, so that sums over elements come out alike
    kinds = sorted({block.kind for model in models for block in model.blocks})
    blocks, order, first = [], [np.zeros(0, dtype=np.int32)], 0
    ranges = np.zeros((len(models), len(kinds), 2), dtype=np.int32)
    for column, kind in enumerate(kinds):
        conn, material, end = [], [], first
        for k, model in enumerate(models):
            ranges[k, column] = end
            for block in model.blocks:
                if block.kind == kind:
                    count = block.conn.shape[1]
                    conn.append(block.conn + nodes[k])
                    material.append(block.material + laws[k])
                    order.append(model.element_of[block.first : block.first + count] + elements[k])
                    end += count
            ranges[k, column, 1] = end
        _, law, element, finite = kind
        blocks.append(
            complete(
                Block,
                element=element,
                law=law,
                finite=finite,
                conn=np.ascontiguousarray(np.concatenate(conn, axis=1)),
                material=np.concatenate(material),
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
    return complete(
        MassScaling,
        added=np.concatenate([item.added for item in found]),
        elements=sum(item.elements for item in found),
        plain_dt=min(item.plain_dt for item in found),
    )


def _laws(models: Sequence[Model]) -> NDArray[np.float64]:
    """Parameters of the materials of all scenes, as `Model.law`."""
    width = max(model.law.shape[1] for model in models)
    return np.concatenate([np.pad(model.law, ((0, 0), (0, width - model.law.shape[1]))) for model in models])


def _tables(models: Sequence[Model]) -> dict[str, Any]:
    """Tables of driven axes, and the one of each axis."""
    entries = offsets([len(model.table_time) for model in models])
    tables = offsets([len(model.table_offset) - 1 for model in models])
    starts = [model.table_offset[:-1] + start for model, start in zip(models, entries, strict=False)]
    numbers = [model.prescribed_table + start for model, start in zip(models, tables, strict=False)]
    return {
        "prescribed_table": np.concatenate(numbers),
        "table_offset": np.append(np.concatenate(starts), entries[-1]).astype(np.int32),
        "table_time": np.concatenate([model.table_time for model in models]),
        "table_value": np.concatenate([model.table_value for model in models]),
    }


def _joints(models: Sequence[Model], nodes: Index, pairs: Index) -> dict[str, Any]:
    """Joints of all scenes, and what acts in them: first nodes and first pairs of each scene are given."""
    scenes = [(k, model, nodes[k], int(pairs[k])) for k, model in enumerate(models)]
    couplings = offsets([len(model.couplings) for model in models])

    def shifted(k: int, coupling: int) -> int:
        return coupling if coupling < 0 else coupling + int(couplings[k])

    return {
        "joints": tuple(
            replace(joint, start=joint.start + first, end=joint.end + first)
            for _, model, _, first in scenes
            for joint in model.joints
        ),
        "couplings": tuple(
            replace(item, start=item.start + first, middle=item.middle + first, end=item.end + first)
            for _, model, _, first in scenes
            for item in model.couplings
        ),
        "hinge_loads": tuple(
            replace(load, inner=load.inner + node, outer=load.outer + node, scene=k)
            for k, model, node, _ in scenes
            for load in model.hinge_loads
        ),
        "bases": tuple(
            replace(base, start=base.start + first, end=base.end + first, coupling=shifted(k, base.coupling), scene=k)
            for k, model, _, first in scenes
            for base in model.bases
        ),
    }


def _rigid(models: Sequence[Model], nodes: Index, pairs: Index) -> dict[str, Any]:
    """Rigid bodies of all scenes, and what binds them; arguments as of `_joints`."""
    first = offsets([len(model.rigid_bodies) for model in models])
    first_pin = offsets([len(model.rigid_pins) for model in models])
    bodies = tuple(
        replace(
            body,
            own=body.own + nodes[k],
            loaded=body.loaded + nodes[k],
            riders=body.riders + nodes[k],
            pairs=body.pairs + pairs[k],
            scene=k,
        )
        for k, model in enumerate(models)
        for body in model.rigid_bodies
    )
    rows = tuple(
        replace(
            row,
            first=row.first + int(first[k]),
            second=row.second if row.second == GROUND else row.second + int(first[k]),
            pair=row.pair if row.pair < 0 else row.pair + int(pairs[k]),
            pin=row.pin if row.pin < 0 else row.pin + int(first_pin[k]),
        )
        for k, model in enumerate(models)
        for row in model.rigid_rows
    )
    pins = tuple(
        replace(pin, body=pin.body + int(first[k]), start=pin.start + int(pairs[k]), end=pin.end + int(pairs[k]))
        for k, model in enumerate(models)
        for pin in model.rigid_pins
    )
    return {"rigid_bodies": bodies, "rigid_rows": rows, "rigid_pins": pins}


def _starts(models: Sequence[Model], name: str, first: Index) -> dict[str, int]:
    """First node or element of each body; bodies go by the number of their scene and their name."""
    return {
        f"{k}/{body}": start + int(first[k])
        for k, model in enumerate(models)
        for body, start in getattr(model, name).items()
    }
