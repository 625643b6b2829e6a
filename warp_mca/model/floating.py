"""Owns the choice whether elements compute in floating frames of their bodies, and the nodes that these frames follow.

In `mixed`, rounding of strains in a body that turns kicks nodes like heat: in N steps of a phase of T seconds its kinetic
energy grows by about GAIN eps^2 N (c T / L)^2 of itself, whatever the speed at which it turns; c is the speed of waves in
bars, L the body's length, eps = 2^-24. docs/decisions.md has the measurement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.scene import Body, Scene

if TYPE_CHECKING:
    from warp_mca.model.model import Model

Array = NDArray[np.float64]
Index = NDArray[np.int32]

GAIN = 3.0  # measured with `hex8`
ALLOWED = 5e-5  # growth of the kinetic energy that needs no frames [-]
EPSILON = 2.0**-24  # by which float32 rounds
AT_REST = 0b111  # of `Model.fixed_axes`, all axes


@dataclass(frozen=True, kw_only=True)
class FloatingFrames:
    """A frame for each body, those of each scene in turn.

    Attributes:
        frame: of each node, shape (node_count,), int32.
        marker: nodes that each frame follows, shape (frame_count, 4), int32.
    """

    frame: Index
    marker: Index


def with_floating_frames(model: Model, scenes: Sequence[Scene], span: float, precision: str) -> Model:
    """The model with floating frames, if a body may turn and would be heated in a phase of `span` seconds."""
    if precision != "mixed":
        return model
    bodies = [body for scene in scenes for body in scene.bodies]
    starts = np.array(list(model.node_start.values()), dtype=np.int64)
    ends = np.append(starts[1:], model.node_count)
    marker = np.array([start + _markers(model.X[start:end]) for start, end in zip(starts, ends, strict=True)])
    length = np.linalg.norm(model.X[marker[:, 1]] - model.X[marker[:, 0]], axis=1)
    at_rest = np.add.reduceat(model.fixed_axes == AT_REST, starts)
    speed = np.array([_speed(body) for body in bodies])
    turns = np.array([not body.rigid for body in bodies]) & (at_rest < 3)
    growth = GAIN * EPSILON**2 * span / model.stable.dt * (speed * span / length) ** 2
    if not (growth[turns] > ALLOWED).any():
        return model
    frame = np.repeat(np.arange(len(starts)), ends - starts).astype(np.int32)
    return replace(model, floating=FloatingFrames(frame=frame, marker=marker.astype(np.int32)))


def _markers(X: Array) -> Index:
    """Four nodes of a body that lie far apart, the first two farthest: a third off their line, a fourth off the plane."""
    first = int(np.argmax(((X - X[0]) ** 2).sum(axis=1)))
    away = X - X[first]
    second = int(np.argmax((away**2).sum(axis=1)))
    across = np.cross(away, away[second])
    third = int(np.argmax((across**2).sum(axis=1)))
    fourth = int(np.argmax(np.abs(away @ across[third])))
    return np.array([first, second, third, fourth], dtype=np.int32)


def _speed(body: Body) -> float:
    """Greatest speed of waves along a bar of a body's materials [m/s]."""
    materials = body.material.values() if isinstance(body.material, Mapping) else (body.material,)
    return max(material.wave_speeds["bar"] for material in materials)
