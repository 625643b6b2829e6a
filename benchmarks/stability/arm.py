"""Owns the axis of the two-link arm: the three kinds of compliance that the paper's Table 3 varies."""

from __future__ import annotations

from functools import cache
from typing import Any

import warp_mca as mca
from benchmarks.stability.axis import Figure, Trial, axis, with_element

PARTS = {"tip": ("tip",), "body": ("body",), "rod": ("tip", "body")}


def arm(value: str, **more: Any) -> mca.Scene:
    """`two_link` with the moduli of one part, as "tip 0.7": its name and Young's modulus [GPa]."""
    part, modulus = value.split()
    moduli: dict[str, Any] = {}
    for name in PARTS[part]:
        moduli |= {f"E_{name}": 1e9 * float(modulus), f"E_t_{name}": 27.0 / 70.0 * 1e9 * float(modulus)}
    return mca.make_scene("two_link", penalty=1.0, joint_nodes="axis", **moduli, **more)


def figures(result: mca.Result) -> tuple[float, float]:
    """First peak of the force [N] and impulse [N s]."""
    step = float(result.time[1] - result.time[0])
    return float(result.summary["F_n_first_peak"] or 0.0), float(result.F_n.sum() * step)


@cache
def finer(value: str, device: str) -> tuple[float, float]:
    """The figures of a finer mesh in float64, with `hex8r`."""
    scene = with_element(arm(value), "hex8r")
    return figures(mca.run(scene, precision="float64", device=device, refine=1.0))


@axis(
    group="arm",
    title="Part of the arm and its Young's modulus [GPa]",
    reference="`two_link` of 1,408 hexahedra (`--refine 0.5`), elastic-plastic, beside 6,144 of `hex8r` in float64.",
    values=("tip 0.7", "tip 7000", "body 0.7", "body 7000", "rod 0.7", "rod 70", "rod 7000"),
    level="long",
)
def compliance(value: str, element: str) -> Trial:
    """As `arm`."""

    def read(result: mca.Result) -> list[Figure]:
        peak, impulse = figures(result)
        other_peak, other_impulse = finer(value, str(result.summary["device"]).split(" ")[0])
        return [
            Figure("first peak of F_n", peak, other_peak, 0.15),
            Figure("impulse", impulse, other_impulse, 0.15),
        ]

    return Trial(arm(value), read, {"refine": 0.5})
