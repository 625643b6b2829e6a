"""Owns the headline figures of a run, and their errors against a reference."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import TYPE_CHECKING

from warp_mca.results.force_history import faint_share, grazing_share

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from warp_mca.results.result import Result

Figures = Mapping[str, float | None]  # by name; None where a run has none

BOUND = ("F_n_first_peak", "impulse", "contact_duration")  # [N], [N s], [s]: those that an asked accuracy binds
NAMES = (*BOUND, "max_plastic_strain", "path_stress")  # [-], [Pa]


def figures_of(result: Result) -> Figures:
    """Headline figures of a run, each None where it has none: a contact without a peak, elastic bodies, no path.

    A contact that has not ended when the run ends has no duration. Neither has one that another mesh may shorten or
    lengthen, because bodies graze each other after it or hardly touch between two compressions.
    """
    summary = result.summary
    unsure = summary.get("contact_open_at_end") or why_unsure(result.F_n)
    peaks = summary["F_n_peaks"]
    return {
        "F_n_first_peak": float(peaks[0][1]) if peaks else None,
        "impulse": normal_impulse(result) or None,
        "contact_duration": None if unsure else summary["contact_duration"] or None,
        "max_plastic_strain": summary["max_plastic_strain"] or None,
        "path_stress": max((float(path.von_mises.max()) for path in result.paths if path.stress.size), default=None),
    }


def why_unsure(F_n: NDArray[np.float64]) -> str:
    """Why the duration of a contact depends on the mesh; empty if it does not. F_n as in `contact_rows` [N]."""
    if grazing_share(F_n):
        return "it counts touches with hardly any force, whose length is the mesh's; contacts has the first one's"
    if share := faint_share(F_n):
        return f"for {share:.0%} of it bodies hardly touch, between two compressions: another mesh may part them there"
    return ""


def normal_impulse(result: Result) -> float:
    """Impulse of the normal force over the run [N s]: forces are means over their interval."""
    import numpy as np

    return float(np.sum(result.F_n * np.diff(result.time, prepend=0.0)))


def errors(found: Figures, truth: Figures) -> dict[str, float | None]:
    """Signed relative error of each figure against the truth [-]; None if either is missing."""
    shares: dict[str, float | None] = {}
    for name in NAMES:
        value, true = found.get(name), truth.get(name)
        shares[name] = None if value is None or not true else value / true - 1.0
    return shares


def bound_errors(shares: Sequence[float | None], no_limit: Container[str]) -> dict[str, float | None]:
    """Errors that an asked accuracy binds, by figure, of those in the order of BOUND [-]; None without a limit."""
    return {name: None if name in no_limit else error for name, error in zip(BOUND, shares, strict=True)}


def worst(shares: Mapping[str, float | None]) -> float:
    """Greatest size of the errors that an asked accuracy binds [-]; 0 where there are none."""
    return max((abs(shares[name] or 0.0) for name in BOUND), default=0.0)
