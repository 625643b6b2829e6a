"""Owns the choice among variants that have been measured in scenes of the same family."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from warp_mca.accuracy.prediction import Expected, expected_errors
from warp_mca.accuracy.request import Accuracy
from warp_mca.accuracy.store import Family, Size
from warp_mca.accuracy.variant import Variant
from warp_mca.runs.rate_groups import StepCost

MARGIN = 0.8  # of what was asked that the expected errors of the most accurate variant may reach [-]


@dataclass(frozen=True)
class Choice:
    """A variant, and what is expected of it.

    Attributes:
        variant: to run.
        number: of the variant in its family.
        errors: expected, by figure; None where too few scenes tell.
        cost: of its steps, as stored for the device [s].
        spreads: as in `Family`.
    """

    variant: Variant
    number: int
    errors: Mapping[str, Expected | None]
    cost: float
    spreads: float = 1.0

    @property
    def likely(self) -> float:
        """The greatest expected size of an error [-]; infinite where one is not known."""
        return max((math.inf if error is None else error.size for error in self.errors.values()), default=math.inf)

    @property
    def greatest(self) -> float:
        """The greatest error that is allowed for [-]; infinite where one is not known."""
        bounds = [math.inf if error is None else error.bound(self.spreads) for error in self.errors.values()]
        return max(bounds, default=0.0)


def choices(
    family: Family, parameters: Mapping[str, object], asked: Accuracy, figures: Sequence[str], step: StepCost, cpu: bool
) -> list[Choice]:
    """Variants of a family that keep what the user typed, from the cheapest on; `step` is the cost of one.

    Bodies that must stay as they are take the same meshes without mass scaling, whose errors are smaller, and no other
    elements.
    """
    variants = [replace(item, mass_scaling=None) if asked.full else item for item in family.variants]
    found = [
        Choice(
            variant=variant,
            number=k,
            errors=expected_errors(family, parameters, k, figures),
            cost=cost_of(family.sizes[k], step, cpu),
            spreads=family.spreads,
        )
        for k, variant in enumerate(variants)
        if keeps(variant, asked) and family.sizes[k].steps > 0.0 and not (asked.full and variant.element)
    ]
    return sorted(found, key=lambda choice: choice.cost)


def cheapest(found: Sequence[Choice], share: float, scale: float) -> Choice | None:
    """The first of `found`, which are in the order of their costs, whose errors stay within a share.

    Where none does by all the spreads allowed for, the one with the least expected errors, if these leave a margin;
    `scale` is that of estimates. None where that is not so.
    """
    within = next((item for item in found if item.greatest <= share), None)
    if within is not None or not found:
        return within
    best = min(found, key=lambda item: item.likely)
    return best if max(scale, 1.0) * best.likely <= MARGIN * share else None


def keeps(variant: Variant, asked: Accuracy) -> bool:
    """Whether a variant leaves everything that was typed as it is."""
    return all(variant.knobs[name] == value for name, value in asked.typed.items() if name in variant.knobs)


def cost_of(size: Size, step: StepCost, cpu: bool) -> float:
    """Time of a variant's steps on a device [s]; on a CPU elements take steps of several rates."""
    computed = size.steps * size.elements * (size.computed if cpu else 1.0)
    return step.of(round(size.steps), round(computed))
