"""Owns what is said before an impact phase: its size, its time step and what sets that, about how long it takes."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import warp as wp

from warp_mca.base.log import LOGGER
from warp_mca.base.progress import duration_words
from warp_mca.phases.rate_groups import cost_of

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact
    from warp_mca.system.model import Model

SPEED_UP = 0.65  # power of the number of threads with which elements go faster; measured on up to 16
DOUBLE = {"cpu": 1.6, "cuda": 1.7}  # time of an element in float64 over that in mixed
ELEMENTS = {"hex8r": 0.7, "tet4": 0.6, "wedge6": 0.7}  # time of an element over that of hex8
SPRINGS = 0.05  # share of the greatest eigenvalue from which on contact springs are said to set the step too


def announce(impact: Impact) -> None:
    """Say by the logger what is about to run, at level INFO."""
    logging.getLogger(LOGGER).info("%s", forecast(impact))


def forecast(impact: Impact) -> str:
    """The size of an impact phase, its step and what sets it, and an estimate of its wall time, in one sentence."""
    solver, steps = impact.solver, impact.steps
    model, device = solver.model, wp.get_device(solver.device)
    scenes = len(impact.ready)
    name = impact.ready[0].scene.name + (f" and {scenes - 1} more" if scenes > 1 else "")
    slowest = min((item.model for item in impact.ready), key=lambda one: one.stable.dt)
    rates = model.rates
    groups = f" (of {rates.top + 1} groups; the shortest {steps.dt / rates.substeps:.3g} s)" if rates else ""
    where = device.name if device.is_cuda else f"cpu, {solver.threads} thread{'s' if solver.threads > 1 else ''}"
    return (
        f"{name}: {model.element_count:,} elements, {steps.count:,} steps of {steps.dt:.3g} s{groups}, "
        f"set by {_culprit(slowest)}; about {duration_words(expected_time(impact))} on {where}"
    )


def _culprit(model: Model) -> str:
    """What sets the stable step of a scene."""
    stable = model.stable
    if not model.element_count:
        return "contact springs and joints"
    name, element = model.owner(stable.element)
    share = stable.contact_share
    springs = f" ({share:.0%} of omega^2 by contact springs)" if share >= SPRINGS else ""
    return f"element {element} of {name}{springs}"


def expected_time(impact: Impact) -> float:
    """About how long the steps take [s], by the costs that `runs.rate_groups` stores for devices of this kind."""
    solver, steps, rates = impact.solver, impact.steps, impact.solver.model.rates
    cuda = wp.get_device(solver.device).is_cuda
    cost = cost_of(solver.device)
    weight = [ELEMENTS.get(block.element, 1.0) * block.conn.shape[1] for block in solver.model.blocks]
    share = sum(weight) / max(solver.model.element_count, 1)
    share *= DOUBLE["cuda" if cuda else "cpu"] if solver.precision == "float64" else 1.0
    share /= solver.threads**SPEED_UP
    work = rates.work if rates else solver.model.element_count
    count = steps.count * (rates.substeps if rates else 1)
    return cost.of(count, round(share * work * steps.count), rates is not None)
