"""Owns promising combinations: which knobs to turn together, foreseen from what each does alone.

Relative changes of figures and of costs are assumed to multiply. Combinations are kept that no other one beats in both
error and cost. Knobs that lead to the limit (cells, springs) change figures with their sign; changes by shortcuts are
added to the error, so that none is chosen because it happens to cancel another error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import reduce

import numpy as np

from warp_mca.accuracy.figures import BOUND
from warp_mca.accuracy.knobs import EXCLUDED, Trial
from warp_mca.accuracy.measure import Bench, Measured
from warp_mca.accuracy.variant import Variant
from warp_mca.base.arrays import Array

BETTER = 0.98  # error over that of a cheaper combination below which more is worth its cost [-]
WORST = 0.2  # foreseen error of combinations that are not worth running [-]
CONVERGING = ("mesh", "springs", "finer contact")  # knobs on the way to the limit
DISTRUST = 0.1  # share of their changes, without sign, that is added to the foreseen error


def combinations(
    bench: Bench, runs: Sequence[Measured], truth: Mapping[str, float | None], floor: float
) -> list[tuple[Trial, float]]:
    """Combinations of two knobs or more on the foreseen frontier, and the cost of each over the scene as written [-].

    They come by rising cost.

    Args:
        bench: that ran them.
        runs: variants with one knob changed.
        truth: limits of the figures.
        floor: error below which figures are equally good [-]: that of the reference itself.
    """
    base = bench.base
    names = [name for name in BOUND if truth.get(name) and base is not None and base.figures.get(name)]
    if base is None or not names:
        return []
    by_knob: dict[str, list[Measured]] = {}
    for run in runs:
        if not run.stopped and all(run.figures.get(name) for name in names):
            by_knob.setdefault(run.trial.knob, []).append(run)
    rows = [
        np.vstack([_nothing(names), *(_change(bench, base, run, names) for run in own)]) for own in by_knob.values()
    ]
    if len(rows) < 2:
        return []
    totals = reduce(lambda left, right: (left[:, None, :] + right[None, :, :]).reshape(-1, left.shape[1]), rows)
    start = np.log([(base.figures[name] or 1.0) / (truth[name] or 1.0) for name in names])
    changes, distrust = totals[:, 1 : 1 + len(names)], totals[:, 1 + len(names) :]
    error = np.maximum(np.abs(np.expm1(changes + start)).max(axis=1) + distrust.max(axis=1), floor)
    chosen = np.stack(np.unravel_index(np.arange(len(totals)), [len(row) for row in rows]), axis=1)
    allowed = (chosen > 0).sum(axis=1) > 1
    for pair in excluded(list(by_knob)):
        allowed &= (chosen[:, pair] == 0).any(axis=1)
    kept = np.flatnonzero(allowed & (error <= WORST))
    groups = list(by_knob.values())
    found = []
    for k in kept[_frontier(totals[kept, 0], error[kept])]:
        turned = [own[i - 1].trial.variant for own, i in zip(groups, chosen[k], strict=True) if i]
        found.append((Trial("combined", merged(turned)), math.exp(totals[k, 0])))
    return found


def spread(count: int, most: int) -> list[int]:
    """`most` numbers out of 0 to count - 1, evenly spread ones first."""
    first = np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int)).tolist()
    return first + [k for k in range(count) if k not in first]


def excluded(knobs: Sequence[str]) -> list[tuple[int, int]]:
    """Places of two knobs that a run refuses to turn together."""
    places = {knob: k for k, knob in enumerate(knobs)}
    pairs = ((one, other) for one, others in EXCLUDED.items() for other in others)
    return [(places[one], places[other]) for one, other in pairs if one in places and other in places]


def merged(variants: Sequence[Variant]) -> Variant:
    """One variant with the changes of all of them, which are of different knobs."""
    options: dict[str, object] = {}
    parameters: dict[str, object] = {}
    for variant in variants:
        parameters |= variant.parameters
        options |= {name: value for name, value in variant.knobs.items() if name not in variant.parameters}
    return Variant(**options, parameters=parameters)  # pyright: ignore[reportArgumentType]


def _nothing(names: Sequence[str]) -> Array:
    return np.zeros(1 + 2 * len(names))


def _change(bench: Bench, base: Measured, run: Measured, names: Sequence[str]) -> Array:
    """Logarithms of cost and figures over those of the scene as written, then what is added to the errors [-]."""
    cost = math.log(bench.work_of(run) / bench.work_of(base))
    values = [(run.figures[name] or 1.0) / (base.figures[name] or 1.0) for name in names]
    changes = np.log(np.abs(values))
    if run.trial.knob in CONVERGING:
        return np.concatenate([[cost], changes, DISTRUST * np.abs(changes)])
    return np.concatenate([[cost], 0.0 * changes, np.abs(changes)])


def _frontier(cost: Array, error: Array) -> list[int]:
    """Combinations that no other beats in both error and cost, by rising cost."""
    found, best = [], math.inf
    for k in np.lexsort((error, cost)):
        if error[k] < BETTER * best:
            found.append(int(k))
            best = float(error[k])
    return found
