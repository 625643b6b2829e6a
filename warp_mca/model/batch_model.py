"""Owns the model of a batch: the models of its scenes concatenated; each scene computes what it would compute alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.model.assembly import GROUND, Block
from warp_mca.model.layout import Layout, offsets
from warp_mca.model.model import Model

Index = NDArray[np.int32]


def join_models(models: Sequence[Model]) -> Model:
    """Concatenate the models of several scenes; the model of a single scene is returned as it is.

    Contact passes are not merged: they are listed scene by scene, and the solver launches the k-th passes of all scenes
    together.
    """
    if len(models) == 1:
        return models[0]
    nodes = offsets([model.node_count for model in models])
    elements = offsets([len(model.element_of) for model in models])
    pairs = offsets([len(model.joint_first) for model in models])
    blocks, order, ranges = _blocks(models, nodes, elements)
    fastest = int(np.argmin([model.stable.dt for model in models]))
    stable = models[fastest].stable

    def shifted(name: str, start: Index) -> Index:
        """Indices of a field of all scenes, raised by the `start` of each scene; GROUND is kept."""
        values = [getattr(model, name) for model in models]
        return np.concatenate([np.where(v == GROUND, v, v + s) for v, s in zip(values, start, strict=False)])

    return Model(
        X=np.concatenate([model.X for model in models]),
        V=np.concatenate([model.V for model in models]),
        mass=np.concatenate([model.mass for model in models]),
        blocks=blocks,
        law=_laws(models),
        fixed_axes=np.concatenate([model.fixed_axes for model in models]),
        prescribed_node=shifted("prescribed_node", nodes),
        prescribed_axis=np.concatenate([model.prescribed_axis for model in models]),
        **_tables(models),
        joint_first=shifted("joint_first", nodes),
        joint_second=shifted("joint_second", nodes),
        joint_tied=np.concatenate([model.joint_tied for model in models]),
        joint_slides=shifted("joint_slides", pairs),
        **_joints(models, nodes, pairs),
        passes=tuple(
            replace(item, slave=item.slave + start, face=item.face + start, master=item.master + start)
            for model, start in zip(models, nodes, strict=False)
            for item in model.passes
        ),
        contact_axes=np.concatenate([model.contact_axes for model in models]),
        gravity=np.concatenate([model.gravity for model in models]),
        points=shifted("points", nodes),
        node_start=_starts(models, "node_start", nodes),
        element_start=_starts(models, "element_start", elements),
        element_of=order,
        stable=replace(stable, element=stable.element + int(elements[fastest])),
        batch=Layout(
            nodes=nodes,
            joints=offsets([len(model.joints) for model in models]),
            elements=ranges,
        ),
        **_rigid(models, nodes, pairs),
    )


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
            Block(
                element=element,
                law=law,
                finite=finite,
                conn=np.ascontiguousarray(np.concatenate(conn, axis=1)),
                material=np.concatenate(material),
                first=first,
                ends=tuple((ranges[:, column, 1] - first).tolist()),
            )
        )
        first = end
    return tuple(blocks), np.concatenate(order), ranges


def _laws(models: Sequence[Model]) -> NDArray[np.float64]:
    """Parameters of the materials of all scenes, as `Model.law`."""
    width = max(model.law.shape[1] for model in models)
    return np.concatenate([np.pad(model.law, ((0, 0), (0, width - model.law.shape[1]))) for model in models])


def _tables(models: Sequence[Model]) -> dict[str, NDArray]:
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
