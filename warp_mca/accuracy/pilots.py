"""Owns pilots: coarse runs of a scene itself, from which the mesh for an accuracy, and the error after it, follow.

With cells of size h = 1 / refine, a figure f errs by C h^p. Two pilots give C with the usual p of low-order elements at
edges of contacts; the run itself is the third value, which gives the order that is really there (`convergence`). Two
values cannot reveal a series without a limit, so the second pilot serves as the run only if its estimated error is much
smaller than asked.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from warp_mca.accuracy.catalogued import source_of
from warp_mca.accuracy.convergence import STEADY, limit_of
from warp_mca.accuracy.figures import Figures, figures_of
from warp_mca.accuracy.refinements import ANOTHER, Refinements
from warp_mca.accuracy.request import Accuracy
from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import GuardError, bad_value
from warp_mca.scene import Scene

if TYPE_CHECKING:
    from warp_mca.results.result import Result

COARSE = 0.45, 0.3, 1.0  # refine of the first pilot over that of the scene: wanted, least, most [-]
NEXT = 1.42, 1.3, 2.2  # of the second over that of the first; the first takes a fourth of its time [-]
BELOW = 0.8  # of the second over that of a scene whose refine was typed, at most [-]
STEP = 2.0**0.25  # between meshes that are considered [-]: a factor of two in time
TRIES = 3  # refinements at which the first pilot is tried, where guards stop it
MOST = 4.0  # greatest refine over that of the scene [-]
ORDER = 1.5  # assumed before the run [-]
SURE = 0.4  # of what was asked that may be left of the second pilot, for it to be the run [-]
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
        refinements: meshes of the scene, with refine 1 as their base.
        sizes: of the pilots' cells over those of the scene, as meshed [-].
        figures: of each pilot.
        resolution: of the contact duration: the output interval [s].
        bound: figures that must be accurate.
        auto: penalties are chosen by the mesh, so that the loss in springs does not shrink with the cells.
        result: of the last pilot, where that is the run.
        wall: that this pilot took [s].
    """

    variant: Variant
    why: str
    refinements: Refinements
    sizes: tuple[float, ...]
    figures: tuple[Figures, ...]
    resolution: float
    bound: tuple[str, ...]
    auto: bool
    result: Result | None = None
    wall: float = 0.0

    def estimate(self, result: Result) -> Mapping[str, float | str]:
        """Estimated error of each figure of the run [-], or the reason why there is no estimate."""
        found = figures_of(result)
        sizes, runs = self.sizes, self.figures
        if self.result is None:
            assert self.variant.refine is not None
            sizes, runs = (*sizes, 1.0 / self.refinements.meshed(self.variant.refine)), (*runs, found)
        lost = _spring_loss(result)
        return {
            name: self._error([run[name] for run in runs], sizes, name, lost * (IMPULSE if name == "impulse" else 1.0))
            for name in self.bound
        }

    def _error(self, values: Sequence[float | None], sizes: Sequence[float], name: str, lost: float) -> float | str:
        """Estimated error of the last value [-], or the reason why there is none; `lost` is the loss in springs [-]."""
        if any(coarse < ANOTHER * fine for coarse, fine in pairwise(sizes)):
            return "meshes of other density are nearly the same, for bodies have few cells; make more"
        resolution = self.resolution if name == "contact_duration" else 0.0
        limit, value = limit_of(sizes, values, resolution), values[-1]
        if limit.value is None or value is None:
            return f"it does not converge: {limit.why}"
        left = limit.left or 0.0
        if len(values) > 2 and limit.order is None and left - resolution / abs(limit.value) > STEADY:
            return f"it does not converge: its changes with the mesh, {left:.1%}, show no order"
        error = max(abs(value / limit.value - 1.0), left if limit.order is None else 0.5 * left)
        return error + lost if self.auto else max(error, lost)


