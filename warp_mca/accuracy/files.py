"""Owns the files of a trade-off: tradeoff.json and tradeoff.png."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from warp_mca.accuracy.figures import BOUND, NAMES
from warp_mca.accuracy.findings import TradeOff
from warp_mca.accuracy.measure import Measured
from warp_mca.accuracy.worth import worth_of
from warp_mca.base.errors import bad_value
from warp_mca.base.files import check_folder, given_path
from warp_mca.base.folder import Folder, held
from warp_mca.base.version import __version__

JSON, PICTURE = "tradeoff.json", "tradeoff.png"
FILES = (JSON, PICTURE)


def check_output(directory: str | os.PathLike[str], force: bool) -> Path:
    """The folder as a path, when a trade-off may be written there.

    Raises:
        RequestError: it cannot be written to, or holds a trade-off and `force` is off.
    """
    path = given_path("out", directory, "name a folder, or . for this one")
    check_folder("out", path)
    for name in FILES:
        if (path / name).is_dir():
            raise bad_value("out", str(path), f"{name} is a folder there; name another folder")
        if not force and (path / name).exists():
            remedy = "it holds a trade-off already; name another folder, or use --force (force=True)"
            raise bad_value("out", str(path), remedy)
    return path


@contextmanager
def writing_to(directory: str | os.PathLike[str] | None, force: bool) -> Iterator[Folder | None]:
    """Hold the folder of a trade-off from its start to its end; it is made if need be. None without one.

    Raises:
        RequestError: as in `check_output`; or another run holds it.
    """
    if directory is None:
        yield None
        return
    with held(check_output(directory, force)) as folder:
        yield folder


def write_tradeoff(found: TradeOff, folder: Folder) -> None:
    """Write tradeoff.json and tradeoff.png, both or none.

    Raises:
        OSError: the disk is full or fails.
    """
    from warp_mca.accuracy.picture import plot_tradeoff
    from warp_mca.results.figure_style import save_png

    contents = as_json(found)
    with folder.staging() as staging:
        written = staging / "new"
        written.mkdir()
        (written / JSON).write_text(json.dumps(contents, indent=1) + "\n", encoding="utf-8")
        save_png(plot_tradeoff(contents), written / PICTURE)
        folder.put(written, FILES)


def as_json(found: TradeOff) -> dict[str, Any]:
    """The contents of tradeoff.json."""
    reference, limits = found.reference, found.reference.limits
    fronts = {name: found.frontier(name) for name in NAMES} | {"bound": found.frontier()}
    return {
        "scene": found.scene,
        "device": found.device,
        "threads": found.threads,
        "duration": found.duration,
        "budget": found.budget,
        "version": __version__,
        "time": found.clock,
        "spent": found.spent,
        "reference": {
            "figures": reference.figures,
            "left": {name: limit.left for name, limit in limits.items()},
            "order": {name: limit.order for name, limit in limits.items()},
            "ratio": {name: limit.ratio for name, limit in limits.items()},
            "why": {name: limit.why for name, limit in limits.items() if limit.why},
            "levels": [_variant(found, level, {}) for level in reference.levels],
            "penalty": reference.penalty,
            "springs": dict(reference.springs),
            "precision": "float64",
        },
        "bound": list(BOUND),
        "variants": [_variant(found, run, fronts) for run in found.variants],
        "left_out": [{"knobs": trial.variant.knobs, "foreseen": cost} for trial, cost in found.left_out],
        "same_mesh": [{"knobs": one.variant.knobs, "as": other.variant.knobs} for one, other in found.same],
    }


def _variant(found: TradeOff, run: Measured, fronts: dict[str, list[Measured]]) -> dict[str, Any]:
    row: dict[str, Any] = {"knob": run.trial.knob, "knobs": run.trial.variant.knobs, "stopped": run.stopped or None}
    if run.stopped:
        return row
    return row | {
        "elements": run.elements,
        "steps": run.steps,
        "element_steps": run.element_steps,
        "wall": dict(run.wall),
        "figures": dict(run.figures),
        "errors": found.errors_of(run),
        **worth_of(found, run),
        "frontier": [name for name, front in fronts.items() if run in front],
    }
