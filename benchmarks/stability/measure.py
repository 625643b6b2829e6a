"""Owns one cell of the table: a run, its worst error, and what it said or what stopped it."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import warp_mca as mca
from benchmarks.stability.axis import AXES, Direct, Figure, Trial, Value, with_element
from warp_mca.phases import division
from warp_mca.system.model import Model

PRECISIONS = ("mixed", "float64")
Cell = dict[str, Any]


def cell(name: str, value: Value, element: str, precision: str, device: str) -> Cell:
    """Run one cell, as it is stored."""
    found: Cell = {"axis": name, "value": value, "element": element, "precision": precision, "device": device}
    begun = time.perf_counter()
    try:
        trial = AXES[name].build(value, element)
        found |= (
            _direct(trial, precision, device) if isinstance(trial, Direct) else _run(trial, element, precision, device)
        )
    except mca.RequestError as error:
        found |= {"status": "refused", "said": [str(error)]}
    except mca.GuardError as error:
        found |= {"status": "stopped", "said": [str(error)]}
    return found | {"wall": round(time.perf_counter() - begun, 2)}


def _run(trial: Trial, element: str, precision: str, device: str) -> Cell:
    with forced_step(trial.forced):
        result = mca.run(with_element(trial.scene, element), device=device, precision=precision, **trial.options)
    said = list(result.warnings)
    status = "warned" if said else "finished"
    return {"status": status, **_worst(trial.read(result)), "said": said, "steps": result.summary["n_steps"]}


def _direct(trial: Direct, precision: str, device: str) -> Cell:
    figures, steps = trial.measure(precision, device)
    return {"status": "finished", **_worst(figures), "said": [], "steps": steps, "unit": trial.unit}


def _worst(figures: Iterable[Figure]) -> Cell:
    """The figure that is farthest from its value, by its tolerance."""
    found = list(figures)
    worst = max(found, key=lambda item: item.error / item.tolerance if item.error == item.error else float("inf"))
    return {
        "figure": worst.name,
        "error": float(f"{worst.error:.3g}"),
        "tolerance": worst.tolerance,
        "within": all(item.error <= item.tolerance for item in found),
    }


@contextmanager
def forced_step(times: float) -> Iterator[None]:
    """Let runs take steps so many times longer than they chose."""
    chosen = division._limits

    def longer(scene: mca.Scene, model: Model, interval: float, intervals: int) -> tuple[float, int]:
        stable, searches = chosen(scene, model, interval, intervals)
        return times * stable, searches

    division._limits = longer
    try:
        yield
    finally:
        division._limits = chosen


def wrong(found: Cell) -> bool:
    """Whether a cell is a wrong number that was delivered without a warning."""
    return found["status"] == "finished" and not found["within"]
