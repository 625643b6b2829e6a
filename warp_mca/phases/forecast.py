"""Owns what is said before an impact phase: its size, its time step and what sets that, about how long it takes."""

from __future__ import annotations

import logging
import time
from typing import TYPE_CHECKING

import warp as wp

from warp_mca.base.log import LOGGER
from warp_mca.base.progress import duration_words
from warp_mca.phases.rate_groups import cost_of

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact
    from warp_mca.system.model import Model

DOUBLE = 1.7  # time of an element on a GPU in float64 over that in mixed
ELEMENTS = {"hex8r": 0.7, "tet4": 0.6, "wedge6": 0.7}  # time of an element there over that of hex8
TRIED, STRIDE, ENOUGH = 32, 4, 0.05  # steps of a CPU that are timed at most, at once; time after which fewer do [s]
SETTLING = 1000  # steps for which the time of bodies that come to rest is said: how many they need is not known before
SPRINGS = 0.05  # share of the greatest eigenvalue from which on contact springs are said to set the step too


def announce(impact: Impact) -> None:
    """Say by the logger what is about to run, at level INFO."""
    logger = logging.getLogger(LOGGER)
    if logger.isEnabledFor(logging.INFO):  # the estimate takes steps
        logger.info("%s", forecast(impact))


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
    step = step_time(impact)
    each = f", after bodies have come to rest ({duration_words(SETTLING * step)} for each {SETTLING:,} steps)"
    return (
        f"{name}: {model.element_count:,} elements, {steps.count:,} steps of {steps.dt:.3g} s{groups}, set by "
        f"{_culprit(slowest)}; about {duration_words(steps.count * step)} on {where}"
        f"{each if impact.ready[0].scene.phases else ''}"
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


def step_time(impact: Impact) -> float:
    """About how long a step takes [s], with its share of searches and records.

    A CPU takes a few steps of a copy of the state. For a GPU the costs that `rate_groups` stores are taken: it holds no
    other state, and contact there mostly runs beside the elements.
    """
    if not wp.get_device(impact.solver.device).is_cuda:
        return _tried(impact)
    solver, steps, rates = impact.solver, impact.steps, impact.solver.model.rates
    weight = [ELEMENTS.get(block.element, 1.0) * block.conn.shape[1] for block in solver.model.blocks]
    share = sum(weight) / max(solver.model.element_count, 1)
    share *= DOUBLE if solver.precision == "float64" else 1.0
    work = rates.work if rates else solver.model.element_count
    count = steps.count * (rates.substeps if rates else 1)
    return cost_of(solver.device).of(count, round(share * work * steps.count), rates is not None) / steps.count


def _tried(impact: Impact) -> float:
    """The time of a step by a few steps of a copy of the state, a search and a record, which costs about as much."""
    solver, steps, state = impact.solver, impact.steps, impact.state.copy()
    begin = time.perf_counter()
    solver.search(state)
    search = time.perf_counter() - begin
    solver.step(state, STRIDE)  # captures the graph
    begin, taken = time.perf_counter(), 0
    while taken < TRIED and time.perf_counter() < begin + ENOUGH:
        solver.step(state, STRIDE)
        taken += STRIDE
    step = (time.perf_counter() - begin) / taken
    return step * (1.0 + 1.0 / steps.per_check) + search / (steps.per_search * steps.intervals_per_search)
