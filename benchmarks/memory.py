"""Owns device memory of a model, and the bytes that a step must move: each array it needs read or written once."""

from __future__ import annotations

from typing import Any

import warp as wp

from benchmarks.blocks import Held
from warp_mca.physics.elements.patch_stage import PatchStage


def size(array: wp.array) -> int:
    """Bytes of an array's entries, also where it is a transposed view."""
    return array.size * wp.types.type_size_in_bytes(array.dtype)


def arrays(owner: Any, seen: dict[int, wp.array], owners: dict[int, Any]) -> dict[int, wp.array]:
    """Every array that an object holds, by address; stages, springs, lists and tables are looked through, each once."""
    if id(owner) in owners:
        return seen
    owners[id(owner)] = owner  # kept, so that no other object gets its number meanwhile
    items = owner.values() if isinstance(owner, dict) else owner if isinstance(owner, list | tuple) else ()
    for value in [*items, *getattr(owner, "__dict__", {}).values()]:
        if isinstance(value, wp.array):
            if value.ptr and (value.ptr not in seen or size(value) > size(seen[value.ptr])):  # not a view of it
                seen[value.ptr] = value
        elif type(value).__module__.startswith("warp_mca.") or isinstance(value, list | tuple | dict):
            if not type(value).__module__.startswith("warp_mca.system.model"):
                arrays(value, seen, owners)
        elif type(value).__name__ in ("StructInstance", "NewStructInstance"):
            for name in value._cls.vars:
                item = getattr(value, name)
                if isinstance(item, wp.array) and item.ptr:
                    seen[item.ptr] = item
    return seen


def step_bytes(held: Held) -> float:
    """Bytes of a step in element and node kernels: an estimate that counts each needed array once.

    Positions and displacements are counted once for each kernel, as if the cache kept them for all elements around a
    node, or once for each patch around it; history is read and written for elements that yield only.
    """
    s, work = held.solver, held.solver.work
    total = 0.0
    nodes = s.model.node_count
    for stage in s.elements:
        if isinstance(stage, PatchStage):
            lists, vectors = stage.patches, 1 if s.precision == "mixed" else 2  # points stand for positions
            total += size(lists.corner) + size(stage.point) + size(lists.places) + vectors * 24 * len(stage.point)
        else:
            total += size(stage.conn) + size(stage.material) + 2 * 24 * nodes
        total += size(work.force)
        if held.case.yielding is not None:
            own = held.state.elements[stage.index]
            total += size(own.yielded) + 2.0 * held.case.yielding * size(own.history)
        if hasattr(stage, "group"):  # two kernels more: dilatation, and its mean at nodes
            total += size(stage.conn) + 2 * 24 * nodes + 2 * size(stage.growth) + size(stage.element)
            total += size(stage.offset) + size(stage.inverse_volume) + 2 * size(stage.dilatation)
            total += size(stage.group)
    total += size(work.force) + size(work.first_slots) + size(work.more_slots)
    return total + (8 + 4 * 24) * nodes  # inverse mass; u and v read and written


def memory(held: Held) -> dict[str, float]:
    """Bytes of the arrays of solver and state, and of a step, for each element."""
    count = held.solver.model.element_count
    found = {
        "bytes_per_element": sum(size(a) for a in arrays([held.solver, held.state], {}, {}).values()) / count,
        "step_bytes_per_element": step_bytes(held) / count,
    }
    return found
