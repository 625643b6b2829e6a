"""Owns tradeoff.md of docs/measurements/: tables and pictures, rendered from what `warp-mca tradeoff` wrote.

python -m benchmarks.tradeoff                 write the page and its pictures from tradeoff.*.json
python -m benchmarks.tradeoff NAME DIR        take DIR/tradeoff.json as tradeoff.NAME.json first
"""

from __future__ import annotations

import argparse
import json
import textwrap
from pathlib import Path
from typing import Any

from benchmarks.measurements import FOLDER, measured, note
from benchmarks.report import table
from warp_mca.accuracy.worth import frontier_rows, knob_rows, reference_lines, words

TEMPLATE = FOLDER / "tradeoff.template.md"

# Sections of the page in this order: name of the stored file, heading, command.
CASES = (
    (
        "h100",
        "`two_link`, `standard`, on an H100",
        "warp-mca tradeoff two_link --preset standard --device cuda:0 --budget 150 --out DIR",
    ),
    (
        "quick",
        "`two_link`, `quick`, on two CPU cores",
        "warp-mca tradeoff two_link --threads 2 --budget 1150 --out DIR",
    ),
    (
        "standard",
        "`two_link`, `standard`, on two CPU cores",
        "warp-mca tradeoff two_link --preset standard --threads 2 --budget 2400 --out DIR",
    ),
    (
        "coarse",
        "`two_link`, `quick` with cells 1.4 times larger, on one CPU core",
        "warp-mca tradeoff two_link --refine 0.7 --duration 5e-4 --threads 1 --out DIR",
    ),
    ("hertz_sphere", "`hertz_sphere` on one CPU core", "warp-mca tradeoff hertz_sphere --threads 1 --out DIR"),
    (
        "rolling_sphere",
        "`rolling_sphere` on one CPU core",
        "warp-mca tradeoff rolling_sphere --threads 1 --out DIR",
    ),
    (
        "single_link",
        "`single_link` on one CPU core",
        "warp-mca tradeoff single_link --threads 1 --budget 1500 --out DIR",
    ),
)

NOTES = {
    "h100": "The hinges are two pairs of nodes, which yield as under point loads: the finer the mesh, the slower "
    "impulse and duration settle, and their limits are as uncertain as is written above. `--accuracy` binds neither "
    "behind such hinges; with `joint_nodes=pin` both have a limit.",
    "coarse": "Cells of this size resolve neither tip nor hinges: what is left of the first peak says so (on 977,616 "
    "elements it is 3572 N). Stiffer springs and finer cells at the contact are worth most; coarse tied rods and a "
    "rigid far link spoil the impulse. The plastic strain is that of the contact: the point loads of the hinges, which "
    "have no limit, take over on finer meshes.",
    "standard": "Springs of the scene's own penalty, 0.1, take 9 % off the first peak and hold the contact 11 % "
    "longer, far more than cells of this size do: the variants of the frontier with penalty 1 and 3 are 3 to 23 times "
    "faster than the scene as written and within 1.5 % of a reference that is itself sure to 1.8 %. With "
    "`joint_nodes=pin` the impulse has a limit, too.",
    "rolling_sphere": "The ball begins pressed into the plane, to a depth computed for its mesh: its first peak is the "
    "transient of that start, and little can be said about it; the impulse is what the scene is about.",
}


def stored() -> dict[str, dict[str, Any]]:
    """Trade-offs that the page shows, by name, in its order."""
    files = {name: FOLDER / f"tradeoff.{name}.json" for name, _, _ in CASES}
    return {name: json.loads(file.read_text(encoding="utf-8")) for name, file in files.items() if file.exists()}


def render(found: dict[str, dict[str, Any]]) -> str:
    """The page: its text, and a section for each trade-off."""
    titles = {name: (heading, command) for name, heading, command in CASES}
    sections = [_section(name, *titles[name], contents) for name, contents in found.items()]
    return TEMPLATE.read_text(encoding="utf-8").replace("{sections}", "\n\n".join(sections))


def picture(name: str) -> Path:
    """Where the picture of a trade-off is kept."""
    return FOLDER / "images" / f"tradeoff-{name}.png"


def _section(name: str, heading: str, command: str, contents: dict[str, Any]) -> str:
    runs = [row for row in contents["variants"] if not row["stopped"]]
    refused = len(contents["variants"]) - len(runs)
    count = f"{len(runs)} variants in {contents['spent']:.0f} s"
    count += f", and {refused} that were refused or stopped" if refused else ""
    lines = [
        f"## {heading}",
        "",
        "```bash",
        command,
        "```",
        "",
        f"{measured(f'tradeoff.{name}')} {count}. The reference:",
        "",
    ]
    _, *figures = reference_lines(contents)
    lines += [
        "- " + reference_lines(contents)[0].removeprefix("reference: "),
        *("- " + line.strip() for line in figures),
    ]
    front, knobs = frontier_rows(contents), knob_rows(contents)
    lines += [
        "",
        f"![Time against error](images/{picture(name).name})",
        "",
        "The frontier, errors against the reference:",
    ]
    lines += ["", _code_last(front), "", "One knob at a time, changes against the scene as written:", ""]
    lines += [_code_last(knobs)]
    if name in NOTES:
        lines += ["", *textwrap.wrap(NOTES[name], 120)]
    if contents["left_out"]:
        lines += ["", "Left out, for the budget: " + "; ".join(f"`{words(r['knobs'])}`" for r in contents["left_out"])]
    return "\n".join(lines)


def _code_last(rows: list[list[str]]) -> str:
    """A table in Markdown whose last column, knobs or why there are no figures, comes first."""
    head, *body = ([row[-1], *row[:-1]] for row in rows)
    return table(head, [[row[0].replace("|", "\\|"), *row[1:]] for row in body])


def main() -> None:
    """Command line."""
    from warp_mca.accuracy.picture import plot_tradeoff
    from warp_mca.results.figure_style import save_png

    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.tradeoff", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("name", nargs="?", choices=[name for name, _, _ in CASES])
    parser.add_argument("folder", nargs="?", type=Path, help="that holds a tradeoff.json")
    args = parser.parse_args()
    if args.folder:
        text = (args.folder / "tradeoff.json").read_text(encoding="utf-8")
        target = FOLDER / f"tradeoff.{args.name}.json"
        target.write_text(text, encoding="utf-8")
        note(target, json.loads(text)["device"].split()[0])
    found = stored()
    (FOLDER / "tradeoff.md").write_text(render(found), encoding="utf-8")
    for name, contents in found.items():
        if not picture(name).exists() or name == args.name:
            save_png(plot_tradeoff(contents), picture(name))


if __name__ == "__main__":
    main()
