"""Owns one row of the table: runs a random scene, with finer cells too if it is drawn, and judges it."""

from __future__ import annotations

import logging
import time
from typing import Any

import numpy as np

import warp_mca as mca
from benchmarks.random_scenes.crossing import FAMILIES, LOT, NAMES, Random, crossing
from benchmarks.random_scenes.default import default
from benchmarks.random_scenes.judge import Film, impulses, seen

FINER = 3  # times as many cells along each edge

Row = dict[str, Any]
Task = tuple[str, int, str, bool]  # family, seed, device, whether scenes that are drawn are run with finer cells too


def scene_of(family: str, seed: int) -> mca.Scene:
    """The scene of a seed."""
    return crossing(seed, family).scene if family in FAMILIES else default(seed).scene


def measure(task: Task) -> Row:
    """The row of a scene, with the status `failed` where something broke."""
    import warp as wp

    setattr(wp.config, "quiet", True)  # noqa: B010
    row: Row = {"family": task[0], "seed": task[1], "device": task[2], "kinds": [], "cells": []}
    begun = time.perf_counter()
    log = logging.getLogger("warp_mca")
    level = log.level
    log.setLevel(logging.ERROR)  # rows keep the warnings
    try:
        return row | judged(task)
    except Exception as error:  # which must not end the runs of other scenes
        wall = round(time.perf_counter() - begun, 2)
        return row | {"status": "failed", "said": [f"{type(error).__name__}: {error}"], "wall": wall}
    finally:
        log.setLevel(level)


def in_time(end: float, task: Task) -> Row | None:
    """The row of a task, or None after the time `end`, as `time.time` has it."""
    return measure(task) if time.time() < end else None


def judged(task: Task) -> Row:
    """What there is to say of a scene."""
    family, seed, device, finer = task
    row: Row = {}
    if family not in FAMILIES:
        found = default(seed)
        row |= found.facts
        return row | run(found.scene, device, [])[0]
    found = crossing(seed, family)
    film = Film(found.frames)
    row |= found.facts
    ran, result = run(found.scene, device, [film])
    row |= ran
    if film.skins:
        row |= seen(film, found)
    if result is not None:
        row |= balance(result, film, found.facts["contact"] != "all")
    if finer and seed % LOT == 0 and result is not None:
        row |= compared(film, crossing(seed, family, FINER), device)
    return row


def run(scene: mca.Scene, device: str, recorders: list[Any]) -> tuple[Row, mca.Result | None]:
    """Run a scene: how it ended, what it said, and its figures."""
    begun = time.perf_counter()
    try:
        result = mca.run(scene, device=device, threads=1, recorders=recorders)
    except mca.McaError as error:
        status = "refused" if isinstance(error, mca.RequestError) else "stopped"
        return {"status": status, "said": [str(error)], "wall": round(time.perf_counter() - begun, 2)}, None
    summary = result.summary
    finite = all(np.isfinite(result[name]).all() for name in result.history if name.startswith(("F_", "E_")))
    return {
        "status": "finished",
        "said": list(result.warnings),
        "wall": round(time.perf_counter() - begun, 2),
        "steps": summary["n_steps"],
        "energy_error": float(f"{summary['energy_error']:.3g}"),
        "F_n_max": float(f"{summary['F_n_max']:.4g}"),
        "finite": bool(finite),
        "touched": bool(summary["touched"]),
    }, result


def balance(result: mca.Result, film: Film, listed: bool) -> Row:
    """Whether the force history of a listed contact gives the change of momentum of the body that it acts on."""
    gained = film.momentum[-1][NAMES[0]] - film.momentum[0][NAMES[0]]
    found: Row = {"momentum": float(f"{np.linalg.norm(gained):.5g}")}
    if not listed:
        return found
    force = result.contacts[0].force
    step = (result.time[-1] - result.time[0]) / result.summary["n_steps"]
    # velocities of the last frame are those of half a step before
    impulse = (result.time[1] - result.time[0]) * force.sum(axis=0) - 0.5 * step * force[-1]
    size = max(np.linalg.norm(gained), 1e-6 * max(np.linalg.norm(m) for m in film.momentum[0].values()))
    off = min(np.linalg.norm(gained - impulse), np.linalg.norm(gained + impulse)) / size
    return found | {"momentum_off": float(f"{off:.3g}")}


def compared(film: Film, fine: Random, device: str) -> Row:
    """Impulse of the first contact beside that of the same scene with finer cells, from films of as many frames."""
    other = Film(fine.frames)
    row, result = run(fine.scene, device, [other])
    found: Row = {f"fine_{key}": row[key] for key in ("status", "said", "wall")}
    if result is None:
        return found
    end, own, its = impulses(film, other)
    size = float(np.linalg.norm(its))
    found |= {"first_contact_end": float(f"{end:.4g}"), "impulse_fine": float(f"{size:.5g}")}
    if not size:
        return found
    return found | {
        "impulse_off": round(float(np.linalg.norm(own)) / size - 1.0, 5),
        "impulse_vector_off": round(float(np.linalg.norm(own - its)) / size, 5),
    }
