"""Owns pilots: coarse runs of a scene itself, from which the mesh for an accuracy, and the error after it, follow.

With cells of size h = 1 / refine, a figure f errs by C h^p. Two pilots give C with the usual p of low-order elements at
edges of contacts; the run itself is the third value, which gives the order that is really there (`convergence`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from warp_mca.accuracy.catalogued import source_of
from warp_mca.accuracy.convergence import limit_of
from warp_mca.accuracy.figures import Figures, figures_of
from warp_mca.accuracy.request import Accuracy
from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import GuardError, bad_value
from warp_mca.runs.spring_share import PEAK_LOSS
from warp_mca.scene import Scene

if TYPE_CHECKING:
    from warp_mca.results.result import Result

LEVELS = (0.45, 0.64)  # of the pilots' refine over that of the scene; both take a sixth of a run that is as fine [-]
LEAST = 0.9  # of a run that is finer than its pilots; below, these would take more than a fifth of the time [-]
STEP = 2.0**0.25  # between meshes that are considered [-]: a factor of two in time
MOST = 4.0  # greatest refine over that of the scene [-]
ORDER = 1.5  # assumed before the run [-]
MARGIN = 0.8  # of what was asked that an error foreseen may reach [-]
SPRINGS = 0.3  # of what was asked that contact springs may give away [-]
STIFFEST = 30.0  # penalty [-]
IMPULSE = 0.5  # what springs take from the impulse over what they take from peak and duration, on `two_link` [-]
SHRINKS = 0.6  # power of the size of cells with which the share of springs goes, measured on `two_link` [-]


@dataclass(frozen=True)
class Pilots:
    """Coarse runs, and what follows from them.

    Attributes:
        variant: chosen.
        why: in one sentence.
        sizes: of the pilots' cells over those of the scene [-].
        figures: of each pilot.
        resolution: of the contact duration: the output interval [s].
        bound: figures that must be accurate.
        auto: penalties are chosen by the mesh, so that what springs give away does not shrink with the cells.
        result: of the last pilot, where that is chosen.
        wall: that this pilot took [s].
    """

    variant: Variant
    why: str
    sizes: tuple[float, ...]
    figures: tuple[Figures, ...]
    resolution: float
    bound: tuple[str, ...]
    auto: bool
    result: Result | None = None
    wall: float = 0.0

    def estimate(self, result: Result) -> Mapping[str, float | str]:
        """Error of each figure of the run [-], or why none can be told."""
        found = figures_of(result)
        sizes, runs = self.sizes, self.figures
        if self.result is None:
            assert self.variant.refine is not None
            sizes, runs = (*sizes, 1.0 / self.variant.refine), (*runs, found)
        lost = _spring_loss(result)
        shares: dict[str, float | str] = {}
        for name in self.bound:
            resolution = self.resolution if name == "contact_duration" else 0.0
            limit = limit_of(sizes, [run[name] for run in runs], resolution)
            value = found[name]
            if limit.value is None or value is None:
                shares[name] = f"it does not converge: {limit.why}"
            else:
                error = max(abs(value / limit.value - 1.0), 0.5 * (limit.left or 0.0))
                own = lost * (IMPULSE if name == "impulse" else 1.0)
                shares[name] = error + own if self.auto else max(error, own)
        return shares


def run_pilots(scene: Scene, asked: Accuracy, bound: Sequence[str], run: Callable[..., Result]) -> Pilots:
    """Run two coarse models of a scene and choose the mesh and the penalty by them.

    Raises:
        RequestError: what is asked cannot be had, or contradicts what was typed.
        GuardError: a guard stopped a coarse run.
    """
    typed = asked.typed.get("refine")
    base = float(typed) if isinstance(typed, int | float) else scene.refine
    start = Variant(refine=LEVELS[0] * base, multi_rate=asked.typed.get("multi_rate", "auto"))  # pyright: ignore
    start, first = _with_springs(scene, asked, start, run)
    begin = time.perf_counter()
    second = _pilot(scene, replace(start, refine=LEVELS[1] * base), run)
    wall = time.perf_counter() - begin
    known = figures_of(first), figures_of(second)
    if all(known[1][name] is None for name in bound):
        raise bad_value("accuracy", asked.share, "a coarse run of the scene has no contact force that it could bind")
    auto = any(contact.penalty == "auto" for contact in start.applied(scene).contacts)
    springs = Springs(_spring_loss(second), auto)
    errors = {name: error for name in bound if (error := _foreseen(known[0][name], known[1][name])) is not None}
    level = _level(asked, errors, springs, typed is not None, second)
    worst = max(errors, key=lambda name: errors[name], default="")
    at = f" after coarse runs that leave {errors[worst]:.1%} in {worst}" if worst else ""
    variant = replace(start, refine=level * base)
    stiff = f", penalty {start.knobs['penalty']:g}" if "penalty" in start.knobs else ""
    return Pilots(
        variant=variant,
        why=f"refine {level * base:.3g}{stiff}{at}",
        sizes=tuple(1.0 / (level * base) for level in LEVELS),
        figures=known,
        resolution=scene.impact.output_interval,
        bound=tuple(bound),
        auto=auto,
        result=second if level == LEVELS[1] else None,
        wall=wall,
    )


def _with_springs(scene: Scene, asked: Accuracy, start: Variant, run: Callable[..., Result]) -> tuple[Variant, Result]:
    """The first pilot, and the model that it had: with contact springs as stiff as the accuracy needs.

    Where a guard stops it with these, the scene keeps its own; what they give away then asks for a finer mesh.
    """
    first = _pilot(scene, start, run)
    stiffer = _stiffer(scene, asked, first)
    if stiffer is not None:
        with suppress(GuardError):
            stiff = replace(start, **stiffer)
            return stiff, _pilot(scene, stiff, run)
    return start, first


def _pilot(scene: Scene, variant: Variant, run: Callable[..., Result]) -> Result:
    """A coarse run.

    Raises:
        GuardError: a guard stopped it; the words say that it was not yet the run that was asked for.
    """
    try:
        return run(variant.applied(scene), **variant.options)
    except GuardError as error:
        raise GuardError(f"a coarse run (refine {variant.refine:.3g}) by which --accuracy chooses: {error}") from error


@dataclass(frozen=True)
class Springs:
    """Contact springs of the second pilot.

    Attributes:
        lost: of the greatest force [-], by estimate.
        auto: the mesh chooses their penalty, so that the loss stays; otherwise they are softer in larger cells.
    """

    lost: float
    auto: bool

    def left(self, level: float) -> float:
        """What is lost with another refine over that of the scene [-]."""
        return self.lost if self.auto else self.lost * (LEVELS[1] / level) ** SHRINKS


def _spring_loss(result: Result) -> float:
    """What contact springs gave away of the greatest force [-], by estimate."""
    shares = result.summary["contact_spring_share"].values()
    return PEAK_LOSS * max((share for share in shares if share is not None), default=0.0)


def _stiffer(scene: Scene, asked: Accuracy, first: Result) -> Mapping[str, Any] | None:
    """What gives contact springs the stiffness that the accuracy needs, or None where they have it, or must stay."""
    (penalty, *others) = {contact.penalty for contact in scene.contacts}
    lost, allowed = _spring_loss(first), SPRINGS * asked.share
    if others or "penalty" in asked.typed or not isinstance(penalty, float | int) or lost <= allowed:
        return None
    wanted = float(f"{min(penalty * lost / allowed, max(STIFFEST, penalty)):.2g}")
    if wanted <= penalty:
        return None
    source = source_of(scene)
    by_name = source is not None and "penalty" in source.parameters
    return {"parameters": {"penalty": wanted}} if by_name else {"penalty": wanted}


def _foreseen(first: float | None, second: float | None) -> float | None:
    """Error of a figure of the second pilot [-]; None where either has none."""
    if first is None or not second:
        return None
    return abs(first / second - 1.0) / ((LEVELS[1] / LEVELS[0]) ** ORDER - 1.0)


def _level(asked: Accuracy, errors: Mapping[str, float], springs: Springs, fixed: bool, second: Result) -> float:
    """Refine of the run over that of the scene [-]: the first level whose error stays within what was asked.

    Args:
        asked: accuracy.
        errors: foreseen of the second pilot's figures [-].
        springs: of its contacts.
        fixed: the user typed the scene's refine.
        second: that pilot.

    Raises:
        RequestError: no mesh is fine enough.
    """
    coarse, error = LEVELS[1], max(errors.values(), default=0.0)

    def left(level: float) -> float:
        return error * (coarse / level) ** ORDER + springs.left(level)

    if fixed:
        if left(1.0) <= MARGIN * asked.share:
            return 1.0
        had = f"{left(1.0) / MARGIN:.1%}"
        remedy = f"this mesh leaves about {had} by coarse runs of the scene; leave it out, or ask for that"
        raise bad_value("refine", asked.typed["refine"], remedy)
    count = math.floor(math.log(MOST / LEAST, STEP) + 1e-9)
    levels = [coarse, *(LEAST * STEP**k for k in range(count + 1))]
    for level in levels:
        if left(level) <= MARGIN * asked.share:
            return level
    if "penalty" in asked.typed and springs.left(MOST) > 0.5 * left(MOST):
        remedy = f"springs of this penalty give away about {springs.left(1.0):.1%}; leave it out, or give a larger one"
        raise bad_value("penalty", asked.typed["penalty"], remedy)
    steps = second.summary["n_elements"] * second.summary["n_steps"] * (MOST / coarse) ** 4
    remedy = f"about {left(MOST) / MARGIN:.1%} can be had, with refine {MOST:g} times the scene's in some {steps:.1e}"
    remedy += " element-steps; ask for no less, or refine the scene where bodies touch"
    raise bad_value("accuracy", asked.share, remedy)
