"""Owns the command `paper`: the published study run again, with its claims beside ours."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mca.base.errors import GuardError
from warp_mca.cli.folder import folder
from warp_mca.cli.warp_start import start_warp

if TYPE_CHECKING:
    from warp_mca.paper.report import Report


def add_options(parser: argparse.ArgumentParser) -> None:
    """Those that it has beside device and precision."""
    parser.add_argument(
        "--level",
        default="quick",
        choices=("quick", "full"),
        help="quick: coarse meshes, three points a figure, minutes on a CPU; full: all of it, for a GPU "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="processes (default: one for each core, three for each GPU)"
    )
    parser.add_argument(
        "--deadline",
        type=_seconds,
        default=math.inf,
        metavar="SECONDS",
        help="begin no run later than this; the report says which are missing, the same command goes on with them; "
        "0 only writes the report of what DIR holds, on any machine",
    )
    parser.add_argument(
        "--pure-fem",
        action="store_true",
        help="run finite elements alone from the release on as well (Table 2): 14 million steps at level full; their "
        "state is stored on the way, and the same command goes on from it",
    )
    parser.add_argument("--force", action="store_true", help="start again, in place of going on with what DIR holds")
    parser.add_argument("--out", type=folder, metavar="DIR", help="folder for the report (default: paper-LEVEL)")
    parser.set_defaults(command=_carry_out)


def _seconds(text: str) -> float:
    """A number of seconds, 0 or more."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r}: give a number of seconds, 0 or more")
    return value


def _carry_out(args: argparse.Namespace) -> None:
    from warp_mca.base.progress import progress_bar
    from warp_mca.paper.report import level_named, make_report

    start_warp()
    with progress_bar() as progress:
        report = make_report(
            level_named(args.level),
            args.out or Path(f"paper-{args.level}"),
            device=args.device,
            precision=args.precision,
            workers=args.workers,
            force=args.force,
            prepare=start_warp,
            progress=progress,
            deadline=args.deadline,
            pure_fem=args.pure_fem,
        )
    _print(report)
    if failed := [row for row in report.rows if row["status"] != "done"]:
        raise GuardError(f"{len(failed)} of {len(report.rows)} runs have no figures: {failed[0]['reason']}")


def _print(report: Report) -> None:
    """How many claims agree, each that does not, and the files."""
    from warp_mca.base.console import console
    from warp_mca.paper.page import value_text

    out = console()
    for said, state in (("agree", True), ("differ", False), ("have no run", None)):
        out.print(f"{sum(verdict.agrees is state for verdict in report.verdicts):3} claims {said}")
    for verdict in report.verdicts:
        if verdict.agrees is False:
            claim, ours = verdict.claim, value_text(verdict.ours, verdict.claim.unit)
            out.print(f"differs: {claim.what}: {ours} ({verdict.why})", soft_wrap=True)
    for file in report.files[:3]:
        out.print(f"wrote {file}", soft_wrap=True)
