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
FEW = 6  # choices, of left-out scenes, that say how many spreads are enough


@dataclass(frozen=True)
class Trial:
    """A scene that was left out, with what the others foresee for each of its variants, and its true errors."""

    found: Sequence[Choice]
    errors: Mapping[int, Mapping[str, float | None]]

    def chosen(self, asked: float, spreads: float) -> Choice | None:
        """The variant that a run would take; None if none will do."""
        measured = [replace(item, spreads=spreads) for item in self.found if item.number in self.errors]
        return cheapest(measured, asked, 1.0)

    def dearer(self, choice: Choice, asked: float) -> float | None:
        """Cost of a choice over that of the cheapest variant within what is asked; None if none is."""
        within = [item for item in self.found if item.number in self.errors and self.worst(item) <= asked]
        return choice.cost / within[0].cost if within else None

    def worst(self, choice: Choice) -> float:
        """Greatest true error of a choice [-]."""
        return max(abs(self.errors[choice.number].get(name) or 0.0) for name in choice.errors)


def calibrated(name: str, data: Mapping[str, Any]) -> dict[str, Any]:
    """The family as the store has it, with the spreads and the scale of estimates that suit its scenes."""
    family = family_from(name, data)
    trials = [_trial(family, k) for k in range(len(family.scenes))]
    spreads = next((item for item in SPREADS if _safe(trials, item)), CAREFUL)
    scale = max(SCALES, key=lambda item: (_marks(trials, spreads, item)[0], -abs(item - 1.0)))
    return {**data, "spreads": spreads, "scale": scale}


def left_out(name: str, data: Mapping[str, Any]) -> dict[str, Any]:
    """How good choices of 2 % and 5 % are for each scene of the store, foreseen from the others: numbers of cases.

    `chosen` of `cases` found a variant; of these `within` what was asked, and `twice`, within twice that; `right` of
    `estimates` as in `judged`; `cheap` cost at most twice the cheapest variant within, where there is one (`beside`).
    """
    family = family_from(name, data)
    trials = [_trial(family, k) for k in range(len(family.scenes))]
    pairs = [(trial, asked, trial.chosen(asked, family.spreads)) for trial in trials for asked in (0.02, 0.05)]
    made = [(trial, asked, choice) for trial, asked, choice in pairs if choice is not None]
    ratios = [trial.worst(choice) / asked for trial, asked, choice in made]
    beside = [ratio for trial, asked, choice in made if (ratio := trial.dearer(choice, asked)) is not None]
    marks = [_marks([trial], family.spreads, family.scale, (asked,)) for trial, asked, _ in made]
    return {
        "family": name,
        "scenes": len(trials),
        "cases": len(pairs),
        "chosen": len(made),
        "within": sum(item <= 1.0 for item in ratios),
        "twice": sum(item <= 2.0 for item in ratios),
        "right": sum(right for right, _ in marks),
        "estimates": sum(count for _, count in marks),
        "cheap": sum(item <= 2.0 for item in beside),
        "beside": len(beside),
    }


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
    if len(ratios) < FEW:
        return False
    far = sum(item > 2.0 for item in ratios)
    return far <= BEYOND * len(ratios) and sum(item <= 1.0 for item in ratios) >= WITHIN * len(ratios)


def _marks(trials: Sequence[Trial], spreads: float, scale: float, shares: Sequence[float] = ASKED) -> tuple[int, int]:
    """How many estimates are between 0.5 and 3 times the true error, or below a fifth of what was asked as this is.

    The second number is that of all.
    """
    right = count = 0
    for trial in trials:
        for asked in shares:
            choice = trial.chosen(asked, spreads)
            for name, error in choice.errors.items() if choice else ():
                true = trial.errors[choice.number].get(name) if choice else None
                if error is not None and true is not None:
                    share = scale * error.size
                    small = max(share, abs(true)) < 0.2 * asked
                    count += 1
                    right += small or 0.5 * abs(true) <= share <= 3.0 * abs(true)
    return right, count
