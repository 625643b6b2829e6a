"""Owns the main figures of a run in words, as the command line and notebooks show them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from warp_mca.results.criteria import sentence

MAX_PHASES = 20  # that the summary lists


def headlines(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Name and text of each of the main figures of a run."""
    if summary.get("t_contact") is not None:
        yield (
            "hand-off",
            f"t = {summary['t_contact']:.6f} s, v_n = {summary['v_n']:.4f}, v_t = {summary['v_t']:.4f} m/s",
        )
    yield from _phases(summary.get("phases", ()))
    peaks = ", ".join(f"{_force(F)} at {1e3 * t:.3f} ms" for t, F in summary["F_n_peaks"])
    rising = f"none yet, {_force(summary['F_n_max'])} at most so far" if summary.get("F_n_max") else "none"
    yield "F_n peaks", peaks or rising
    yield "F_t", f"{_force(summary['F_t_min'])} to {_force(summary['F_t_max'])}"
    yield "contact", _spans(summary["contacts"])
    yield "sticking", _spans(summary["sticks"])
    yield "plastic strain", f"{summary['max_plastic_strain']:.3g} at most"
    yield from _sensors(summary)
    yield "energy error", f"{100.0 * summary['energy_error']:.2g} %"
    steps = f"{summary['n_steps']:,} steps of {summary['dt']:.3g} s, {1e3 * summary['simulated_time']:g} ms"
    yield "model", f"{summary['n_elements']:,} elements, {steps if summary['n_steps'] else 'no impact'}"
    yield "wall time", ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in summary["wall"].items())
    if "mass_scaling" in summary:
        scaling, shares = summary["mass_scaling"], summary["mass_added"].items()
        added = ", ".join(f"{100.0 * share:.2g} % of {name}" for name, share in shares if share > 0.0)
        yield "mass added", f"{added or 'none'}; first peak off by about {100.0 * scaling['F_n_first_peak']:.2g} %"
    yield from _accuracy(summary)
    yield from (("criterion", sentence(item)) for item in summary.get("criteria", ()))
    rate = summary["element_steps_per_s"]
    if rate is not None:
        yield "rate", f"{rate / 1e6:.2f} M element-steps/s on {summary['device']}, {summary['precision']}"


def _sensors(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """A line with the peaks of each probe and each section."""
    for item in summary.get("probes", ()):
        smooth = f" (CFC {item['cfc']:g}: {item['acceleration_cfc_max']:.4g})" if "cfc" in item else ""
        yield item["name"], f"{item['acceleration_max']:.4g} m/s^2{smooth} and {item['velocity_max']:.4g} m/s at most"
    for item in summary.get("sections", ()):
        yield item["name"], f"{_force(item['F_max'])} and {item['M_max']:.4g} N m at most"


def _accuracy(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """A line with each figure that was to be accurate and its estimated error."""
    if "accuracy" not in summary:
        return
    share = summary["accuracy"]["estimate"]
    texts = {
        "F_n_first_peak": lambda: f"first peak {_force(summary['F_n_first_peak'])}",
        "impulse": lambda: "impulse",
        "contact_duration": lambda: f"contact {1e3 * summary['contact_duration']:.3f} ms",
        "max_plastic_strain": lambda: f"plastic strain {summary['max_plastic_strain']:.3g}",
    }
    known = [f"{texts[name]()} within about {100.0 * share[name]:.2g} %" for name in texts if share[name] is not None]
    yield "estimate", ", ".join(known) or "none of the figures has one"


def _phases(phases: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    """A line for each phase: kind, start and end from the release, what ended it, vibration that was left out."""
    for k, phase in enumerate(phases[:MAX_PHASES]):
        lost = f", {phase['lost']:.3g} J of vibration lost" if phase["lost"] else ""
        span = f"{phase['start']:.6f} to {phase['end']:.6f} s"
        yield "" if k else "phases", f"{phase['kind']:6} {span}, ended by {phase['ended_by']}{lost}"
    if len(phases) > MAX_PHASES:
        yield "", f"and {len(phases) - MAX_PHASES} more, see summary.json"


def _force(value: float) -> str:
    return f"{value / 1e3:.3f} kN" if abs(value) >= 1e3 else f"{value:.3g} N"


def _spans(spans: Sequence[Sequence[float]]) -> str:
    total = sum(end - start for start, end in spans)
    return f"{1e3 * total:.3f} ms in {len(spans)} interval{'s' if len(spans) != 1 else ''}" if spans else "none"
