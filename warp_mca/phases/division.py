"""Owns the choice of a run's time step, and how often it searches for contact."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from warp_mca.base.errors import bad_value
from warp_mca.physics.loads.nodal import load_speed
from warp_mca.scene import Scene
from warp_mca.step.steps import Steps
from warp_mca.system.model import Model

# Speeds may grow to so many times that of the fastest node, or that at which nodes approach each other, before one can
# outrun the contact search between two passes.
SPEED_RESERVE = 4.0
EDGE_RESERVE = 16.0  # the same at sharp edges, which throw light nodes: one got 9 times the speed of a phone's fall
# Times that reserve where a search holds for several intervals, each of which may have one at little cost: the loose
# cover of a phone got 4.5 times the speed of its fall.
_LOOSE = 2.0
MOST_INTERVALS = 4  # of output between two searches: bodies that rest or are slow at first are pushed by contact later
MAX_ROWS = 10_000_000  # of a history: some 5 GB
MAX_STEPS = 10_000_000_000  # of a run: more than a week of the smallest model


def divide(scene: Scene, model: Model, duration: float, substeps: int = 0) -> Steps:
    """Choose the time step so that whole steps fill each output interval, and how often to search for contact.

    A step is so many substeps, each of which is stable; those of the model's rates if 0.

    Raises:
        RequestError: motion in one step would be lost in the rounding of positions, or the history would have too many
            rows, or the run too many steps.
    """
    return divide_alike([(scene, model)], duration, substeps)


def divide_alike(parts: Sequence[tuple[Scene, Model]], duration: float, substeps: int = 0) -> Steps:
    """The steps of scenes that share them, as `divide` chooses them: the smallest of their steps, the most searches.

    Raises:
        RequestError: as in `divide`.
    """
    wanted = duration / parts[0][0].impact.output_interval
    if not wanted < MAX_ROWS:
        remedy = f"in {duration:g} s that gives {wanted:.3g} rows, a history holds {MAX_ROWS:,}; give a larger one"
        raise bad_value("ImpactPhase.output_interval", parts[0][0].impact.output_interval, remedy)
    intervals = max(1, round(wanted))
    interval = duration / intervals
    limits = [_limits(scene, model, interval, intervals) for scene, model in parts]
    stable, wanted_searches = min(limit[0] for limit in limits), max(limit[1] for limit in limits)
    searches = max(1, math.ceil(wanted_searches))
    apart = max(1, int(min(MOST_INTERVALS, 1.0 / (_LOOSE * wanted_searches)))) if wanted_searches > 0.0 else 1
    rates = parts[0][1].rates
    substeps = substeps or (rates.substeps if rates else 1)
    per_search = math.ceil(interval / searches / (stable * substeps))
    dt = interval / (searches * per_search)
    spare = wanted_searches * (apart / searches + dt / interval) <= 1.0
    return Steps(dt, per_search, searches, intervals, intervals_per_search=apart, spare=spare)


def coarser(steps: Steps, model: Model, rows: int, intervals: int, speed: float) -> Steps:
    """The same time step in intervals of so many `rows`, with searches for contact that a `speed` [m/s] needs."""
    needed = _searches(model, speed * rows * steps.interval, rows * steps.per_interval)
    most = rows * steps.searches
    joined = max(k for k in range(1, most + 1) if most % k == 0 and (k == 1 or most // k >= needed))
    return Steps(steps.dt, per_search=steps.per_search * joined, searches=most // joined, intervals=intervals)


def _searches(model: Model, way: float, steps: float) -> float:
    """Searches for contact in a time in which the fastest node moves this way [m], and in so many stable steps.

    At sharp edges there is one a step at most for the sake of nodes that these throw.
    """
    margins = [item.margin for item in model.passes if item.plane is None]
    if not margins:
        return 1.0
    wanted = way / (0.5 * min(margins))
    sharp = any(item.sides > 1 for item in model.passes)
    return max(SPEED_RESERVE * wanted, min(EDGE_RESERVE * wanted, steps) if sharp else 0.0)


def _limits(scene: Scene, model: Model, interval: float, intervals: int) -> tuple[float, float]:
    """Longest step [s] of a scene, and searches for contact in an output interval [s], fewer than 1 where few suffice.

    Raises:
        RequestError: as in `divide`.
    """
    stable = scene.impact.time_step_scale * model.stable.dt
    if not interval * intervals <= MAX_STEPS * stable:
        (body, element), share = model.owner(model.stable.element), model.stable.contact_share
        raise bad_value(
            "time step [s]",
            float(stable),
            f"{interval * intervals:g} s would take more than {MAX_STEPS:.0e} of them; it is time_step_scale = "
            f"{scene.impact.time_step_scale:g} of what element {element} of body {body} allows, {share:.0%} of it by "
            "contact springs; raise time_step_scale, enlarge that element, lower penalty or duration",
        )
    with np.errstate(over="ignore"):
        speed = max(float(np.linalg.norm(model.V, axis=1).max()), float(np.abs(model.V).max()))  # squares may be 0
    driven = max((float(np.abs(drive.velocity_table[1]).max()) for drive in scene.prescribed), default=0.0)
    driven = max([driven, *(float(np.abs(base.velocities).sum(axis=1).max()) for base in model.bases)])
    fastest = max(speed, driven) + float(np.linalg.norm(scene.gravity)) * interval * intervals
    far = float(np.abs(model.X).max())
    spacing = float(np.spacing(far))
    if 0.0 < speed * stable < 4.0 * spacing:
        lost = f"positions are rounded to {spacing:.2g} m and a step's motion of {speed * stable:.2g} m is lost"
        if far < 2.0 * float(np.ptp(model.X, axis=0).max()):  # nearer to the origin it would be no better
            raise bad_value("speed of the bodies", speed, f"{lost}; give a greater one, or start at rest")
        raise bad_value("Body.position", far, f"this far from the origin, {lost}; move the scene closer to the origin")
    with np.errstate(over="ignore"):
        apart = float(np.ptp(model.V, axis=0).max()) * stable
        fastest = max(fastest, float(np.linalg.norm(np.ptp(model.V, axis=0))))
    if apart > float(np.ptp(model.X, axis=0).max()):
        remedy = f"in a step some nodes would move {apart:.3g} m more than others; check the unit [m/s or rad/s]"
        raise bad_value("speed of the bodies", speed, remedy)
    most = interval / stable
    searches = _searches(model, fastest * interval, most)
    if any(item.plane is None for item in model.passes) and (pushed := load_speed(model, interval * intervals)):
        searches += min(_searches(model, pushed * interval, most), most)
    if not searches * intervals <= MAX_STEPS:
        remedy = f"so fast, a run would search for contact more than {MAX_STEPS:.0e} times; check the unit [m/s]"
        raise bad_value("speed of the bodies", max(float(np.abs(model.V).max()), driven), remedy)
    return stable, searches
