"""Owns the verdict on a run: its criteria, held against its summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.results.cfc import is_even
from warp_mca.scene.criteria import FIGURES, FILTERED, SHARE, Criterion, read_criterion

if TYPE_CHECKING:
    from warp_mca.results.result import Result


def with_verdict(result: Result, criteria: Sequence[str]) -> Result:
    """The result with `criteria` in its summary, where there are any: a dict for each criterion, in their order.

    Its keys are `criterion`, the text; `met`; `of`, the name of what decided, or None; `value` in SI units, None if the
    run could not tell; `at` [m] and `time` [s] of it where they are known, else None; `limit` in SI units; `margin`,
    how far the value is from the limit as a share of this, negative if not met, None without value or for a limit of 0.
    """
    if not criteria:
        return result
    verdicts = [_verdict(read_criterion(text), result) for text in criteria]
    return replace(result, summary={**result.summary, "criteria": verdicts})


def unmet(summary: Mapping[str, Any]) -> list[str]:
    """A sentence for each criterion of a summary that does not hold."""
    return [sentence(item) for item in summary.get("criteria", ()) if not item["met"]]


def sentence(verdict: Mapping[str, Any]) -> str:
    """What a verdict says, in words."""
    value = verdict["value"]
    of = f"{verdict['of']}: " if verdict["of"] else ""
    told = "the run could not tell" if value is None else f"{of}{value:.5g}"
    if verdict["at"] is not None:
        told += f" at ({', '.join(f'{1e3 * x:.4g}' for x in verdict['at'])}) mm"
    if verdict["time"] is not None:
        told += f", {1e3 * verdict['time']:.4g} ms"
    return f"{verdict['criterion']}: {'met' if verdict['met'] else 'not met'} ({told})"


def _verdict(criterion: Criterion, result: Result) -> dict[str, Any]:
    entries = list(_entries(criterion, result)) or [_entry(criterion.of, None)]
    told = [entry for entry in entries if entry["value"] is not None]
    decides = min if not criterion.upper else max
    worst = decides(told, key=lambda entry: entry["value"]) if len(told) == len(entries) else entries[0]
    value, limit, margin = worst["value"], criterion.limit, None
    if value is not None and limit:
        margin = (limit - value if criterion.upper else value - limit) / abs(limit)
    return {"criterion": criterion.text, "met": criterion.met(value), **worst, "limit": limit, "margin": margin}


def _entries(criterion: Criterion, result: Result) -> Iterator[dict[str, Any]]:
    """What a run has of a figure: of what, value, place and time."""
    figure, summary = criterion.figure, result.summary
    if figure in FIGURES[""]:
        yield _entry(None, summary[figure])
    elif figure == SHARE:
        yield _entry(criterion.of, energy_shares(summary["energy"]).get(str(criterion.of)))
    elif figure == FILTERED or criterion.cfc is not None:
        for k, probe in enumerate(result.probes):
            if criterion.of in (None, probe.name) and (cfc := criterion.cfc or probe.cfc) is not None:
                yield _filtered(result, k, cfc)
    else:
        yield from _listed(criterion, summary)


def _listed(criterion: Criterion, summary: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """What the summary lists of a figure under its keys."""
    figure = criterion.figure
    for key, figures in FIGURES.items():
        listed = summary.get(key, ()) if figure in figures else ()
        items = listed.items() if isinstance(listed, Mapping) else ((item["name"], item) for item in listed)
        for name, item in items:
            if figure not in item or criterion.of not in (None, name):
                continue
            value = item[figure]
            if isinstance(value, Mapping):
                yield _entry(name, value["value"], value.get("at"), value["time"])
            else:
                size = float(np.linalg.norm(value)) if isinstance(value, list) else value
                yield _entry(name, size, time=item.get(f"{figure}_time"))


def _filtered(result: Result, k: int, cfc: float) -> dict[str, Any]:
    """Greatest acceleration of probe `k` by a channel frequency class [Hz], each impact filtered by itself."""
    phases = result.summary.get("phases", ({"kind": "impact", "start": 0.0},))
    starts = [phase["start"] for phase in phases if phase["kind"] == "impact"]
    value, time = None, None
    for number, start in enumerate(starts):
        probe = result.impact(number).probes[k]
        if not is_even(probe.time):
            return _entry(probe.name, None)
        size = np.linalg.norm(probe.filtered(cfc), axis=1)
        row = int(size.argmax()) if len(size) else None
        if row is not None and (value is None or size[row] > value):
            value, time = float(size[row]), float(probe.time[row] + start - starts[0])
    return _entry(result.probes[k].name, value, time=time)


def _entry(of: str | None, value: float | None, at: Any = None, time: float | None = None) -> dict[str, Any]:
    return {"of": of, "value": value, "at": at, "time": time}


def energy_shares(energy: Mapping[str, float]) -> dict[str, float]:
    """Entries of a ledger at the end [J] as shares of the initial energy and the size of the external work [-]."""
    scale = abs(energy.get("initial", 0.0)) + abs(energy.get("external_work", 0.0))
    return {name: value / scale for name, value in energy.items()} if scale > 0.0 else {}
