"""Owns the command line: warp-mca run | build | scenes | view | verify.

Exit status: 0 done, 1 a guard stopped the run, 2 the request cannot be carried out, 129 the terminal is gone, 130
interrupted, 141 nobody reads what is printed, 143 terminated.
"""

from __future__ import annotations

import argparse
import atexit
import dataclasses
import gc
import logging
import os
import signal
import sys
import threading
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import warp_mca as mca
from warp_mca.base.errors import GuardError, McaError, bad_value
from warp_mca.base.stdio import drop_output, open_streams, what_failed
from warp_mca.elements import ELEMENTS
from warp_mca.runs.advice import LOGGER
from warp_mca.scene import Scene
from warp_mca.scene import catalogue as registry
from warp_mca.scene.model_file import SUFFIX, Origin

if TYPE_CHECKING:
    from warp_mca.recorders import Recorder
    from warp_mca.results.result import Result

SCALE = "time_step_scale"  # an option for every scene, and a parameter of some
WELCOME = """\
warp_mca computes the impact of flexible machines: rigid links swing until they touch something, then explicit
elastoplastic finite elements with frictional contact take over.

  warp-mca run two_link                            falling two-link manipulator strikes a rough plate (Table 1)
  warp-mca run two_link --preset paper --device cuda:0
  warp-mca run two_link --set mu=0.3 --set v_plate=0.8 --out slippery
  warp-mca run my_scene.py                         a scene of your own, in Python
  warp-mca build two_link --preset paper -o paper.mca && warp-mca run paper.mca
  warp-mca scenes                                  scenes, presets and parameters

warp-mca COMMAND --help lists the options; README.md has an example in Python."""

COLLECT = 100_000  # objects between two collections: what imports and figures make stays, looking at it takes 0.2 s


@dataclass(frozen=True)
class Request:
    """What is to be run or built.

    Attributes:
        scene: built from its parameters.
        label: names the default output folder.
        source: the scene file, or None when a model file was given.
        origin: the built-in scene and its parameters, or None.
        meshes: those of a model file, or None.
    """

    scene: Scene
    label: str
    source: registry.SceneSource | None = None
    origin: Origin | None = None
    meshes: dict[str, mca.Mesh] | None = None


class _Early(logging.Handler):
    """Prints what a run says before it is done on standard error, which may be another one for each command."""

    def emit(self, record: logging.LogRecord) -> None:
        """One line."""
        with suppress(OSError):  # nobody reads it: the run goes on
            print(f"warning: {record.getMessage()}", file=sys.stderr, flush=True)


class _Parser(argparse.ArgumentParser):
    """Reports a bad command in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


class _Terminated(KeyboardInterrupt):
    """SIGTERM, as batch systems send it, or SIGHUP: what a key stops is closed and cleared away in the same way."""


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out one command.

    Args:
        argv: without the program's name; the process's own if None.

    Returns:
        The exit status.
    """
    if argv is None:  # the process ends with this command: going through all that it made, to free it, takes 0.5 s
        atexit.register(gc.freeze)
        os.environ["MPLBACKEND"] = "agg"  # that of a notebook may be of another environment; no figure needs it
        open_streams()
    collect = gc.get_threshold()
    gc.set_threshold(COLLECT)
    main_thread = threading.current_thread() is threading.main_thread()  # no other may take signals
    signals = (signal.SIGTERM, signal.SIGHUP) if main_thread else ()
    before = {number: signal.getsignal(number) for number in signals}
    for number in signals:
        if before[number] is not signal.SIG_IGN:  # as nohup has it
            signal.signal(number, _terminate)
    early = _Early()
    logging.getLogger(LOGGER).addHandler(early)
    try:
        return _carry_out(argv)
    except McaError as error:
        return _fail(str(error), error.exit_status)
    except BrokenPipeError:
        drop_output()
        return 128 + signal.SIGPIPE
    except OSError as error:
        drop_output()
        return _fail(what_failed(error), 2)
    except MemoryError:
        return _fail("the model does not fit into this machine's memory: take fewer elements", 2)
    except KeyboardInterrupt as stop:
        what, number = ("terminated", stop.args[0]) if isinstance(stop, _Terminated) else ("interrupted", signal.SIGINT)
        print("; ".join([f"warp-mca: {what} before it was done", *getattr(stop, "__notes__", ())]), file=sys.stderr)
        return 128 + number
    finally:
        logging.getLogger(LOGGER).removeHandler(early)
        gc.set_threshold(*collect)
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def _carry_out(argv: Sequence[str] | None) -> int:
    """Carry out one command; what it printed has left the process when it returns."""
    status = 0
    try:
        args = _parser().parse_args(argv)
        args.command(args)
    except SystemExit as stop:  # argparse's way of answering --help, --version and bad commands
        status = stop.code if isinstance(stop.code, int) else 2
    sys.stdout.flush()
    return status