def run_pilots(scene: Scene, asked: Accuracy, bound: Sequence[str], run: Callable[..., Result]) -> Pilots:
    """Run two coarse models of a scene and choose the mesh and the penalty by them.

    Raises:
        RequestError: what is asked cannot be had, or contradicts what was typed.
        GuardError: a guard stopped a coarse run.
    """
    typed = asked.typed.get("refine")
    base = scene.refine if typed is None else float(typed)  # pyright: ignore[reportArgumentType]
    refinements, plain = Refinements(scene, base), Refinements(scene, 1.0)
    coarse, start, first = _first(scene, asked, refinements, typed is not None, run)
    ratio, least, most = NEXT
    most = BELOW if typed is not None else most * coarse
    refinement = refinements.near(ratio * coarse, least * coarse, most, None if typed is not None else coarse)
    sizes = tuple(1.0 / plain.meshed(found * base) for found in (coarse, refinement))
    if sizes[0] < ANOTHER * sizes[1]:
        remedy = "two meshes coarser than that are nearly the same, for bodies have few cells; make more"
        if typed is not None:
            raise bad_value("refine", typed, f"{remedy}, or leave it out")
        raise bad_value("accuracy", asked.share, remedy)
    begin = time.perf_counter()
    second = _pilot(scene, replace(start, refine=refinement * base), run)
    wall = time.perf_counter() - begin
    known = figures_of(first), figures_of(second)
    if all(known[1][name] is None for name in bound):
        remedy = "it binds figures of contacts, and in a coarse run of the scene none has a force; leave it out"
        raise bad_value("accuracy", asked.share, remedy)
    auto = any(contact.penalty == "auto" for contact in start.applied(scene).contacts)
    springs = Springs(_spring_loss(second), auto, refinement)
    foreseen = {name: _foreseen(known[0][name], known[1][name], sizes[0] / sizes[1]) for name in bound}
    errors = {name: error for name, error in foreseen.items() if error is not None}
    worst = max(errors, key=lambda name: errors[name], default="")
    chosen = _refinement(asked, (worst, errors.get(worst, 0.0)), springs, refinements, typed is not None, second)
    at = f" after coarse runs that leave {errors[worst]:.1%} in {worst}" if worst else ""
    variant = replace(start, refine=chosen * base)
    stiff = f", penalty {start.knobs['penalty']:g}" if "penalty" in start.knobs else ""
    return Pilots(
        variant=variant,
        why=f"refine {chosen * base:.3g}{stiff}{at}",
        refinements=plain,
        sizes=sizes,
        figures=known,
        resolution=scene.impact.output_interval,
        bound=tuple(bound),
        auto=auto,
        result=second if chosen == refinement else None,
        wall=wall,
    )


def _first(
    scene: Scene, asked: Accuracy, refinements: Refinements, fixed: bool, run: Callable[..., Result]
) -> tuple[float, Variant, Result]:
    """Level, model and result of the first pilot: the coarsest that no guard stops.

    Raises:
        GuardError: guards stop all that are tried.
    """
    wanted, least, most = COARSE
    most = BELOW / NEXT[1] if fixed else most
    left = 1 if fixed else TRIES
    while True:
        refinement = refinements.near(wanted, least, most)
        start = Variant(refine=refinement * refinements.base, multi_rate=asked.typed.get("multi_rate", "auto"))  # pyright: ignore
        left -= 1
        try:
            return refinement, *_with_springs(scene, asked, start, run)
        except GuardError:
            if not left:
                raise
        wanted, least, most = (ratio * refinement for ratio in NEXT)


def _with_springs(scene: Scene, asked: Accuracy, start: Variant, run: Callable[..., Result]) -> tuple[Variant, Result]:
    """The model and the result of the first pilot: with contact springs as stiff as the accuracy needs.

    If a guard stops it with these springs, the scene keeps its own, whose loss then asks for a finer mesh.
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
        refinement: of the second pilot, its refine over that of the scene [-].
    """

    lost: float
    auto: bool
    refinement: float

    def left(self, refinement: float) -> float:
        """What is lost with another refine over that of the scene [-]."""
        return self.lost if self.auto else self.lost * (self.refinement / refinement) ** SHRINKS


