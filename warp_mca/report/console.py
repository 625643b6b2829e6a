"""Owns what the command line shows: tables of scenes and mesh quality, a run's summary."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from warp_mca.report.quality import Quality
    from warp_mca.results.result import Result
    from warp_mca.scene.catalogue import SceneSource

PIPED_WIDTH = 120  # characters in a line when the output is not a terminal
MAX_PHASES = 20  # that the summary lists


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Leave it to the caller: rich would end the process as if a guard had stopped it."""
        raise BrokenPipeError


def console() -> Console:
    """Standard output, plain: names and paths are shown as they are."""
    return _Console(width=None if sys.stdout.isatty() else PIPED_WIDTH, highlight=False, markup=False, emoji=False)


def print_scenes(sources: Sequence[SceneSource]) -> None:
    """Each scene with its presets, and unit, default and range of every parameter."""
    out = console()
    for source in sources:
        out.print(f"\n{source.name}: {source.description}", style="bold")
        for name, values in source.presets.items():
            default = " (default)" if name == source.default_preset else ""
            out.print(f"  preset {name}{default}: {', '.join(f'{k}={_text(v)}' for k, v in values.items()) or '-'}")
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for heading in ("parameter", "default", "unit", "range", "meaning"):
            table.add_column(heading, overflow="fold")
        defaults = source.resolve()
        for name, parameter in source.parameters.items():
            param = parameter.param
            table.add_row(name, _text(defaults[name]), param.unit, param.range or "any", param.description)
        out.print(table)


def print_quality(quality: Quality) -> None:
    """Size and shape of each body's mesh, and the element that sets the stable step."""
    out = console()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("body")
    for heading in ("elements", "nodes", "min scaled Jacobian [-]", "shortest edge [mm]"):
        table.add_column(heading, justify="right")
    for row in quality.bodies:
        shape = f"{row.min_scaled_jacobian:.3f}", f"{1e3 * row.min_edge:.3f}"
        table.add_row(row.body, f"{row.elements:,}", f"{row.nodes:,}", *shape)
    total = sum(row.elements for row in quality.bodies), sum(row.nodes for row in quality.bodies)
    table.add_row("total", *(f"{count:,}" for count in total))
    out.print(table)
    place = ", ".join(f"{1e3 * x:.2f}" for x in quality.at)
    out.print(
        f"smallest stable step {quality.stable_dt:.4g} s, set by element {quality.element} of {quality.body} "
        f"at ({place}) mm in its frame"
    )
    for warning in quality.warnings:
        out.print(f"warning: {warning}", soft_wrap=True)


def print_summary(result: Result, files: Sequence[str]) -> None:
    """The main figures of a run, its warnings, and the files written."""
    out = console()
    table = Table.grid(padding=(0, 2, 0, 0))
    for label, text in headlines(result.summary):
        table.add_row(label, text)
    out.print(table)
    for warning in result.warnings:
        out.print(f"warning: {warning}", soft_wrap=True)
    for file in files:
        out.print(f"wrote {file}", soft_wrap=True)


def headlines(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Name and text of each of the main figures of a run."""
    if summary.get("t_contact") is not None:
        yield (
            "hand-off",
            f"t = {summary['t_contact']:.6f} s, v_n = {summary['v_n']:.4f}, v_t = {summary['v_t']:.4f} m/s",
        )
    yield from _phases(summary.get("phases", ()))
    peaks = ", ".join(f"{_force(F)} at {1e3 * t:.3f} ms" for t, F in summary["F_n_peaks"])
    yield "F_n peaks", peaks or "none"
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


def _text(value: object) -> str:
    return f"{value:.10g}" if isinstance(value, float) else str(value)
