"""Owns the choice whether elements compute in floating frames of their bodies, and the nodes that these frames follow.

In `mixed`, rounding of strains in a body that turns kicks nodes like heat: in N steps of a phase of T seconds its
kinetic energy grows by about GAIN eps^2 N (c T / L)^2 of itself, whatever the speed at which it turns; c is the speed
of waves in bars, L the body's length, eps = 2^-24. docs/decisions.md has the measurement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.scene import Body, Scene
from warp_mca.system.floating import FloatingFrames

if TYPE_CHECKING:
    from warp_mca.system.model import Model


GAIN = 3.0  # measured with `hex8`
ALLOWED = 1e-4  # growth of the kinetic energy that needs no frames [-]
EPSILON = 2.0**-24  # by which float32 rounds


def with_floating_frames(model: Model, scenes: Sequence[Scene], span: float, precision: str) -> Model:
    """The model with floating frames, if a body may turn and would be heated in a phase of `span` seconds.

    Elements with steps of their own, or that may fail, have none.
    """
    if precision != "mixed" or model.rates or model.fails:
        return model
    bodies = [body for scene in scenes for body in scene.bodies]  # as their nodes follow each other
    start = np.array(list(model.node_start.values()), dtype=np.int64)
    count = np.diff(start, append=model.node_count)
    nodes = [slice(first, first + n) for first, n in zip(start, count, strict=True)]
    if not any(
        _growth(body, model.X[part], span, model.stable.dt) > ALLOWED and _is_free(model, part)
        for body, part in zip(bodies, nodes, strict=True)
        if not body.rigid
    ):
        return model
    marker = np.array([part.start + _markers(model.X[part]) for part in nodes], dtype=np.int32)
    frame = np.repeat(np.arange(len(start), dtype=np.int32), count)
    return replace(model, floating=FloatingFrames(frame=frame, marker=marker))


def _markers(X: Array) -> Index:
    """Four nodes of a body that lie far apart: a third off the line of the first two, a fourth off the plane."""
    first, second = _ends(X)
    away = X - X[first]
    across = np.cross(away, away[second])
    third = int(np.argmax((across**2).sum(axis=1)))
    fourth = int(np.argmax(np.abs(away @ across[third])))
    return np.array([first, second, third, fourth], dtype=np.int32)


def _ends(X: Array) -> tuple[int, int]:
    """Two nodes of a body that lie far apart."""
    first = int(np.argmax(((X - X[0]) ** 2).sum(axis=1)))
    return first, int(np.argmax(((X - X[first]) ** 2).sum(axis=1)))


def _growth(body: Body, X: Array, span: float, dt: float) -> float:
    """Growth of the kinetic energy of a body with nodes in X [m] by rounding [-]."""
    materials = body.material.values() if isinstance(body.material, Mapping) else (body.material,)
    speed = max(material.wave_speeds["bar"] for material in materials)
    first, second = _ends(X)
    passes = speed * span / float(np.linalg.norm(X[second] - X[first]))
    return GAIN * EPSILON**2 * (span / dt) * passes * passes


def _is_free(model: Model, part: slice) -> bool:
    """Whether axes at rest and driven ones leave a body of some nodes a rigid motion."""
    held = (model.fixed_axes[:, None] >> np.arange(3) & 1).astype(bool)
    held[model.prescribed_node, model.prescribed_axis] = True
    node, axis = np.nonzero(held[part])
    X, direction = model.X[part], np.eye(3)[axis]
    arm = (X[node] - X.mean(axis=0)) / np.ptp(X, axis=0).max()
    rows = np.concatenate([direction, np.cross(arm, direction)], axis=1)
    return int(np.linalg.matrix_rank(rows.T @ rows)) < 6