def _spring_loss(result: Result) -> float:
    """Estimated loss of the greatest force in contact springs [-]."""
    losses = result.summary["contact_spring_loss"].values()
    return max((-loss for loss in losses if loss is not None), default=0.0)


def _stiffer(scene: Scene, asked: Accuracy, first: Result) -> Mapping[str, Any] | None:
    """Settings that make contact springs stiff enough for the accuracy; None if they are, or must stay."""
    (penalty, *others) = {contact.penalty for contact in scene.contacts}
    lost, allowed = _spring_loss(first), SPRINGS * asked.share
    if others or "penalty" in asked.typed or not isinstance(penalty, float | int) or lost <= allowed:
        return None
    wanted = float(f"{min(penalty * lost / allowed, max(STIFFEST, penalty)):.2g}")
    if wanted <= penalty:
        return None
    source = source_of(scene, options=True)
    by_name = source is not None and "penalty" in source.parameters
    return {"parameters": {"penalty": wanted}} if by_name else {"penalty": wanted}


def _foreseen(first: float | None, second: float | None, ratio: float) -> float | None:
    """Error of a figure of the second pilot [-], whose cells are smaller by a ratio; None where either has none."""
    if first is None or not second:
        return None
    return abs(first / second - 1.0) / (max(ratio, NEXT[1]) ** ORDER - 1.0)


def _refinement(
    asked: Accuracy, worst: tuple[str, float], springs: Springs, refinements: Refinements, fixed: bool, second: Result
) -> float:
    """Refine of the run over that of the scene [-]: the first refinement whose error stays within what was asked.

    Args:
        asked: accuracy.
        worst: figure of the second pilot, and the error that is foreseen of it [-].
        springs: of its contacts.
        refinements: meshes of the scene.
        fixed: the user typed the scene's refine.
        second: that pilot.

    Raises:
        RequestError: no mesh is fine enough.
    """
    coarse, (figure, error) = springs.refinement, worst

    def left(refinement: float) -> float:
        return (error * (coarse / refinement) ** ORDER + springs.left(refinement)) / MARGIN

    if fixed:
        if left(1.0) <= asked.share:
            return 1.0
        remedy = (
            f"this mesh leaves about {_above(left(1.0))} by coarse runs of the scene; leave it out, or ask for that"
        )
        raise bad_value("refine", asked.typed["refine"], remedy)
    if left(coarse) <= SURE * asked.share:
        return coarse
    found = refinements.finer(coarse, STEP, max(MOST, NEXT[2] * coarse))
    for refinement in found:
        if left(refinement) <= asked.share:
            return refinement
    finest = found[-1]
    if "penalty" in asked.typed and springs.left(finest) > 0.5 * MARGIN * left(finest):
        remedy = f"springs of this penalty give away about {springs.left(1.0):.1%}; leave it out, or give a larger one"
        raise bad_value("penalty", asked.typed["penalty"], remedy)
    steps = second.summary["n_elements"] * second.summary["n_steps"] * (finest / coarse) ** 4
    # An accuracy that is easier to have leaves contact springs softer.
    had = max(left(finest), (left(finest) * MARGIN - springs.left(finest)) / (MARGIN - SPRINGS))
    where = f" in {figure}" if figure else ""
    remedy = f"about {_above(had)} can be had{where}, with refine {finest * refinements.base:.3g} in some {steps:.1e}"
    remedy += " element-steps; ask for no less, or refine the scene where bodies touch"
    raise bad_value("accuracy", asked.share, remedy)


def _above(share: float) -> str:
    """A share in percent that is not below it, in two digits."""
    size = 10.0 ** (math.floor(math.log10(share)) - 1)
    return f"{100.0 * size * math.ceil(share / size - 1e-9):.3g}%"
