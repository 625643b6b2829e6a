"""Owns how good choices of `--accuracy` are for the scenes of the store, each foreseen from the others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean, median
from typing import Any

from benchmarks.accuracy_judge import right, told, worst
from warp_mca.accuracy.choice import Choice, best, choices, cost_of
from warp_mca.accuracy.figures import BOUND
from warp_mca.accuracy.prediction import SMALL
from warp_mca.accuracy.request import Accuracy
from warp_mca.accuracy.store import Family, Measured, family_from
from warp_mca.phases.rate_groups import COSTS

COARSE, FINE = 0.05, 0.02  # shares that are asked for
DEVICES = ("H100", "cpu")  # whose costs choices are made by


@dataclass(frozen=True)
class Trial:
    """A scene that was left out, with what the others foresee for each of its variants, and what was measured."""

    found: Sequence[Choice]
    scene: Measured

    def on(self, device: str, family: Family) -> Trial:
        """The same with what steps cost on a device."""
        costs = [cost_of(family.sizes[item.number], COSTS[device], device == "cpu") for item in self.found]
        found = [replace(item, cost=cost) for item, cost in zip(self.found, costs, strict=True)]
        return replace(self, found=sorted(found, key=lambda item: item.cost))

    def chosen(self, asked: float) -> Choice | None:
        """The variant that a run would take; None if none will do, or no figure of it is bound."""
        choice = best(self._tried(), asked)
        return choice if choice is not None and self._true(choice, asked) else None

    def dearer(self, choice: Choice, asked: float) -> float | None:
        """Cost of a choice over that of the cheapest variant within, as in `accuracy_judge`; None if none is."""
        needed = self._true(choice, asked).keys()
        found = [(item, self._true(item, math.inf)) for item in self._tried()]
        within = [item for item, errors in found if needed <= errors.keys() and worst(errors.values()) <= asked]
        return choice.cost / within[0].cost if within else None

    def worst(self, choice: Choice, asked: float) -> float:
        """Greatest true error of a choice [-]."""
        return worst(self._true(choice, asked).values())

    def marks(self, choice: Choice, asked: float) -> list[bool]:
        """Whether its estimates are right, as in `accuracy_judge`."""
        true = self._true(choice, asked)
        return [
            right(own.estimate(SMALL * asked), true[name], asked)
            for name, own in choice.errors.items()
            if own and name in true
        ]

    def _tried(self) -> list[Choice]:
        return [item for item in self.found if item.number in self.scene.errors]

    def _true(self, choice: Choice, asked: float) -> dict[str, float]:
        """True errors of the figures that the reference can tell [-]."""
        errors = self.scene.errors[choice.number]
        pairs = [(name, errors[name]) for name in choice.errors if told(self.scene.left.get(name), asked)]
        return {name: error for name, error in pairs if error is not None}


def left_out(name: str, data: Mapping[str, Any]) -> list[dict[str, Any]]:
    """How good choices of 2 % and 5 % are for each scene of a family of the store, by what steps cost on each device.

    Numbers of cases:

    `chosen` of `cases` found a variant; of these `within` what was asked, and `twice`, within twice that; `right` of
    `estimates`; `cheap` cost at most twice the cheapest variant within, where there is one (`beside`). `median` is the
    middle of these costs [-], `ratio` the mean cost of 5 % over that of 2 % [-]; None where there is none.
    """
    family = family_from(name, data)
    trials = [_trial(family, k) for k in range(len(family.scenes))]
    return [
        {"family": name, "device": word, **_counts([trial.on(word, family) for trial in trials])} for word in DEVICES
    ]


def _counts(trials: Sequence[Trial]) -> dict[str, Any]:
    """As `left_out`, of one device."""
    pairs = [(trial, asked, trial.chosen(asked)) for trial in trials for asked in (FINE, COARSE)]
    made = [(trial, asked, choice) for trial, asked, choice in pairs if choice is not None]
    shares = [trial.worst(choice, asked) / asked for trial, asked, choice in made]
    beside = [ratio for trial, asked, choice in made if (ratio := trial.dearer(choice, asked)) is not None]
    marks = [mark for trial, asked, choice in made for mark in trial.marks(choice, asked)]
    both = [
        coarse.cost / fine.cost
        for (_, _, fine), (_, _, coarse) in zip(pairs[::2], pairs[1::2], strict=True)
        if fine and coarse
    ]
    return {
        "scenes": len(trials),
        "cases": len(pairs),
        "chosen": len(made),
        "within": sum(item <= 1.0 for item in shares),
        "twice": sum(item <= 2.0 for item in shares),
        "right": sum(marks),
        "estimates": len(marks),
        "cheap": sum(item <= 2.0 for item in beside),
        "beside": len(beside),
        "median": round(median(beside), 3) if beside else None,
        "ratio": round(fmean(both), 3) if both else None,
    }


def _trial(family: Family, k: int) -> Trial:
    left = family.scenes[k]
    others = replace(family, scenes=family.scenes[:k] + family.scenes[k + 1 :], processes={})  # fitted without it
    bound = [name for name in BOUND if name not in family.no_limit]
    return Trial(choices(others, left.parameters, Accuracy(share=FINE), bound, COSTS[DEVICES[0]], False), left)
