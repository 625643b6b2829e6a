"""Owns pilots: coarse runs of a scene itself, from which the mesh for an accuracy, and the error after it, follow.

With cells of size h = 1 / refine, a figure f errs by C h^p. Two pilots give C with the usual p of low-order elements at
edges of contacts; the run itself is the third value, which gives the order that is really there (`convergence`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from warp_mca.accuracy.catalogued import source_of
from warp_mca.accuracy.convergence import limit_of
from warp_mca.accuracy.figures import Figures, figures_of
from warp_mca.accuracy.request import Accuracy
from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import bad_value
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
    """

    variant: Variant
    why: str
    sizes: tuple[float, ...]
    figures: tuple[Figures, ...]
    resolution: float
    bound: tuple[str, ...]
    auto: bool
    result: Result | None = None

    def estimate(self, result: Result) -> Mapping[str, float | str]:
        """Error of each figure of the run [-], or why none can be told."""
        found = figures_of(result)
        sizes, runs = self.sizes, self.figures
        if self.result is None:
            assert self.variant.refine is not None
            sizes, runs = (*sizes, 1.0 / self.variant.refine), (*runs, found)
        lost = _spring_loss(result) if self.auto else 0.0
        shares: dict[str, float | str] = {}
        for name in self.bound:
            resolution = self.resolution if name == "contact_duration" else 0.0
            limit = limit_of(sizes, [run[name] for run in runs], resolution)
            value = found[name]
            if limit.value is None or value is None:
                shares[name] = f"it does not converge: {limit.why}"
            else:
                shares[name] = max(abs(value / limit.value - 1.0), 0.5 * (limit.left or 0.0)) + lost
        return shares


def run_pilots(scene: Scene, asked: Accuracy, bound: Sequence[str], run: Callable[..., Result]) -> Pilots:
    """Run two coarse models of a scene and choose the mesh and the penalty by them.

    Raises:
        RequestError: what is asked cannot be had, or contradicts what was typed.
    """
    typed = asked.typed.get("refine")
    base = float(typed) if isinstance(typed, int | float) else scene.refine
    start = Variant(refine=LEVELS[0] * base, multi_rate=asked.typed.get("multi_rate", "auto"))  # pyright: ignore
    first = _pilot(scene, start, run)
    stiffer = _stiffer(scene, asked, first)
    if stiffer is not None:
        start = replace(start, **stiffer)
        first = _pilot(scene, start, run)
    second_variant = replace(start, refine=LEVELS[1] * base)
    second = _pilot(scene, second_variant, run)
    known = figures_of(first), figures_of(second)
    if all(known[1][name] is None for name in bound):
        raise bad_value("accuracy", asked.share, "a coarse run of the scene has no contact force that it could bind")
    auto = any(contact.penalty == "auto" for contact in start.applied(scene).contacts)
    lost = _spring_loss(second) if auto else 0.0
    errors = {name: error for name in bound if (error := _foreseen(known[0][name], known[1][name])) is not None}
    level = _level(asked, errors, lost, typed is not None, second)
    worst = max(errors, key=lambda name: errors[name], default="")
    at = f" after coarse runs that leave {errors[worst]:.1%} in {worst}" if worst else ""
    variant = replace(start, refine=level * base)
    springs = f", penalty {penalty_of(start):g}" if stiffer else ""
    return Pilots(
        variant=variant,
        why=f"refine {level * base:.3g}{springs}{at}",
        sizes=tuple(1.0 / (level * base) for level in LEVELS),
        figures=known,
        resolution=scene.impact.output_interval,
        bound=tuple(bound),
        auto=auto,
        result=second if level == LEVELS[1] else None,
    )


def _pilot(scene: Scene, variant: Variant, run: Callable[..., Result]) -> Result:
    return run(variant.applied(scene), **variant.options)


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


def penalty_of(variant: Variant) -> float:
    """The penalty that a variant sets."""
    return float(variant.knobs["penalty"])


def _foreseen(first: float | None, second: float | None) -> float | None:
    """Error of a figure of the second pilot [-]; None where either has none."""
    if first is None or not second:
        return None
    return abs(first / second - 1.0) / ((LEVELS[1] / LEVELS[0]) ** ORDER - 1.0)


def _level(asked: Accuracy, errors: Mapping[str, float], lost: float, fixed: bool, second: Result) -> float:
    """Refine of the run over that of the scene [-].

    Args:
        asked: accuracy.
        errors: foreseen of the second pilot's figures [-].
        lost: that springs give away whatever the mesh [-].
        fixed: the user typed the scene's refine.
        second: that pilot.

    Raises:
        RequestError: no mesh is fine enough.
    """
    allowed, error = MARGIN * asked.share - lost, max(errors.values(), default=0.0)
    coarse = LEVELS[1]
    if fixed:
        left = error * coarse**ORDER + lost
        if left > asked.share:
            remedy = f"this mesh leaves about {left:.1%} by coarse runs of the scene; leave refine out, or ask for that"
            raise bad_value("accuracy", asked.share, remedy)
        return 1.0
    if error <= allowed:
        return coarse
    wanted = coarse * (error / allowed) ** (1.0 / ORDER) if allowed > 0.0 else math.inf
    level = LEAST if wanted <= LEAST else LEAST * STEP ** math.ceil(math.log(wanted / LEAST, STEP) - 1e-9)
    if level <= MOST:
        return level
    best = error * (coarse / MOST) ** ORDER / MARGIN + lost
    steps = second.summary["n_elements"] * second.summary["n_steps"] * (MOST / coarse) ** 4
    remedy = f"about {best:.1%} can be had with refine {MOST:g} times the scene's, for some {steps:.1e} element-steps"
    raise bad_value("accuracy", asked.share, f"{remedy}; ask for no less, or refine the scene where bodies touch")
