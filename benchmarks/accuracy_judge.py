"""Owns how choices of `--accuracy` are judged: true errors, estimates, cost over the cheapest variant; their table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from benchmarks.accuracy_families import Family, Values
from benchmarks.accuracy_measure import COMPUTED, FINE, Row, Table, errors_of
from benchmarks.measurements import measured
from warp_mca.accuracy.choice import cost_of
from warp_mca.accuracy.convergence import Limit
from warp_mca.accuracy.figures import BOUND, bound_errors
from warp_mca.accuracy.prediction import HIGH, LOW, SMALL
from warp_mca.accuracy.store import Size, families
from warp_mca.phases.rate_groups import COSTS, StepCost

START, END = "<!-- accuracy: measured -->", "<!-- accuracy: end -->"  # around what is rendered
# Counts of `accuracy_left_out`, each with what it is out of.
COUNTS = (("chosen", "cases"), ("within", "chosen"), ("twice", "chosen"), ("right", "estimates"), ("cheap", "beside"))
MARGIN = 1.5  # of costs by the store, means over its scenes, over those of one scene [-]


def judged(
    family: Family, values: Values, table: Table, truth: Sequence[Limit], runs: Sequence[Row], device: str
) -> dict[str, Any]:
    """What came of the runs of one scene, and errors and cost of each variant that was measured in it.

    A reference that may be off by more than what was asked cannot tell whether a figure is within. The cheapest variant
    is one that has the figures of the run, all within by the limits as they are known: without those that are not sure,
    or that it lacks, luck in one figure would do.
    """

    def bound(row: Row, asked: float) -> list[float | None]:
        errors = bound_errors(errors_of(family, row, truth), family.no_limit).values()
        return [error if told(limit.left, asked) else None for error, limit in zip(errors, truth, strict=True)]

    tried = {number: [*bound(row, math.inf), cost(row, device)] for number, row in table.items() if number != FINE}
    rows = [
        run if "refused" in run else _judged(run, bound(run, run["asked"]), cost(run, device), tried)
        for run in sorted(runs, key=lambda item: item["asked"])
    ]
    left = bound_errors([limit.left for limit in truth], family.no_limit)
    limits = {"truth": [limit.value for limit in truth], "left": list(left.values())}
    return {"scene": family.scene, "parameters": values, **limits, "runs": rows, "tried": tried}


def _judged(run: Row, errors: list[float | None], own: float, tried: Mapping[int, list[Any]]) -> Row:
    """A run with its errors, its cost and the cheapest variant within: cost and number, None where none is.

    Variants have the errors of the figures and the cost.
    """
    needed = [k for k, error in enumerate(errors) if error is not None]
    within = [
        (row[-1], number)
        for number, row in tried.items()
        if needed and all(row[k] is not None for k in needed) and worst(row[:-1]) <= run["asked"]
    ]
    best = min(within, default=(None, None))
    return {**run, "errors": errors, "worst": worst(errors), "cost": own, "cheapest": best}


def is_judged(errors: Iterable[float | None]) -> bool:
    """Whether the reference tells anything about a run."""
    return any(error is not None for error in errors)


def told(left: float | None, asked: float) -> bool:
    """Whether a limit of which so much may be left tells if errors are within what was asked [-]."""
    return left is None or left <= asked


def cost(row: Row, device: str) -> float:
    """Time of the steps of a run by what the device's steps cost [s]; measured times of small runs say little."""
    computed = (row["computed"] or COMPUTED) * row["work"] if device == "cpu" else row["computed"] or 1.0
    step: StepCost = COSTS["cpu" if device == "cpu" else "H100"]
    return cost_of(Size(row["elements"], row["steps"], computed), step, cpu=True)


def no_dearer(runs: Iterable[Row], device: str) -> Callable[[str, int, int], bool]:
    """Whether a variant may be the cheapest one within: by the store, it costs no more than the dearest one chosen.

    Of a family that is not in the store, and of a scene for which something else was chosen, any may be.
    """
    known, most = families(), dict[tuple[str, int], float]()
    word, cpu = ("cpu", True) if device == "cpu" else ("H100", False)
    costs = {name: [cost_of(size, COSTS[word], cpu) for size in family.sizes] for name, family in known.items()}
    for run in runs:
        if "refused" not in run and run["scene"] in known:
            place, chosen = (run["scene"], run["number"]), run["chosen"]
            same = (
                own
                for own, variant in zip(costs[run["scene"]], known[run["scene"]].variants, strict=True)
                if all(chosen.get(key) == value for key, value in variant.knobs.items() if key != "multi_rate")
            )
            most[place] = max(most.get(place, 0.0), next(same, math.inf))

    def wanted(family: str, scene: int, variant: int) -> bool:
        own = costs.get(family, [])
        return variant >= len(own) or own[variant] <= MARGIN * most.get((family, scene), math.inf)

    return wanted


def worst(errors: Iterable[float | None]) -> float:
    """Greatest size of the errors that are known [-]; 0 where none is."""
    return max((abs(error) for error in errors if error is not None), default=0.0)


