"""Owns what a run with an accuracy does: the model that was chosen, why, and the errors that are estimated after it."""

from __future__ import annotations

import logging
import shlex
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from warp_mca.accuracy.catalogued import source_of
from warp_mca.accuracy.choice import Choice, best, choices
from warp_mca.accuracy.figures import BOUND, figures_of, why_unsure
from warp_mca.accuracy.hinges import without_limit
from warp_mca.accuracy.pilots import Pilots, run_pilots
from warp_mca.accuracy.prediction import SMALL
from warp_mca.accuracy.request import Accuracy, accuracy_of
from warp_mca.accuracy.store import Family, family_of, no_limit_of
from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.base.log import LOGGER
from warp_mca.phases.rate_groups import cost_of
from warp_mca.scene import Scene
from warp_mca.scene.materials import Elastic

if TYPE_CHECKING:
    from warp_mca.results.result import Result

FIGURES = (*BOUND, "max_plastic_strain")  # of `accuracy.estimate` in summary.json
NAMES = {
    "F_n_first_peak": "first peak of F_n",
    "impulse": "impulse",
    "contact_duration": "contact duration",
    "max_plastic_strain": "greatest plastic strain",
}
OPEN = "still in contact at the end of the run; lengthen duration"
STRAIN = "it grows without bound at the edge of the contact as cells shrink"

MODEST = 1.5  # mass scaling that few models refuse
AT_END = ("contact_duration", "impulse")  # figures that depend on when a run ends in contact

