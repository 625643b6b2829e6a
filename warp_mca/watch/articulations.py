"""Owns the rows about rigid bodies and joints between whole bodies: limits, poses that are singular, fast turns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from warp_mca.kernels.nodes.joint_arrays import HIGH, LIMIT_STIFFNESS, LOW, SLIDE
from warp_mca.watch.row import Context, Finished, Values, When, row


@row(
    "freedom {number} of joint {joint} starts {over:.3g} {unit} beyond its limits, where their springs hold "
    "{energy:.3g} J that the bodies will get:",
    "start within the limits",
    0.01,
    "of the way between the limits at most",
    when=When.BEFORE,
)
def start_beyond_limits(c: Context, most: float) -> Iterator[Values]:
    """How far freedoms of joints between whole bodies are beyond their limits at the start."""
    for item in c.model.body_joints:
        for k, (q, drive) in enumerate(zip(item.position, item.drive, strict=True)):
            over = max(q - drive[HIGH], drive[LOW] - q)
            if over > most * (drive[HIGH] - drive[LOW]):
                unit = "m" if item.kind[k] == SLIDE else "rad"
                energy = 0.5 * drive[LIMIT_STIFFNESS] * over**2
                yield dict(number=k + 1, joint=item.name, over=over, unit=unit, energy=energy)


@row(
    "body {body} turned by {turn:.2g} rad in a step, which makes angles some {share:.1g} of themselves wrong:",
    "set time_step_scale to {scale:.2g}",
    0.04,
    "rad at most",
)
def fast_turn(c: Finished, most: float) -> Iterator[Values]:
    """Greatest turn of each rigid body in a step."""
    if c.rigid is None or not (c.rigid.turn > most).any():
        return
    k = int(np.argmax(c.rigid.turn))
    turn = float(c.rigid.turn[k])
    scale = c.scene.impact.time_step_scale * 0.5 * most / turn
    yield dict(body=c.model.rigid_bodies[k].name, turn=turn, share=turn**2 / 6.0, scale=scale)


@row(
    "joint {joint} came near a pose in which two of its freedoms make the same motion, at t = {time:.4g} s "
    "({share:.1g} of one was left): rates there have no bound, and their motors, springs and positions are not sure;",
    "keep it away by limits or another start, or choose other axes",
    0.02,
    "of a freedom's screw that others do not make, at least",
)
def freedoms_alike(c: Finished, least: float) -> Iterator[Values]:
    """Least part of a freedom of each joint between whole bodies that the others do not make, in any step."""
    if c.rigid is None:
        return
    for item, (share, step) in zip(c.model.body_joints, c.rigid.alone, strict=True):
        if share < least:
            yield dict(joint=item.name, share=share, time=c.rigid.dt * step - c.origin)


@row(
    "joint {joint} and those that close a loop with it came to a dead point at t = {time:.4g} s, where they hold fewer "
    "motions than elsewhere: rounding decides which way the bodies went on;",
    "keep them away from it by limits or another start",
    1e-3,
    "of what the rows of joints hold by themselves at the start, at least",
)
def dead_point(c: Finished, least: float) -> Iterator[Values]:
    """Least part of the rows of joints between whole bodies that others do not hold, over that at the start."""
    if c.rigid is None:
        return
    for item, (rank, _, share, step) in zip(c.model.body_joints, c.rigid.rank, strict=True):
        if rank > 0.0 and share < least:
            yield dict(joint=item.name, time=c.rigid.dt * step - c.origin)