def _fail(why: str, status: int) -> int:
    print("warp-mca: error:", " ".join(why.split()), file=sys.stderr)
    return status


def _terminate(number: int, frame: object) -> NoReturn:
    raise _Terminated(number)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="warp-mca", description="Impact of flexible machines.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"warp-mca {mca.__version__}")
    parser.set_defaults(command=lambda args: print(WELCOME))
    commands = parser.add_subparsers(metavar="COMMAND")

    run = commands.add_parser("run", help="run a scene or a built model", allow_abbrev=False)
    _add_scene(run)
    _add_device(run)
    run.add_argument("--threads", type=int, metavar="N", help="of a run on the CPU (default: all cores)")
    run.add_argument("--duration", type=float, metavar="SECONDS", help="of the impact phase (default: the scene's)")
    run.add_argument(
        "--time-step-scale", type=float, metavar="SHARE", help="of the stable time step (default: the scene's)"
    )
    run.add_argument(
        "--sweep",
        dest="sweeps",
        action="append",
        default=[],
        metavar="KEY=VALUE,…",
        help="run a scene for each value, all at once, to folders 0, 1, … in DIR; several times: all combinations",
    )
    run.add_argument("--out", type=_folder, metavar="DIR", help="folder for the results (default: SCENE-PRESET)")
    run.add_argument("--force", action="store_true", help="replace results that the folder holds already")
    _add_recorders(run)
    run.set_defaults(command=_run)

    build = commands.add_parser("build", help="make the meshes of a scene and store them with it", allow_abbrev=False)
    _add_scene(build)
    build.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="model file, suffix .mca")
    build.set_defaults(command=_build)

    scenes = commands.add_parser("scenes", help="list scenes, presets and parameters", allow_abbrev=False)
    scenes.add_argument("scene", nargs="*", metavar="SCENE", help="name or Python file (default: all built-in ones)")
    scenes.set_defaults(command=_scenes)

    view = commands.add_parser("view", help="open a recording in the rerun viewer", allow_abbrev=False)
    view.add_argument("recording", metavar="DIR_OR_FILE", type=Path, help=".rrd file, or a folder that holds some")
    view.set_defaults(command=_view)

    verify = commands.add_parser("verify", help="measure the engine against known answers", allow_abbrev=False)
    verify.add_argument("cases", nargs="*", metavar="CASE", help="case or group of cases (default: all)")
    _add_device(verify)
    _add_element(verify)
    verify.add_argument("--level", default="quick", choices=("quick", "full"), help="meshes (default: %(default)s)")
    verify.add_argument("--out", type=_folder, metavar="DIR", help="write verification.md and its figure there")
    verify.set_defaults(command=_verify)
    return parser


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("'': name a folder, or . for this one")
    return Path(text)


def _add_element(parser: argparse.ArgumentParser) -> None:
    names = ", ".join(ELEMENTS)
    parser.add_argument("--element", metavar="NAME", choices=tuple(ELEMENTS), help=f"of every body: {names}")


