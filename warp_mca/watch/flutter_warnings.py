"""Owns the warning about flutter: vibration of touching surfaces that Coulomb friction on contact springs excites."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from warp_mca.model.model import Model

Array = NDArray[np.float64]

MEAN = 5  # rows whose mean is what the surface does besides
SPAN = 20  # rows, all in contact, that vibrate
SHARE = 0.07  # amplitude over the speed at which tip and target met, from which on a word is said; docs/decisions.md
SIDE_SHARE = 0.2  # the same across normal and tangent, where no column of forces looks


def flutter_warnings(history: Mapping[str, Array], model: Model) -> list[str]:
    """A sentence if the scene's target point vibrates in contact: by friction, or across the normal and the tangent.

    Args:
        history: columns of history.csv. model: of the scene alone.
    """
    if not model.passes or len(history["time_s"]) < MEAN + SPAN:
        return []
    tip, target = (np.column_stack([history[f"{point}_v{axis}"] for axis in "xyz"]) for point in ("tip", "plate"))
    speed = float(np.linalg.norm(tip[0] - target[0]))
    axes = [model.contact_axes[item.contact] for item in model.passes]
    rough = [own for own, item in zip(axes, model.passes, strict=True) if item.mu > 0.0]
    along = _amplitude(history, target, rough)
    if along > SHARE * speed > 0.0:  # nor where there are no such points
        return [
            f"the surface under the tip vibrates with up to {along:.2g} m/s, {along / speed:.0%} of the speed at which "
            "they met, faster than rows show: friction and stiff contact springs excite its cells (flutter), which "
            "depends on mesh and penalty; take plate_vx, plate_vy, plate_vz, stick_fraction and sticks with care; a "
            "lower penalty lessens it"
        ]
    across = _amplitude(history, target, [np.cross(own[:1], own[1:]) for own in axes])
    if across > SIDE_SHARE * speed > 0.0:
        return [
            f"the surface under the tip vibrates across normal and tangent with up to {across:.2g} m/s, "
            f"{across / speed:.0%} of the speed at which they met: contact presses nodes from one face of it to the "
            "next and back; take plate_vx, plate_vy and plate_vz in that direction with care; a lower penalty lessens "
            "it"
        ]
    return []


def _amplitude(history: Mapping[str, Array], velocity: Array, axes: Sequence[Array]) -> float:
    """Greatest vibration in contact of a velocity [m/s] along axes, each shape (axis_count, 3)."""
    if not axes:
        return 0.0
    return vibration(velocity @ np.concatenate(axes).T, history["F_n_N"] > 0.0)


def vibration(velocity: Array, touching: NDArray[np.bool_]) -> float:
    """Greatest amplitude of what changes faster than the mean of MEAN rows, over SPAN rows in contact [m/s].

    That of a sine with the same mean square: sqrt(2) times the root mean square.

    Args:
        velocity: components at each row [m/s], shape (row_count, component_count).
        touching: rows in contact, shape (row_count,).
    """
    inner = slice(MEAN // 2, len(velocity) - MEAN // 2)
    square = (velocity[inner] - _mean(velocity)) ** 2
    windows = np.lib.stride_tricks.sliding_window_view(square, SPAN, axis=0).mean(axis=-1)
    whole = np.lib.stride_tricks.sliding_window_view(touching[inner], SPAN).all(axis=-1)
    return float(np.sqrt(2.0 * windows[whole].max(initial=0.0)))


def _mean(values: Array) -> Array:
    """Of each MEAN rows one after the other, shape (row_count - MEAN + 1, component_count)."""
    return np.lib.stride_tricks.sliding_window_view(values, MEAN, axis=0).mean(axis=-1)
