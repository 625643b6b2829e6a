"""Owns the command `run`: one scene, or a sweep over several."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import warp_mca as mca
from warp_mca.base.errors import GuardError, McaError, bad_value
from warp_mca.cli.accuracy import accuracy_asked
from warp_mca.cli.request import parameters_given, read_request
from warp_mca.cli.warp_start import start_warp

if TYPE_CHECKING:
    from warp_mca.recorders import Recorder
    from warp_mca.results.result import Result


def run(args: argparse.Namespace) -> None:
    """Run a scene or a sweep, and print what came of it."""
    from warp_mca.report.console import print_summary, progress_bar
    from warp_mca.results.storage import CONTACT_FILES, FILES, PATH_FILES

    if args.sweeps:
        _sweep(args)
        return
    request = read_request(args)
    out = args.out or Path(request.label)
    recorders = _recorders(args, out)
    start_warp(*(["scipy.integrate"] if request.scene.rigid else []), "scipy.signal", "matplotlib.backends.backend_agg")
    with _noting_recordings(args), progress_bar() as progress:
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
        )
    written = [*FILES, *(CONTACT_FILES if result.contacts else ()), *(PATH_FILES if result.paths else ())]
    recorded = [r.name for r in recorders if r.name not in result.failed and Path(r.name).exists()]
    print_summary(result, [*(str(out / name) for name in written), *recorded])
    changed = (args.duration, args.time_step_scale, args.refine, args.mass_scaling, args.accuracy)
    as_designed = not args.settings and all(value is None for value in changed)
    if request.source and as_designed:
        for message in request.source.findings(result):
            print(f"check: {message}")
    if result.failed:
        raise McaError(f"{', '.join(result.failed)}: not written whole, as the warnings say; all else is")


def _recorders(args: argparse.Namespace, out: Path) -> list[Recorder]:
    """The recorders that the arguments ask for."""
    from warp_mca.recorders import FILES, Cadence, SnapshotFile

    cadence = Cadence(frames=args.frames)
    found: list[Recorder] = []
    files = {option: list(getattr(args, option)) for option in FILES}
    if args.viewer == "rerun":
        first = files["rrd"].pop(0) if files["rrd"] else None
        found.append(FILES["rrd"].make(first, viewer=True, cadence=cadence))
    for option, kind in FILES.items():
        more = {"cadence": cadence} if kind.frames else {}
        found += [kind.make(file, **more) for file in files[option]]
    return found + [SnapshotFile(out / f"snapshot-{1e6 * t:g}us.png", time=t) for t in args.snapshots]


@contextmanager
def _noting_recordings(args: argparse.Namespace) -> Iterator[None]:
    """Add to an interrupt of a run that its recordings hold the frames until then."""
    from warp_mca.recorders import FILES

    try:
        yield
    except KeyboardInterrupt as stop:
        if any(getattr(args, option) for option, kind in FILES.items() if kind.frames):
            stop.add_note("recordings hold the frames until then")
        raise


def _sweep(args: argparse.Namespace) -> None:
    from warp_mca.report.console import progress_bar
    from warp_mca.runs.batch import hold_scenes, save_scenes
    from warp_mca.runs.sweep import batches, parse_sweep, print_sweep

    if args.multi_rate is not None:
        raise bad_value("--multi-rate", args.multi_rate, "scenes of a sweep take the same steps; leave it out")
    if args.accuracy is not None:
        raise bad_value("--accuracy", args.accuracy, "scenes of a sweep share their mesh and steps; leave it out")
    settings = parse_sweep(args.sweeps, parameters_given(args))
    requests = [read_request(args, more) for more in settings]
    out = args.out or Path(f"{requests[0].label}-sweep")
    if _recorders(args, out):
        raise bad_value("--sweep", args.sweeps[0], "recorders show single runs; leave them out")
    meshes, scenes = requests[0].meshes, [request.scene for request in requests]
    groups = batches(scenes, args.duration)
    found: dict[int, Result] = {}
    with hold_scenes(out, len(scenes), args.force) as folders:
        start_warp()
        with progress_bar() as progress:
            for group in groups:
                done = mca.run_batch(
                    [scenes[k] for k in group],
                    device=args.device,
                    precision=args.precision,
                    threads=args.threads,
                    duration=args.duration,
                    meshes=[meshes] * len(group) if meshes else None,
                    progress=progress,
                )
                found |= zip(group, done, strict=True)
        # only now is it sure that no scene is refused
        results = save_scenes([found[k] for k in range(len(scenes))], folders, args.force)
    print_sweep(settings, results, groups)
    stopped = sum(result.stopped is not None for result in results)
    if stopped:
        raise GuardError(f"guards stopped {stopped} of {len(results)} scenes")