def _add_device(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--device", default="cpu", help="cpu or a CUDA device as cuda:0 (default: %(default)s)")
    parser.add_argument("--precision", default="mixed", choices=("mixed", "float64"), help="(default: %(default)s)")


def _add_scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="built-in scene, Python file (.py) or model file (.mca)")
    parser.add_argument("--preset", metavar="NAME", help="(default: the scene's first)")
    help_text = "change a parameter; may be given several times"
    _add_element(parser)
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="KEY=VALUE", help=help_text)


def _add_recorders(parser: argparse.ArgumentParser) -> None:
    from warp_mca.recorders import FILES

    group = parser.add_argument_group("see the run", "options with FILE may be given several times")
    group.add_argument(
        "--viewer", default="none", choices=("rerun", "none"), help="open a viewer and stream to it (default: none)"
    )
    for option, kind in FILES.items():
        group.add_argument(f"--{option}", metavar="FILE", type=Path, action="append", default=[], help=kind.help)
    group.add_argument("--frames", type=int, default=100, metavar="N", help="in each of them (default: %(default)s)")
    group.add_argument(
        "--snapshot",
        dest="snapshots",
        type=float,
        action="append",
        default=[],
        metavar="SECONDS",
        help="draw the bodies at this time after first contact; may be given several times",
    )


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
        more = {} if option == "final" else {"cadence": cadence}
        found += [kind.make(file, **more) for file in files[option]]
    return found + [SnapshotFile(out / f"snapshot-{1e6 * t:g}us.png", time=t) for t in args.snapshots]


def _request(args: argparse.Namespace, more: Mapping[str, str] | None = None) -> Request:
    """Build the scene that the arguments ask for, with `more` parameters changed."""
    from warp_mca.scene import model_file as scene_file

    overrides: dict[str, object] = {**registry.parse_overrides(args.settings), **(more or {})}
    scale = getattr(args, SCALE, None)
    if Path(args.scene).suffix != SUFFIX:
        source = registry.load_source(args.scene)
        scale = _where_no_parameter(scale, source.parameters, overrides)
        values = source.resolve(args.preset, overrides)
        preset = args.preset or source.default_preset
        origin = Origin(source.name, preset, values) if source.builtin else None
        label = f"{source.name}-{preset}" if preset else source.name
        return Request(_with(source.build(values), args.element, scale), label, source, origin)
    if args.preset is not None:
        raise bad_value("--preset", args.preset, "a model file has its preset built in; leave it out or build again")
    stored = scene_file.load(args.scene)
    scale = _where_no_parameter(scale, stored.origin.parameters if stored.origin else (), overrides)
    stored = scene_file.changed(stored, overrides)
    scene = _with(stored.scene, args.element, scale)
    return Request(scene, Path(args.scene).stem, None, stored.origin, stored.meshes)


def _given(args: argparse.Namespace) -> set[str]:
    """Parameters that the command sets for all scenes of a sweep."""
    return {*registry.parse_overrides(args.settings), *([SCALE] if args.time_step_scale is not None else ())}


def _where_no_parameter(scale: float | None, names: Collection[str], overrides: dict[str, object]) -> float | None:
    """The share of the stable time step, or None where the scene has it among its parameters, which take it then."""
    if scale is not None and SCALE in names:
        overrides[SCALE] = scale
        return None
    return scale


def _with(scene: Scene, element: str | None, scale: float | None) -> Scene:
    """The scene with another element formulation, or share of the stable time step, where one is given."""
    if element is not None:
        scene = dataclasses.replace(scene, bodies=tuple(dataclasses.replace(b, element=element) for b in scene.bodies))
    if scale is not None:
        scene = dataclasses.replace(scene, impact=dataclasses.replace(scene.impact, time_step_scale=scale))
    return scene


