"""Owns what a summary says of joints between whole bodies: greatest loads, and where they stand at the end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.kernels.nodes.joint_arrays import SLIDE

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver


def joint_reports(solver: Solver, scene: int, history: Mapping[str, Array]) -> dict[str, Any]:
    """By joint: greatest force, moment and drive torques, each with unit and time [s], and the freedoms at the end.

    Args:
        solver: of the run, whose last step is that of the last record.
        scene: its number in a batch.
        history: columns of this scene.
    """
    found: dict[str, Any] = {}
    time, first = history["time_s"], 0
    assert solver.rigid.joints is not None
    step = solver.rigid.joints.step
    seen, pace = step.seen.numpy(), step.pace.numpy()
    for item in solver.model.body_joints:
        own = slice(first, first + len(item.kind))
        first = own.stop
        if item.scene != scene:
            continue
        force, moment = (np.linalg.norm([history[name] for name in item.loads[k : k + 3]], axis=0) for k in (0, 3))
        slides = item.kind == SLIDE
        units = [("N", "m", "m/s") if slide else ("N m", "rad", "rad/s") for slide in slides]
        drives = [np.abs(history[name]) for name in item.drives]
        found[item.name] = {
            "max_force": _greatest(time, force, "N"),
            "max_moment": _greatest(time, moment, "N m"),
            "max_drive": [_greatest(time, value, unit[0]) for value, unit in zip(drives, units, strict=True)],
            "position": [_value(q, unit[1]) for q, unit in zip(seen[own], units, strict=True)],
            "rate": [_value(q, unit[2]) for q, unit in zip(pace[own], units, strict=True)],
        }
    return found


def _value(value: float, unit: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit}


def _greatest(time: Array, values: Array, unit: str) -> dict[str, Any]:
    k = int(np.argmax(values)) if len(values) else 0
    return {**_value(values[k], unit), "time": float(time[k])} if len(values) else {**_value(0.0, unit), "time": 0.0}