Run = Callable[..., "Result"]  # a scene, and options of `warp_mca.run`


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The model of a scene that was chosen for an accuracy.

    Attributes:
        scene: as modelled.
        variant: what was chosen.
        asked: accuracy.
        why: it was chosen, in one sentence.
        reasons: figures that the accuracy does not bind, with the reason.
        expected: error of each bound figure of the family [-]; empty with pilots.
        pilots: coarse runs of the scene, or None.
        wall: that deciding took [s].
    """

    scene: Scene
    variant: Variant
    asked: Accuracy
    why: str
    reasons: Mapping[str, str]
    expected: Mapping[str, float] = field(default_factory=dict)
    pilots: Pilots | None = None
    wall: float = 0.0

    @property
    def ready(self) -> Result | None:
        """The result, if the finest pilot is accurate enough."""
        return self.pilots.result if self.pilots else None

    def judged(self, result: Result) -> Result:
        """The result with `accuracy` in its summary: estimated errors, what was chosen, and how to run it again."""
        found = figures_of(result)
        estimate = self.pilots.estimate(result) if self.pilots else self.expected
        share: dict[str, float | None] = dict.fromkeys(FIGURES)
        reasons = dict(self.reasons)
        if result.summary["contact_open_at_end"] and "contact_duration" not in reasons:
            reasons |= dict.fromkeys(AT_END[:1] if self.pilots else AT_END, OPEN)
        for name in FIGURES:
            value = estimate.get(name, "it was not measured")
            if name in reasons:
                continue
            if found[name] is None:
                unsure = why_unsure(result.F_n) if name == AT_END[0] else ""
                reasons[name] = unsure or "the run has no such figure"
            elif isinstance(value, str):
                reasons[name] = value
            else:
                share[name] = value
        precision, groups = result.summary["precision"], result.summary.get("multi_rate")
        accuracy = {
            "asked": self.asked.share,
            "estimate": share,
            "reasons": reasons,
            "chosen": {**self.variant.knobs, "multi_rate": groups, "precision": precision},
            "why": self.why,
            "deciding": self.wall,
            "command": command(self.scene, precision, groups, result.summary),
        }
        warnings = (*result.warnings, *self._missed(share, reasons))
        return replace(result, summary={**result.summary, "accuracy": accuracy}, warnings=warnings)

    def _missed(self, share: Mapping[str, float | None], reasons: Mapping[str, str]) -> Iterator[str]:
        """Warnings of figures that the accuracy binds, and whose error is larger by estimate, or that have none."""
        for name in (name for name in BOUND if name not in self.reasons):
            error, asked = share[name], f"accuracy {self.asked.share:.3g}"
            if error is None:
                yield f"{asked}: no error of the {NAMES[name]} is known, which may be larger: {reasons[name]}"
            elif error > self.asked.share:
                yield (
                    f"{asked}: the {NAMES[name]} is within {error:.1%} only, by estimate; ask for a smaller error "
                    "to have a finer mesh"
                )


def planned(
    scene: Scene,
    accuracy: float | str | Accuracy | None,
    typed: Mapping[str, object],
    device: str,
    meshes: object,
    run: Run,
) -> Plan | None:
    """Choose how to model a scene, and say so; None without an accuracy.

    Args:
        scene: as its user wrote it.
        accuracy: as `warp_mca.run` takes it.
        typed: options of the run that must stay, unless they are None.
        device: as "cpu" or "cuda:0".
        meshes: finished ones that the run is given, or None.
        run: makes coarse runs of the scene.

    Raises:
        RequestError: what is asked cannot be had, or contradicts what was typed.
    """
    if accuracy is None:
        return None
    begin, added = time.perf_counter(), scene.impact.mass_scaling
    asked = accuracy_of(accuracy).keeping(**typed).keeping(mass_scaling=added)
    _check(scene, asked, meshes is not None)
    reasons = {**without_limit(scene), **_without_strain(scene)}
    family = family_of(scene)
    reasons = {**no_limit_of(scene), **reasons}
    bound = [name for name in BOUND if name not in reasons]
    found = _from_family(family, scene, asked, reasons, bound, device) if family else None
    found = found or _from_pilots(scene, asked, reasons, bound, run)
    logger = logging.getLogger(LOGGER)
    logger.info("%s", f"accuracy {asked.share:.3g}: {found.why}")
    for name, why in found.reasons.items():
        logger.info("%s", f"accuracy {asked.share:.3g} does not bind the {NAMES[name]}: {why}")
    own = found.pilots.wall if found.pilots and found.ready else 0.0  # the pilot that is the run did not decide
    return replace(found, wall=time.perf_counter() - begin - own)


def run_planned(plan: Plan | None, carry_out: Callable[[Plan | None], Result]) -> Result:
    """Carry out a plan, with less mass scaling if its model would gain too much, which makes errors smaller.

    The added mass is known only when the model is built, after the decision.

    Raises:
        RequestError: the request cannot be carried out.
    """
    while True:
        try:
            return carry_out(plan)
        except RequestError as error:
            lighter = _lighter(plan, error) if plan else None
            if lighter is None:
                raise
            said = (
                f"accuracy {lighter.asked.share:.3g}: mass scaling {lighter.variant.mass_scaling or 'none'} ({error})"
            )
            logging.getLogger(LOGGER).info("%s", said)
            plan = lighter


def _lighter(plan: Plan, error: RequestError) -> Plan | None:
    """The plan with less mass scaling, if the error is a refusal of too much mass; else None."""
    variant = None if "mass_scaling" in plan.asked.typed else lighter(plan.variant, error)
    if variant is None:
        return None
    scene = replace(plan.scene, impact=replace(plan.scene.impact, mass_scaling=variant.mass_scaling))
    return replace(plan, variant=variant, scene=scene)


def lighter(variant: Variant, error: RequestError) -> Variant | None:
    """The variant with less mass scaling, if the error is a refusal of too much mass; else None."""
    asked = variant.mass_scaling
    if asked is None or not str(error).startswith("ImpactPhase.mass_scaling"):
        return None
    return replace(variant, mass_scaling=MODEST if isinstance(asked, float | int) and asked > MODEST else None)


def _check(scene: Scene, asked: Accuracy, finished_meshes: bool) -> None:
    if scene.t_end is not None:
        raise bad_value("Scene.t_end", scene.t_end, "an accuracy is that of one impact; leave one of the two out")
    fixed = [body.name for body in scene.bodies if not hasattr(body.geometry, "refined")]
    if fixed or finished_meshes:
        what = f"cells of {', '.join(fixed) or 'finished meshes'} cannot be made smaller or larger"
        raise bad_value("accuracy", asked.share, f"{what}; give recipes such as warp_mca.Rod, or leave accuracy out")
    if all(body.rigid for body in scene.bodies):
        what = "all bodies are rigid, whose forces have no limit as contact springs stiffen"
        raise bad_value("accuracy", asked.share, f"{what}; make one deformable, or leave it out")
    if not scene.contacts:
        raise bad_value("accuracy", asked.share, "it binds figures of contacts, and the scene has none; leave it out")


def _without_strain(scene: Scene) -> Mapping[str, str]:
    yields = any(bool(item.law) for body in scene.bodies for item in _materials(body.material))
    return {"max_plastic_strain": STRAIN if yields else "no body yields"}


def _materials(material: Elastic | Mapping[str, Elastic]) -> Sequence[Elastic]:
    return list(material.values()) if isinstance(material, Mapping) else [material]


def _from_family(
    family: Family, scene: Scene, asked: Accuracy, reasons: Mapping[str, str], bound: Sequence[str], device: str
) -> Plan | None:
    """A plan by measured scenes of the same family; None if no variant is accurate enough."""
    cpu = device.startswith("cpu")
    found = choices(family, scene.parameters, asked, bound, cost_of(device), cpu)
    chosen = best(found, asked.share)
    if chosen is None:
        return None
    variant = replace(chosen.variant, multi_rate=asked.typed.get("multi_rate", "auto"))  # pyright: ignore
    return Plan(
        scene=variant.applied(scene),
        variant=variant,
        asked=asked,
        why=_why(chosen, found, len(family.scenes), family.sizes[chosen.number].elements, asked.share),
        reasons=reasons,
        expected={name: error.estimate(SMALL * asked.share) for name, error in chosen.errors.items() if error},
    )


def _why(chosen: Choice, found: Sequence[Choice], scenes: int, elements: float, share: float) -> str:
    """One sentence: what is chosen among which variants, how probable it is to do, and the next cheaper one."""
    errors = ", ".join(f"{NAMES[name]} {error.size:.1%}" for name, error in chosen.errors.items() if error)
    cheaper = found[: found.index(chosen)]
    beside = f"; of the next cheaper one {cheaper[-1].chance(share):.0%}" if cheaper else ""
    return (
        f"refine {chosen.variant.refine:.3g} with {elements:,.0f} elements, by {scenes} scenes like this one and "
        f"{len(found)} variants; errors expected: {errors}; probability that all are within {share:.3g}: "
        f"{chosen.chance(share):.0%}{beside}"
    )


def _from_pilots(scene: Scene, asked: Accuracy, reasons: Mapping[str, str], bound: Sequence[str], run: Run) -> Plan:
    """A plan by coarse runs of the scene itself.

    Raises:
        RequestError: what is asked cannot be had, or contradicts what was typed.
    """
    found = run_pilots(scene, asked, bound, run)
    made = found.variant.applied(scene)
    return Plan(scene=made, variant=found.variant, asked=asked, why=found.why, reasons=reasons, pilots=found)


def command(scene: Scene, precision: str, groups: int | None, summary: Mapping[str, Any]) -> str | None:
    """The command that gives the run again without `--accuracy`; None for scenes that the catalogue does not have."""
    source = source_of(scene, options=True)
    if source is None:
        return None
    made, scale = source.build(scene.parameters), scene.impact.time_step_scale
    same = [body.element for body in scene.bodies] == [body.element for body in made.bodies]
    words = ["warp-mca", "run", scene.name]
    plain = source.resolve(None)
    for name, value in scene.parameters.items():
        if value != plain.get(name):
            words += ["--set", f"{name}={value}"]
    more = {
        "refine": scene.refine,
        "mass-scaling": scene.impact.mass_scaling,
        "multi-rate": groups,
        "precision": precision,
        "element": None if same else scene.bodies[0].element,
        "time-step-scale": scale if scale != made.impact.time_step_scale else None,
        "device": str(summary["device"]).split(" ")[0],
    }
    words += [word for name, value in more.items() if value is not None for word in (f"--{name}", str(value))]
    if abs(summary["simulated_time"] / scene.impact.duration - 1.0) > 1e-9:
        words += ["--duration", str(summary["simulated_time"])]
    return shlex.join(words)
