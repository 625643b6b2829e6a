"""Owns what probes and sections of a cycle record: the device in impacts, the placement of bodies in rigid phases."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_mca.model.sensors import CHANNELS
from warp_mca.phases.cycle_rows import kept_rows
from warp_mca.phases.cycle_setup import Setup
from warp_mca.phases.parts import Part, SwingPart
from warp_mca.rigid.placement import link_placements

Array = NDArray[np.float64]


def cycle_records(setup: Setup, parts: Sequence[Part]) -> list[Array]:
    """Channels of the sensors at each row of the history, each shape (channel_count,), float64; nan for sections of
    bodies that are rigid for the time being."""
    found: list[Array] = []
    for k, part in enumerate(parts):
        if isinstance(part, SwingPart):
            rows = _swing_records(setup, part)
            found += rows[kept_rows(part, k == 0, k + 1 < len(parts))]
        else:
            found += part.impact.scene_runs[0].ledger.kept.sensors
    return found


def _swing_records(setup: Setup, part: SwingPart) -> list[Array]:
    motion, run, sensors = part.motion, part.swing, setup.sensors
    local = [
        (spot.body, spot.weight @ motion.points(spot.body, setup.meshes[spot.body].points)[spot.node])
        for spot in sensors.spots
    ]
    unknown = np.full(CHANNELS * len(sensors.cuts), np.nan)
    found = []
    for t, theta, rate in zip(run.t, run.theta_t, run.theta_dot_t, strict=True):
        links = link_placements(motion.chain.moved_to(t), theta, rate)
        rows = []
        for body, point in local:
            placed = links[body] if body in links else motion.placements[body].after(t - run.t[0])
            rows += [column[0] for column in placed.place(point[None])]
        found.append(np.concatenate([*rows, unknown]))
    return found