def _run(args: argparse.Namespace) -> None:
    from warp_mca.report.console import print_summary, progress_bar
    from warp_mca.results.result import CONTACT_FILES, FILES, PATH_FILES

    if args.sweeps:
        _sweep(args)
        return
    request = _request(args)
    out = args.out or Path(request.label)
    recorders = _recorders(args, out)
    _start_warp(
        *(["scipy.integrate"] if request.scene.rigid else []), "scipy.signal", "matplotlib.backends.backend_agg"
    )
    with _noting_recordings(args), progress_bar() as progress:
        result = mca.run(
            request.scene,
            device=args.device,
            precision=args.precision,
            threads=args.threads,
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
    as_designed = not args.settings and args.duration is None and args.time_step_scale is None
    if request.source and as_designed:
        for message in request.source.findings(result):
            print(f"check: {message}")
    if result.failed:
        raise McaError(f"{', '.join(result.failed)}: not written whole, as the warnings say; all else is")


@contextmanager
def _noting_recordings(args: argparse.Namespace) -> Iterator[None]:
    """Note on what stops a run that its recordings, if there are some, are worth a look."""
    try:
        yield
    except KeyboardInterrupt as stop:
        if any((args.rrd, args.usd, args.vtkhdf)):
            stop.add_note("recordings hold the frames until then")
        raise


def _sweep(args: argparse.Namespace) -> None:
    from warp_mca.report.console import progress_bar
    from warp_mca.runs.batch import hold_scenes, save_scenes
    from warp_mca.runs.sweep import batches, parse_sweep, print_sweep

    settings = parse_sweep(args.sweeps, _given(args))
    requests = [_request(args, more) for more in settings]
    out = args.out or Path(f"{requests[0].label}-sweep")
    if _recorders(args, out):
        raise bad_value("--sweep", args.sweeps[0], "recorders show single runs; leave them out")
    meshes, scenes = requests[0].meshes, [request.scene for request in requests]
    groups = batches(scenes, args.duration)
    found: dict[int, Result] = {}
    with hold_scenes(out, len(scenes), args.force) as folders:
        _start_warp()
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


def _import(*names: str) -> None:
    with suppress(Exception):  # whoever uses the module meets what is wrong with it
        for name in names:
            import_module(name)


def _start_warp(*needed: str) -> None:
    """Initialise Warp, and meanwhile import modules that are `needed` later: a GPU's driver takes its time.

    Warp's native code warns on stderr when there is no GPU, which is no news to who asks for cpu.
    """
    import warp

    meanwhile = threading.Thread(target=_import, args=needed, daemon=True)
    meanwhile.start()
    sys.stderr.flush()
    stderr, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        warp.config.log_level = warp.LOG_WARNING
        warp.init()
    except OSError as error:
        what = f"kernels cannot be kept there ({error.strerror or error}); set WARP_CACHE_PATH to another folder"
        raise bad_value("WARP_CACHE_PATH", str(error.filename), what) from error
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(null)
    meanwhile.join()  # imports and the arrays of a mesh, at the same time, would wait for each other


def _build(args: argparse.Namespace) -> None:
    from warp_mca.report.console import print_quality
    from warp_mca.scene import model_file as scene_file

    target = scene_file.check_path(args.output)
    if Path(args.scene).suffix == SUFFIX:
        raise bad_value("scene", args.scene, "this is a built model; name a built-in scene or a Python file")
    request = _request(args)
    meshes = mca.mesh(request.scene)
    quality = mca.quality_table(request.scene, meshes)
    scene_file.save(target, request.scene, meshes, request.origin)
    print_quality(quality)
    print(f"wrote {target}")


def _scenes(args: argparse.Namespace) -> None:
    from warp_mca.report.console import print_scenes

    print_scenes([registry.load_source(name) for name in args.scene or registry.scene_names()])


def _view(args: argparse.Namespace) -> None:
    from warp_mca.recorders.rerun_viewer import view

    view(args.recording)


def _verify(args: argparse.Namespace) -> None:
    from warp_mca.verify.runner import verify

    _start_warp()
    verify(
        args.cases, device=args.device, precision=args.precision, element=args.element, level=args.level, out=args.out
    )
