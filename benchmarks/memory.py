"""Owns device memory of a model, and the bytes that a step must move: each array it needs read or written once."""

from __future__ import annotations

from typing import Any

import warp as wp

from benchmarks.blocks import Held, pool


def arrays(owner: Any, seen: dict[int, wp.array]) -> dict[int, wp.array]:
    """Every array that an object holds, by address; stages, springs and lists are looked through."""
    values = owner if isinstance(owner, list | tuple) else vars(owner).values() if hasattr(owner, "__dict__") else ()
    for value in list(values):
        if isinstance(value, wp.array):
            if value.ptr:
                seen[value.ptr] = value
        elif type(value).__module__.startswith("warp_mca.") or isinstance(value, list | tuple):
            if not type(value).__module__.startswith("warp_mca.model"):
                arrays(value, seen)
        elif type(value).__name__ in ("StructInstance", "Spring"):
            for name in value._cls.vars:
                item = getattr(value, name)
                if isinstance(item, wp.array) and item.ptr:
                    seen[item.ptr] = item
    return seen


def step_bytes(held: Held) -> float:
    """Bytes of a step in element and node kernels: an estimate that counts each needed array once.

    Positions and displacements are counted once for each kernel, as if the cache kept them for all elements around a
    node; history is read and written for elements that yield only.
    """
    s = held.solver
    total = 0.0
    nodes = s.model.node_count
    for stage in s.elements:
        mesh = stage.conn.capacity + stage.material.capacity + 2 * 24 * nodes
        total += mesh + s.force.capacity
        if held.case.yielding is not None:
            total += stage.yielded.capacity + 2.0 * held.case.yielding * stage.history.capacity
        if hasattr(stage, "group"):  # two kernels more: dilatation, and its mean at nodes
            total += stage.conn.capacity + 2 * 24 * nodes + 2 * stage.growth.capacity + stage.element.capacity
            total += stage.offset.capacity + stage.inverse_volume.capacity + 2 * stage.dilation.capacity
            total += stage.group.capacity
    total += s.force.capacity + s.slot.capacity + s.offset.capacity
    return total + (8 + 4 * 24) * nodes  # inverse mass; u and v read and written


def memory(held: Held) -> dict[str, float]:
    """Bytes of the solver's arrays and of a step, for each element; what it took off the device's pool [B]."""
    count = held.solver.model.element_count
    found = {
        "bytes_per_element": sum(a.capacity for a in arrays(held.solver, {}).values()) / count,
        "step_bytes_per_element": step_bytes(held) / count,
    }
    if held.pool_before is not None:
        found["pool_bytes"] = float(pool(held.device) or 0) - held.pool_before
    return found
