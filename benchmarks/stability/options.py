"""Owns the axes of options at their limits: mass scaling, steps of several rates."""

from __future__ import annotations

import warp_mca as mca
from benchmarks.stability.axis import Figure, Trial, axis

BARS = "Two equal bars of graded cells end on: F = ρ c A v during 2 L / c"


def graded(ratio: float, fine: str, options: dict[str, object], tolerance: float = 0.02) -> Trial:
    """`graded_bars` with cells that differ so many times, and their force and impulse."""
    scene = mca.make_scene("graded_bars", ratio=ratio, fine=fine, section=2)
    transit, force = 10.0, 0.1

    def read(result: mca.Result) -> list[Figure]:
        plateau = (result.time > 0.5 * transit) & (result.time < 1.5 * transit)
        impulse = float(result.F_n.sum() * (result.time[1] - result.time[0]))
        return [
            Figure("force", float(result.F_n[plateau].mean()), force, tolerance),
            Figure("impulse", impulse, 2.0 * force * transit, 2.0 * tolerance),
        ]

    return Trial(scene, read, options)


@axis(
    group="options",
    title="Mass scaling, fine cells at the contact",
    reference=f"{BARS}, the longest 30 times the shortest.",
    values=(1.0, 1.5, 3.0, 10.0, 100.0),
    quick=(100.0,),
)
def mass_scaling(value: float, element: str) -> Trial:
    """As `graded`."""
    return graded(30.0, "contact", {"mass_scaling": value})


@axis(
    group="options",
    title="Mass scaling, fine cells at the far ends",
    reference=f"{BARS}, the longest 30 times the shortest.",
    values=(1.0, 1.5, 3.0, 10.0, 100.0),
)
def mass_scaling_far(value: float, element: str) -> Trial:
    """As `graded`."""
    return graded(30.0, "ends", {"mass_scaling": value})


@axis(
    group="options",
    title="Groups of steps (`multi_rate`), fine cells at the contact",
    reference=f"{BARS}, the longest 100 times the shortest.",
    values=(1, 2, 4, 8, "auto"),
    quick=(8,),
)
def multi_rate(value: int | str, element: str) -> Trial:
    """As `graded`."""
    return graded(100.0, "contact", {"multi_rate": value})


@axis(
    group="options",
    title="Groups of steps (`multi_rate`), fine cells at the far ends",
    reference=f"{BARS}, the longest 100 times the shortest.",
    values=(1, 2, 4, 8, "auto"),
)
def multi_rate_far(value: int | str, element: str) -> Trial:
    """As `graded`."""
    return graded(100.0, "ends", {"multi_rate": value}, tolerance=0.04)
