"""Owns how careful choices of `--accuracy` are: found by foreseeing each measured scene from the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from warp_mca.accuracy.choice import Choice, cheapest, choices
from warp_mca.accuracy.figures import BOUND
from warp_mca.accuracy.request import Accuracy
from warp_mca.accuracy.store import Family, family_from
from warp_mca.runs.rate_groups import COSTS

ASKED = (0.02, 0.03, 0.05)
SPREADS = (0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.6, 2.0, 2.5)
SCALES = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4)
WITHIN = 0.92  # share of the choices that must be within what was asked
BEYOND = 0.02  # share of them that may be beyond twice that: a figure may jump from one peak to another
CAREFUL = 1.6  # spreads where none is enough


@dataclass(frozen=True)
class Trial:
    """A scene that was left out, with what the others foresee for each of its variants, and its true errors."""

    found: Sequence[Choice]
    errors: Mapping[int, Mapping[str, float | None]]

    def chosen(self, asked: float, spreads: float) -> Choice | None:
        """The variant that a run would take; None if none will do."""
        measured = [replace(item, spreads=spreads) for item in self.found if item.number in self.errors]
        return cheapest(measured, asked, 1.0)

    def worst(self, choice: Choice) -> float:
        """Greatest true error of a choice [-]."""
        return max(abs(self.errors[choice.number].get(name) or 0.0) for name in choice.errors)


def calibrated(name: str, data: Mapping[str, Any]) -> dict[str, Any]:
    """The family as the store has it, with the spreads and the scale of estimates that suit its scenes."""
    family = family_from(name, data)
    trials = [_trial(family, k) for k in range(len(family.scenes))]
    spreads = next((item for item in SPREADS if _safe(trials, item)), CAREFUL)
    scale = max(SCALES, key=lambda item: _right(trials, spreads, item))
    return {**data, "spreads": spreads, "scale": scale}


def _trial(family: Family, k: int) -> Trial:
    left = family.scenes[k]
    others = replace(family, scenes=family.scenes[:k] + family.scenes[k + 1 :])
    bound = [name for name in BOUND if name not in family.no_limit and family.has(name)]
    return Trial(choices(others, left.parameters, Accuracy(share=0.02), bound, COSTS["H100"], False), left.errors)


def _safe(trials: Sequence[Trial], spreads: float) -> bool:
    """Whether choices are within what was asked often enough, and hardly ever beyond twice that."""
    ratios = [
        trial.worst(choice) / asked
        for trial in trials
        for asked in ASKED
        if (choice := trial.chosen(asked, spreads)) is not None
    ]
    far = sum(item > 2.0 for item in ratios)
    return far <= BEYOND * len(ratios) and sum(item <= 1.0 for item in ratios) >= WITHIN * len(ratios)


def _right(trials: Sequence[Trial], spreads: float, scale: float) -> int:
    """Number of estimates between 0.5 and 3 times the true error, or below a fifth of what was asked as this is."""
    count = 0
    for trial in trials:
        for asked in ASKED:
            choice = trial.chosen(asked, spreads)
            for name, error in choice.errors.items() if choice else ():
                true = trial.errors[choice.number].get(name) if choice else None
                if error is not None and true is not None:
                    share = scale * error.size
                    small = max(share, abs(true)) < 0.2 * asked
                    count += small or 0.5 * abs(true) <= share <= 3.0 * abs(true)
    return count
