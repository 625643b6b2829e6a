"""Owns the choice of groups of elements that take steps of their own, by what steps cost on a device.

The costs are stored here and never measured in a run, so that runs repeat bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.model.own_steps import OwnSteps
from warp_mca.model.rates import Levels, follow, grouped
from warp_mca.phases.division import divide
from warp_mca.physics.contact.resting import undamped
from warp_mca.system.time_step import Rates

if TYPE_CHECKING:
    from warp_mca.model.build import Grouping
    from warp_mca.scene import Scene
    from warp_mca.system.model import Model

MOST = 8  # groups: steps differ by 2^7 then

MultiRate = int | str | None


@dataclass(frozen=True)
class StepCost:
    """What a step takes.

    Attributes:
        step: whatever is in it [s].
        element: for each element that it computes, nodes included [s].
        least: elements of a model below which one rate is quicker whatever the others say [-]: a GPU takes many steps
            of a small model in one launch.
        substep, element_beside: the same where elements take steps of their own; as with one rate if None.
    """

    step: float
    element: float
    least: int = 0
    substep: float | None = None
    element_beside: float | None = None

    def of(self, steps: int, elements: int, rated: bool = False) -> float:
        """Time that so many steps take, which compute so many elements together [s]; substeps if `rated`."""
        step = self.substep if rated and self.substep is not None else self.step
        element = self.element_beside if rated and self.element_beside is not None else self.element
        return step * steps + element * elements


# By a word of the device's name; `cuda` and `cpu` (one core) stand for all others. docs/decisions.md has the source.
COSTS = {
    "H100": StepCost(12e-6, 0.15e-9, 20_000, 8.2e-6, 0.23e-9),
    "H200": StepCost(12e-6, 0.15e-9, 20_000, 8.2e-6, 0.23e-9),
    "cuda": StepCost(13e-6, 0.3e-9, 20_000),
    "cpu": StepCost(40e-6, 1.4e-7),
}


def check_multi_rate(value: object) -> MultiRate:
    """The groups that the user asked for: a number, "auto", or None for one.

    Raises:
        RequestError: it is none of them.
    """
    if value is None:
        return None
    if isinstance(value, str) and value == "auto":
        return "auto"
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= MOST:
        remedy = f'give "auto" or a number of groups from 1 to {MOST}, or leave it out'
        raise bad_value("multi_rate", validate.brief(value), remedy)
    return value


def cost_of(device: str) -> StepCost:
    """What steps cost on a device, as "cpu" or "cuda:0"."""
    import warp as wp

    found = wp.get_device(device)
    if not found.is_cuda:
        return COSTS["cpu"]
    return next((cost for word, cost in COSTS.items() if word in found.name), COSTS["cuda"])


def grouping(scene: Scene, span: float, device: str, multi_rate: MultiRate) -> Grouping | None:
    """What sorts the elements of a scene's model by steps of their own, or None where all take the same.

    Args:
        scene: to run.
        span: of the impact phase [s].
        device: that it runs on.
        multi_rate: as `check_multi_rate` returns it.
    """
    if multi_rate is None or (multi_rate == "auto" and any("multi_rate" in load.refuses for load in scene.loads)):
        return None
    most = MOST if multi_rate == "auto" else int(multi_rate)

    def choose(model: Model, own: OwnSteps) -> Model:
        if multi_rate != "auto":  # the dashpots of bodies at rest, which the program added, take steps of one rate
            model = undamped(model, scene)
        damped = any(item.damping for item in model.passes)
        if most > 1 and (damped or scene.phases or model.fails):
            if multi_rate == "auto":
                return model
            what = "contact laws with a dashpot" if damped else "phases before the impact"
            what = "elements that may fail" if model.fails else what
            raise bad_value("multi_rate", multi_rate, f"{what} take steps of one rate; leave it out")
        if not model.element_count or (multi_rate == "auto" and model.element_count < cost_of(device).least):
            return model
        choices = list(_choices(scene, span, model, own, most))
        if not choices:
            return model
        chosen = choices[-1]
        if multi_rate == "auto":
            cost, count = cost_of(device), divide(scene, model, span).count
            chosen = min(choices, key=lambda choice: cost.of(choice.substeps, choice.elements, True))
            if cost.of(count, count * model.element_count) <= cost.of(chosen.substeps, chosen.elements, True):
                return model
        return grouped(model, chosen.level, chosen.rates)

    return choose


def rate_figures(rates: Rates, dt: float, steps: int, wall: Mapping[str, float]) -> dict[str, object]:
    """What `summary.json` says of rates, after so many steps of dt [s] in `wall` seconds by stage."""
    groups = [
        {"step": dt / (1 << (rates.top - level)), "elements": count} for level, count in enumerate(rates.elements)
    ]
    rate = rates.work * steps / wall["fe"] if wall.get("fe", 0.0) > 0.0 else None
    return {"multi_rate": len(groups), "rate_groups": groups, "element_steps_per_s": rate}


@dataclass(frozen=True)
class _Choice:
    """Rates that a run could take.

    Attributes:
        substeps: of the whole run.
        elements: computed in all of them.
        level, rates: as `follow` returns them.
    """

    substeps: int
    elements: int
    level: Levels
    rates: Rates


def _choices(scene: Scene, span: float, model: Model, own: OwnSteps, most: int) -> Iterator[_Choice]:
    """Two groups, three, and so on up to `most`, as far as there are elements for them."""
    for top in range(1, most):
        steps = divide(scene, model, span, 1 << top)
        base = steps.dt / (1 << top)
        level, rates = follow(
            model, own.levels(base / scene.impact.time_step_scale, top)[model.element_of[: model.element_count]]
        )
        if rates.top == top and rates.elements[0]:
            yield _Choice(steps.count << top, steps.count * rates.work, level, rates)