def counts(data: Mapping[str, Any]) -> dict[str, tuple[int, int]]:
    """How many of how many cases meet each aim."""
    runs = [run for scene in data["scenes"] for run in scene["runs"] if is_judged(run.get("errors", ()))]
    estimates = [item for run in runs for item in _estimates(run)]
    costs = [run["cost"] <= 2.0 * run["cheapest"][0] for run in runs if run["cheapest"][0] is not None]
    return {
        "true errors within what was asked": _count(run["worst"] <= run["asked"] for run in runs),
        "true errors within twice that": _count(run["worst"] <= 2.0 * run["asked"] for run in runs),
        "deciding took a fifth of the time at most": _count(run["deciding"] <= 0.2 for run in runs),
        "estimates 0.5 to 3 times the true error, or both below a fifth of what was asked": _count(estimates),
        "cost at most twice that of the cheapest variant within": _count(costs),
    }


def _estimates(run: Row) -> list[bool]:
    """Whether the estimate of each figure is right."""
    found = []
    for name, error in zip(BOUND, run["errors"], strict=True):
        share = run["estimate"][name]
        if share is None or error is None:
            continue
        found.append(right(share, error, run["asked"]))
    return found


def right(estimate: float, error: float, asked: float) -> bool:
    """Whether an estimate is LOW to HIGH times the true error, or both are below SMALL of what was asked."""
    true = abs(error)
    return max(estimate, true) < SMALL * asked or LOW * true <= estimate <= HIGH * true


def _count(items: Iterable[bool]) -> tuple[int, int]:
    found = list(items)
    return sum(found), len(found)


def cost_ratio(data: Mapping[str, Any]) -> float | None:
    """Mean cost of the coarser accuracy over that of the finer one [-]."""
    pairs = [[run["cost"] for run in scene["runs"] if "cost" in run] for scene in data["scenes"]]
    ratios = [pair[1] / pair[0] for pair in pairs if len(pair) == 2]
    return sum(ratios) / len(ratios) if ratios else None


def render(page: str, data: Mapping[str, Any]) -> str:
    """The page with the tables of `accuracy.json` in place of what stands between the marks."""
    before, rest = page.split(START)
    after = rest.split(END)[1]
    return "".join([before, START, "\n\n", "\n".join(_lines(data)), "\n\n", END, after])


def _lines(data: Mapping[str, Any]) -> list[str]:
    ratio = cost_ratio(data)
    lines = ["| aim | met |", "|---|---|"]
    lines += [f"| {name} | {met} of {count} |" for name, (met, count) in counts(data).items()]
    if ratio is not None:
        lines.append(f"| cost of 5 % over that of 2 %, mean | {ratio:.2f} |")
    head = ("scene", "asked", "first peak", "impulse", "duration", "elements", "deciding", "cost over the cheapest's")
    lines += [
        "",
        f"{measured('accuracy')} Device, where a scene names no other: {data['device']}.",
        "",
        f"| {' | '.join(head)} |",
        "|" + "---|" * len(head),
    ]
    for scene in data["scenes"]:
        lines += [_row(scene, run) for run in scene["runs"]]
    return [*lines, *_left_out(data["left_out"])] if "left_out" in data else lines


def _left_out(families: Iterable[Mapping[str, Any]]) -> list[str]:
    """Table of choices for the scenes of the store, each foreseen from the others."""
    head = (
        "family, costs of",
        "scenes",
        "chosen from the store",
        "within",
        "within twice",
        "estimates right",
        "cost at most twice the cheapest's",
        "median of that",
        "5 % over 2 %",
    )
    lines = ["", "Each scene of the store, left out and foreseen from the others, at 2 % and 5 %:", ""]
    lines += [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    known = list(families)
    for device in dict.fromkeys(item["device"] for item in known):
        own = [item for item in known if item["device"] == device]
        counts = {key: sum(item[key] for item in own) for pair in COUNTS for key in pair}
        whole = {"scenes": sum(item["scenes"] for item in own), "median": None, "ratio": None, **counts}
        lines += [_left_out_row(f"`{item['family']}`, {device}", item) for item in own]
        lines.append(_left_out_row(f"all, {device}", whole))
    return lines


def _left_out_row(name: str, item: Mapping[str, Any]) -> str:
    met = [f"{item[part]} of {item[whole]}" for part, whole in COUNTS]
    costs = ["" if item[key] is None else f"{item[key]:.2f}" for key in ("median", "ratio")]
    return f"| {name} | {item['scenes']} | {' | '.join([*met, *costs])} |"


def _row(scene: Mapping[str, Any], run: Row) -> str:
    shown = ("mu", "v_plate", "H", "radius", "E_tip", "E_body", "v", "E_ratio", "nu", "length", "ratio")
    own = ", ".join(f"{key}={scene['parameters'][key]:g}" for key in shown if key in scene["parameters"])
    name = f"`{scene['scene']}` {own}" + (f", on {scene['device']}" if "device" in scene else "")
    if "refused" in run:
        return f"| {name} | {run['asked']:.0%} | refused: {run['refused']} | | | | | |"
    figures = zip(BOUND, run["errors"], scene["left"], strict=True)
    errors = [_percent(error, run["estimate"][name], left, run["asked"]) for name, error, left in figures]
    cheapest = run["cheapest"][0]
    beside = f"{run['cost'] / cheapest:.2f}" if cheapest else "none within"
    cells = [name, f"{run['asked']:.0%}", *errors, f"{run['elements']:,}", f"{run['deciding']:.0%}", beside]
    return f"| {' | '.join(cells)} |"


def _percent(error: float | None, estimate: float | None, left: float | None, asked: float) -> str:
    if error is None:
        return "none" if told(left, asked) else f"limit to {100.0 * (left or 0.0):.1f} %"
    return f"{100.0 * error:+.1f} %" + (f" (est. {100.0 * estimate:.1f} %)" if estimate is not None else "")
