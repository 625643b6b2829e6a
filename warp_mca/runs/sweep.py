"""Owns sweeps from the command line: which scenes `--sweep` asks for, and what is told of them."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from warp_mca.base.errors import bad_value

if TYPE_CHECKING:
    from warp_mca.results.result import Result
    from warp_mca.scene import Scene


def parse_sweep(texts: Iterable[str], given: Collection[str] = ()) -> list[dict[str, str]]:
    """Settings of each scene, from texts `KEY=VALUE,VALUE,…`: every combination, the last key's values fastest.

    Args:
        texts: as the command line has them.
        given: keys that are set for all scenes.

    Raises:
        RequestError: a text is not of that form, or a key occurs twice.
    """
    values: dict[str, list[str]] = {}
    for text in texts:
        key, equals, listed = (part.strip() for part in text.partition("="))
        found = [value.strip() for value in listed.split(",")]
        if not (key and equals and all(found)):
            raise bad_value("--sweep", text, "write it as KEY=VALUE,VALUE,… without spaces")
        if key in given:
            raise bad_value("--sweep", text, f"{key} is set for all scenes as well; leave one of the two out")
        if key in values:
            raise bad_value("--sweep", text, f"list all values of {key} at once")
        values[key] = found
    return [dict(zip(values, chosen, strict=True)) for chosen in itertools.product(*values.values())]


def batches(scenes: Sequence[Scene], duration: float | None) -> list[list[int]]:
    """Numbers of scenes that can take their steps together: those of one duration and output interval [s].

    Args:
        scenes: of the sweep.
        duration: that all of them run, or None for their own.
    """
    found: dict[tuple[str, str], list[int]] = {}
    for k, scene in enumerate(scenes):
        span = scene.impact.duration if duration is None else duration
        # computed from other parameters, equal ones differ by rounding
        found.setdefault((f"{span:.9e}", f"{scene.impact.output_interval:.9e}"), []).append(k)
    return list(found.values())


def print_sweep(
    settings: Sequence[Mapping[str, str]], results: Sequence[Result], groups: Sequence[Sequence[int]]
) -> None:
    """A line for each scene: what was set, the figures that one looks at first, and its folder or why it stopped.

    Below them, each warning once, and the time of all.

    Args:
        settings: of each scene.
        results: of each scene.
        groups: numbers of the scenes that ran at once.
    """
    from rich.table import Table

    from warp_mca.report.console import console

    out = console()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for key in settings[0]:
        table.add_column(key)
    for heading in ("first peak F_n [N]", "F_t [N]", "contact [ms]", "energy error"):
        table.add_column(heading, justify="right")
    table.add_column("")
    for chosen, result in zip(settings, results, strict=True):
        s = result.summary
        cells = [f"{s['F_n_first_peak'] or 0.0:.5g}", f"{s['F_t_min']:.5g} to {s['F_t_max']:.5g}"]
        cells += [f"{1e3 * s['contact_duration']:.4g}", f"{100.0 * s['energy_error']:.2g} %"]
        if result.stopped:
            table.add_row(*chosen.values(), "", "", "", "", result.stopped)
        else:
            table.add_row(*chosen.values(), *cells, f"wrote {result.path}")
    out.print(table)
    for warning in dict.fromkeys(warning for result in results for warning in result.warnings):
        out.print(f"warning: {warning}", soft_wrap=True)
    shared, first = results[0].summary, [results[group[0]].summary["wall"] for group in groups]
    total = {stage: sum(wall[stage] for wall in first) for stage in shared["wall"] if stage != "output"}
    walls = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in total.items())
    out.print(f"wall time of all: {walls}, on {shared['device']}, {shared['precision']}")
