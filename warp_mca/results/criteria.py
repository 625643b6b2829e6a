"""Owns the verdict on a run: its criteria, held against its summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.scene.criteria import FIGURES, Criterion, read_criterion

if TYPE_CHECKING:
    from warp_mca.results.result import Result


def with_verdict(result: Result, criteria: Sequence[str]) -> Result:
    """The result with `criteria` in its summary, where there are any: a dict for each criterion, in their order.

    Its keys are `criterion`, the text; `met`; `of`, the name of what decided, or None; `value` in SI units, None if the
    run could not tell; `at` [m] and `time` [s] of it where they are known, else None.
    """
    if not criteria:
        return result
    verdicts = [_verdict(read_criterion(text), result.summary) for text in criteria]
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


def _verdict(criterion: Criterion, summary: Mapping[str, Any]) -> dict[str, Any]:
    entries = list(_entries(criterion, summary))
    told = [entry for entry in entries if entry["value"] is not None]
    decides = min if not criterion.upper else max
    worst = decides(told, key=lambda entry: entry["value"]) if len(told) == len(entries) > 0 else entries[0]
    return {"criterion": criterion.text, "met": criterion.met(worst["value"]), **worst}


def _entries(criterion: Criterion, summary: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """What the summary has of a figure: of what, value, place and time."""
    figure = criterion.figure
    if figure in FIGURES[""]:
        yield {"of": None, "value": summary[figure], "at": None, "time": None}
        return
    for key, figures in FIGURES.items():
        listed = summary.get(key, ()) if figure in figures else ()
        items = listed.items() if isinstance(listed, Mapping) else ((item["name"], item) for item in listed)
        for name, item in items:
            if figure in item and criterion.of in (None, name):
                yield _entry(name, item, figure)


def _entry(name: str, item: Mapping[str, Any], figure: str) -> dict[str, Any]:
    value = item[figure]
    if isinstance(value, Mapping):
        return {"of": name, **value}
    size = float(np.linalg.norm(value)) if isinstance(value, list) else value
    return {"of": name, "value": size, "at": None, "time": item.get(f"{figure}_time")}
