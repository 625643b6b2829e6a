"""Owns the choice among variants that have been measured in scenes of the same family."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

from warp_mca.accuracy.prediction import Expected, expected_errors, is_close
from warp_mca.accuracy.request import Accuracy
from warp_mca.accuracy.store import Family, Size
from warp_mca.accuracy.variant import Variant
from warp_mca.phases.rate_groups import StepCost

# Probabilities, weighed by scenes of the store that are left out in turn (docs/measurements/accuracy.md):
LEAST = 0.84  # that all errors are within what was asked; a variant below it is not chosen [-]
WORTH = 0.2  # what twice the cost must add to it [-]
REGRET = 0.4  # weight of the probability that no variant of less than half the cost would do [-]


@dataclass(frozen=True)
class Choice:
    """A variant, and what is expected of it.

    Attributes:
        variant: to run.
        number: of the variant in its family.
        errors: expected, by figure; None where too few scenes tell.
        cost: of its steps, as stored for the device [s].
    """

    variant: Variant
    number: int
    errors: Mapping[str, Expected | None]
    cost: float

    def chance(self, share: float) -> float:
        """Probability that all errors are within a share [-]; 0 where one is not known."""
        return math.prod(0.0 if error is None else error.within(share) for error in self.errors.values())


def choices(
    family: Family, parameters: Mapping[str, object], asked: Accuracy, figures: Sequence[str], step: StepCost, cpu: bool
) -> list[Choice]:
    """Variants of a family that keep what the user typed, from the cheapest on; `step` is the cost of one.

    Bodies that must stay as they are take the same meshes without mass scaling, whose errors are smaller, and no other
    elements. Of a scene unlike all that were measured there are none.
    """
    if not is_close(family, parameters):
        return []
    variants = [replace(item, mass_scaling=None) if asked.full else item for item in family.variants]
    found = [
        Choice(
            variant=variant,
            number=k,
            errors=expected_errors(family, parameters, k, figures),
            cost=cost_of(family.sizes[k], step, cpu),
        )
        for k, variant in enumerate(variants)
        if keeps(variant, asked) and family.sizes[k].steps > 0.0 and not (asked.full and variant.element)
    ]
    return sorted(found, key=lambda choice: choice.cost)


def best(found: Sequence[Choice], share: float) -> Choice | None:
    """The choice with the best balance of accuracy and cost; None where no errors are probably within the share.

    It has the greatest P(within) + REGRET P(no variant of less than half the cost is within) - WORTH log2(cost).

    Args:
        found: choices, from the cheapest on.
        share: that is asked for [-].
    """
    chances = [item.chance(share) for item in found]
    likely = [k for k, chance in enumerate(chances) if chance >= LEAST]

    def balance(k: int) -> float:
        cost = found[k].cost
        halves = takewhile(lambda pair: 2.0 * pair[0].cost < cost, zip(found, chances, strict=True))
        none = math.prod(1.0 - chance for _, chance in halves)
        return chances[k] + REGRET * none - WORTH * math.log2(cost)

    return found[max(likely, key=balance)] if likely else None


def keeps(variant: Variant, asked: Accuracy) -> bool:
    """Whether a variant leaves everything that was typed as it is; without mass added it tells nothing of some."""
    knobs = {"mass_scaling": None, **variant.knobs}
    return all(knobs[name] == value for name, value in asked.typed.items() if name in knobs)


def cost_of(size: Size, step: StepCost, cpu: bool) -> float:
    """Time of a variant's steps on a device [s]; on a CPU elements take steps of several rates."""
    computed = size.steps * size.elements * (size.computed if cpu else 1.0)
    return step.of(round(size.steps), round(computed))
