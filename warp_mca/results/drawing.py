"""Owns who draws the figures of a run: helpers that were begun in time, side by side, or this process in turn."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

from warp_mca.base.helpers import Helpers, travel
from warp_mca.results.result import Result

MOST_BYTES = 64 << 20  # of a result for helpers: each gets all of it
IMPORTED = ("matplotlib.backends.backend_agg", "matplotlib.figure", "scipy.ndimage")  # these take long
HELPERS = Helpers(__name__, *IMPORTED)
MOST = 4  # helpers: a scene with paths has as many figures


def begin_helpers(cores: int) -> bool:
    """Have helpers import matplotlib beside a run that will draw, if there are cores for it; says so."""
    if cores >= MOST:
        HELPERS.begin(MOST)
    return cores >= MOST


def draw_figures(result: Result, folder: Path) -> None:
    """Draw forces, energies, and what there is besides; the same files whoever draws them.

    Raises:
        OSError: a file cannot be written.
    """
    names = [*(["waves.png", "paths.png"] if result.paths else []), "forces.png", "energies.png"]  # longest first
    names += ["probes.png"] if result.probes or result.sections else []
    packed = _packed(result) if HELPERS.count else None
    if packed is None:
        for name in names:
            _draw(name, result, folder)
        return

    def data(k: int) -> bytes:
        return pickle.dumps((names[k], packed, str(folder)))

    HELPERS.carry_out(draw_one, len(names), data, lambda k: _draw(names[k], result, folder), HELPERS.count)


def _packed(result: Result) -> bytes | None:
    """The result for helpers, without what no figure shows; None where they are not for it."""
    try:
        packed = pickle.dumps(replace(result, contacts=()), protocol=pickle.HIGHEST_PROTOCOL)
    except Exception:  # what classes of the user's own raise
        return None
    return packed if len(packed) <= MOST_BYTES and travel(packed) else None


def draw_one(name: str, packed: bytes, folder: str) -> None:
    """What a helper does: draw one figure of a packed result."""
    _draw(name, pickle.loads(packed), Path(folder))


def _draw(name: str, result: Result, folder: Path) -> None:
    """Draw the figure of that name; of many impacts, the first one."""
    from warp_mca.results.energy_figure import save_energies
    from warp_mca.results.force_figure import save_forces
    from warp_mca.results.path_figures import save_path_curves, save_waves
    from warp_mca.results.probe_figure import save_probes

    if name == "energies.png":
        save_energies(folder / name, result)
        return
    shown = result.impact() if result.summary.get("touched", True) else result
    draw = {
        "forces.png": save_forces,
        "paths.png": save_path_curves,
        "waves.png": save_waves,
        "probes.png": save_probes,
    }
    draw[name](folder / name, shown)
