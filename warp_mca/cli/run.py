"""Owns the command `run`: one scene, or a sweep over several."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import warp_mca as mca
from warp_mca.base.errors import CriterionError, McaError, bad_value
from warp_mca.base.log import LOGGER
from warp_mca.cli import part_script, robot_script, sweep
from warp_mca.cli.accuracy import accuracy_asked
from warp_mca.cli.recorders import recorders_of
from warp_mca.cli.request import Request, read_request
from warp_mca.cli.resume import command_of
from warp_mca.cli.warp_start import RUN, start_warp
from warp_mca.phases.every import DEFAULT, Every
from warp_mca.results.drawing import begin_helpers
from warp_mca.system.threads import thread_count

if TYPE_CHECKING:
    from warp_mca.recorders import Recorder
    from warp_mca.results.result import Result


def run(args: argparse.Namespace) -> None:
    """Run a scene or a sweep, and print what came of it; of a part or a robot, print a scene file."""
    from warp_mca.base.progress import progress_bar
    from warp_mca.results.criteria import unmet

    every_pose = args.pose == part_script.EVERY and part_script.is_part(args.scene)
    if every_pose:
        args.sweeps.append(f"pose={','.join(mca.POSES)}")
        args.pose = None
        args.height = 0.5 if args.height is None else args.height
    if args.sweeps:
        _sweep(args, every_pose)
        return
    if robot_script.is_robot(args.scene):
        robot_script.print_script(args.scene)
        return
    runs = args.units is not None or args.leave_out or part_script.is_drop(args)
    if part_script.is_part(args.scene) and not runs:
        part_script.print_script(args.scene)
        return
    if not args.quiet:
        logging.getLogger(LOGGER).setLevel(logging.INFO)  # so that what is about to run is said
    request = read_request(args)
    out = args.out or Path(request.label if args.method == "mca" else f"{request.label}-{args.method}")
    recorders = recorders_of(args, out)
    start_warp(*RUN, *_needed(args))
    with _noting_what_is_left(args), nullcontext() if args.quiet else progress_bar() as progress:
        result = mca.run(
            request.scene,
            device=args.device,
            precision=args.precision,
            threads=args.threads,
            multi_rate=args.multi_rate,
            accuracy=accuracy_asked(args, request),
            duration=args.duration,
            out=out,
            force=args.force,
            meshes=request.meshes,
            recorders=recorders,
            progress=progress,
            method=args.method,
            checkpoint=_every(args),
            figures=args.figures,
        )
    _tell(args, request, result, out, recorders)
    if result.failed:
        raise McaError(f"{', '.join(result.failed)}: not written whole, as the warnings say; all else is")
    if failed := unmet(result.summary):
        raise CriterionError("; ".join(failed))


def _needed(args: argparse.Namespace) -> list[str]:
    """Modules that its figures need, which take long to import, unless helpers are begun for them."""
    drawn_here = args.figures == "png" and not begin_helpers(thread_count(None))
    return ["matplotlib.backends.backend_agg"] if drawn_here else []


def _tell(args: argparse.Namespace, request: Request, result: Result, out: Path, recorders: Sequence[Recorder]) -> None:
    """Print what came of a run: figures, warnings and files; with --json its summary; with --quiet warnings alone."""
    from warp_mca.base.log import warn
    from warp_mca.cli.console import print_summary
    from warp_mca.results.storage import CONTACT_FILES, FILES, PATH_FILES, PROBE_FILES

    if args.json:
        print((out / "summary.json").read_text(encoding="utf-8"), end="")
    elif args.quiet:
        warn(result.warnings)
    else:
        written = [*FILES, *(CONTACT_FILES if result.contacts else ()), *(PATH_FILES if result.paths else ())]
        written += PROBE_FILES if result.probes or result.sections else ()
        recorded = [r.name for r in recorders if r.name not in result.failed and Path(r.name).exists()]
        present = (str(out / name) for name in written if (out / name).exists())
        print_summary(result, [*present, *recorded])
    changed = (args.duration, args.time_step_scale, args.refine, args.mass_scaling, args.accuracy)
    as_designed = not args.settings and all(value is None for value in changed)
    if request.source and as_designed:
        for message in request.source.findings(result):
            print(f"check: {message}", file=sys.stderr if args.json or args.quiet else sys.stdout)


def _every(args: argparse.Namespace) -> Every | None:
    """How often the run stores its state, with what `resume` needs; None if that is not asked for."""
    if args.checkpoint is None and args.method == "mca":
        return None
    return Every.parse(DEFAULT if args.checkpoint is None else args.checkpoint, command_of(args))


@contextmanager
def _noting_what_is_left(args: argparse.Namespace) -> Iterator[None]:
    """Add to an interrupt of a run that its recordings hold the frames until then, or that it can go on."""
    from warp_mca.recorders import FILES

    try:
        yield
    except KeyboardInterrupt as stop:
        files = [file for option, kind in FILES.items() if kind.frames for file in getattr(args, option)]
        if any(file.exists() for file in files):
            stop.add_note("recordings hold the frames until then")
        if _every(args):
            stop.add_note("the same command goes on from the state that was last stored")
        raise


def _sweep(args: argparse.Namespace, worst: bool) -> None:
    """Carry out `--sweep`: as the command `sweep`, with the files of each run kept."""
    if args.accuracy is not None:
        raise bad_value("--accuracy", args.accuracy, "each scene of a sweep would get a model of its own; leave it out")
    asked = ("--pose", part_script.EVERY) if worst else ("--sweep", args.sweeps[0])
    if recorders_of(args, Path()):
        raise bad_value(*asked, "recorders show single runs; leave them out")
    if args.method != "mca" or args.checkpoint is not None:
        raise bad_value(*asked, "its runs take no --method and no --checkpoint; leave these out")
    if args.figures == "none":
        remedy = "its runs draw all figures; leave --figures out, or use warp-mca sweep, which draws none"
        raise bad_value(*asked, remedy)
    if args.quiet or args.json:
        raise bad_value(*asked, "--quiet and --json are for single runs; leave these out")
    sweep.sweep(args, "--sweep", args.sweeps, folders=True, worst=worst)
