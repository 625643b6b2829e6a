"""Owns the commands and options of the command line, and their help."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import warp_mca as mca
from warp_mca.cli import commands, paper, part_script, recorders, resume, run, sweep, tradeoff
from warp_mca.cli.accuracy import add_accuracy
from warp_mca.cli.folder import folder
from warp_mca.phases.every import METHODS
from warp_mca.physics.elements import ELEMENTS
from warp_mca.results.figure_style import FIGURES

DEVICE = "cpu, or a CUDA device as cuda:0; cuda: a sweep takes all, all else the first (default: %(default)s)"
WELCOME = """\
warp_mca computes the impact of flexible machines: rigid links swing until they touch something, then explicit
elastoplastic finite elements with frictional contact take over.

  warp-mca run two_link                            falling two-link manipulator strikes a rough plate (Table 1)
  warp-mca run two_link --preset paper --device cuda:0
  warp-mca run two_link --set mu=0.3 --set v_plate=0.8 --out slippery
  warp-mca sweep two_link --grid mu=0.1,0.3 --grid v_plate=0.4,0.8,1.6 --out slip
  warp-mca run my_scene.py                         a scene of your own, in Python
  warp-mca run part.step > drop.py                 a scene that drops a part, to start from
  warp-mca build two_link --preset paper -o paper.mca && warp-mca run paper.mca
  warp-mca tradeoff two_link --out trade           what each choice of the model costs in error, and in time
  warp-mca scenes                                  scenes, presets and parameters

warp-mca COMMAND --help lists the options; README.md has an example in Python."""


class Parser(argparse.ArgumentParser):
    """Reports a bad command in one line."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.register("type", int, partial(_number, int, "give a whole number"))
        self.register("type", float, partial(_number, float, "give a number without a unit, as 0.002 or 2e-3"))

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def make_parser() -> argparse.ArgumentParser:
    """The parser; each command leaves the function that carries it out in `command`."""
    parser = Parser(prog="warp-mca", description="Impact of flexible machines.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"warp-mca {mca.__version__}")
    parser.set_defaults(command=lambda args: print(WELCOME))
    add = partial(parser.add_subparsers(metavar="COMMAND").add_parser, allow_abbrev=False)
    _run(add("run", help="run a scene or a built model"))
    _sweep(add("sweep", help="run a scene for each combination of values, and collect a row of figures a run"))
    _resume(add("resume", help="go on with a run that was stopped, from the state stored in its folder"))
    _tradeoff(add("tradeoff", help="measure what choices of the model cost in error and in time"))
    _build(add("build", help="make the meshes of a scene and store them with it"))
    _scenes(add("scenes", help="list scenes, presets and parameters"))
    _view(add("view", help="open a recording in the rerun viewer"))
    _paper(add("paper", help="run the published study again, and put its claims beside ours"))
    _verify(add("verify", help="measure the engine against known answers"))
    return parser


def _number(kind: Callable[[str], float], remedy: str, text: str) -> float:
    """The value of an option that takes a number."""
    try:
        return kind(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: {remedy}") from None


def _group(parser: argparse.ArgumentParser, title: str, example: str) -> argparse._ArgumentGroup:
    """Options of one purpose, with an example for them."""
    return parser.add_argument_group(title, f"as in: {parser.prog} {example}")


def _run(parser: argparse.ArgumentParser) -> None:
    _add_scene(parser, "; of a part or mesh (.step, .msh, …) a scene file is printed that drops it")
    _add_device(parser)
    _add_options(parser)
    part_script.add_options(_group(parser, "drop of a part", "part.step --height 1.2 --onto concrete --pose corner"))
    add_accuracy(_group(parser, "accuracy", "two_link --set joint_nodes=pin --accuracy 2%"))
    _add_results(parser)


def _add_options(parser: argparse.ArgumentParser) -> None:
    group = _group(parser, "steps and time", "two_link --duration 5e-3 --multi-rate auto --mass-scaling 1.5")
    group.add_argument("--threads", type=int, metavar="N", help="CPU threads to use (default: all cores)")
    group.add_argument(
        "--multi-rate",
        type=_groups,
        metavar="auto|N",
        help="let N groups of elements take steps of their own; auto: as many as suit the device (default: one step)",
    )
    group.add_argument(
        "--duration", type=float, metavar="SECONDS", help="length of the impact phase (default: the scene's)"
    )
    group.add_argument(
        "--time-step-scale", type=float, metavar="SHARE", help="time step over the stable one (default: the scene's)"
    )
    group.add_argument(
        "--mass-scaling",
        type=_mass_scaling,
        metavar="F",
        help="stable step F times as long, or as 2e-8s, by mass that the smallest elements gain (default: the scene's)",
    )


def _add_results(parser: argparse.ArgumentParser) -> None:
    group = _group(parser, "run and results", "two_link --checkpoint 60w --out impact")
    group.add_argument(
        "--sweep",
        dest="sweeps",
        action="append",
        default=[],
        metavar="KEY=VALUE,…",
        help="as warp-mca sweep --grid, with the files of each run in folders 0, 1, … in DIR",
    )
    group.add_argument(
        "--method",
        default="mca",
        choices=METHODS,
        help="mca: rigid links swing until they touch; pure-fem: finite elements from the release on (default: mca)",
    )
    group.add_argument(
        "--checkpoint",
        metavar="EVERY",
        help="store the state each 100 steps, 2e-5s simulated or 30w (seconds of wall time); after an interruption the "
        "same command goes on from it (default with pure-fem: 30w)",
    )
    group.add_argument("--out", type=folder, metavar="DIR", help="folder for the results (default: SCENE-PRESET)")
    group.add_argument("--force", action="store_true", help="replace results that the folder holds already")
    group.add_argument(
        "--figures", default="png", choices=FIGURES, help="none: draw nothing, which saves seconds (default: png)"
    )
    said = group.add_mutually_exclusive_group()
    said.add_argument("--quiet", action="store_true", help="say nothing but warnings and errors")
    said.add_argument("--json", action="store_true", help="print summary.json in place of a table, for scripts")
    example = "two_link --viewer rerun --usd impact.usdc --snapshot 60e-6; options with FILE may be given several times"
    recorders.add_options(_group(parser, "see the run", example))
    parser.set_defaults(command=run.run)


def _resume(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Go on with a run that was stopped, with the scene and the options that its folder holds. Results go to DIR "
        "and nowhere else. A scene file must be the same as when the run was started."
    )
    parser.add_argument("folder", metavar="DIR", type=folder, help="folder of a run with --checkpoint or pure-fem")
    parser.add_argument(
        "--scene", type=Path, metavar="FILE", help="where the scene file is now, if it was moved or lies in DIR"
    )
    _add_import(parser)
    parser.set_defaults(command=resume.resume, parse=lambda words: make_parser().parse_args(words))


def _sweep(parser: argparse.ArgumentParser) -> None:
    _add_scene(parser)
    _add_device(parser)
    _add_options(parser)
    sweep.add_options(parser)
    parser.add_argument("--out", type=folder, metavar="DIR", help="folder for the table (default: SCENE-PRESET-sweep)")


def _tradeoff(parser: argparse.ArgumentParser) -> None:
    _add_scene(parser)
    parser.add_argument("--budget", type=float, metavar="SECONDS", help="time for all runs (default: all variants)")
    parser.add_argument("--device", default="cpu", help=DEVICE)
    parser.add_argument("--threads", type=int, metavar="N", help="CPU threads to use (default: all cores)")
    parser.add_argument(
        "--duration", type=float, metavar="SECONDS", help="length of the impact phase (default: the scene's)"
    )
    parser.add_argument("--out", type=folder, metavar="DIR", required=True, help="folder for the results")
    parser.add_argument("--force", action="store_true", help="replace a trade-off that the folder holds already")
    parser.set_defaults(command=tradeoff.tradeoff)


def _build(parser: argparse.ArgumentParser) -> None:
    _add_scene(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="model file, suffix .mca")
    parser.set_defaults(command=commands.build)


def _scenes(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", nargs="*", metavar="SCENE", help="name or Python file (default: all built-in ones)")
    parser.set_defaults(command=commands.scenes)


def _view(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", metavar="DIR_OR_FILE", type=Path, help=".rrd file, or a folder that holds some")
    parser.set_defaults(command=commands.view)


def _paper(parser: argparse.ArgumentParser) -> None:
    _add_device(parser)
    paper.add_options(parser)


def _verify(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("cases", nargs="*", metavar="CASE", help="case or group of cases (default: all)")
    _add_device(parser)
    _add_element(parser)
    parser.add_argument("--level", default="quick", choices=("quick", "full"), help="meshes (default: %(default)s)")
    parser.add_argument("--out", type=folder, metavar="DIR", help="write verification.md and its figure there")
    parser.set_defaults(command=commands.verify)


def _mass_scaling(text: str) -> float | str:
    """A factor, or a step as text."""
    return text if text.endswith("s") else float(text)


def _groups(text: str) -> int | str:
    return int(text) if text.isdigit() else text


def _add_element(
    parser: argparse.ArgumentParser | argparse._ArgumentGroup, choices: Iterable[str] | None = ELEMENTS
) -> None:
    names = ", ".join(ELEMENTS)
    parser.add_argument("--element", metavar="NAME", choices=choices, help=f"formulation of every body: {names}")


def _add_import(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    parser.add_argument(
        "--import",
        dest="imports",
        action="append",
        default=[],
        metavar="MODULE",
        help="import a module that registers kinds of your own before the scene is read; once for each",
    )


def _add_device(parser: argparse.ArgumentParser) -> None:
    group = _group(parser, "device", "… --device cuda:0 --precision float64")
    group.add_argument("--device", default="cpu", help=DEVICE)
    group.add_argument("--precision", default="mixed", choices=("mixed", "float64"), help="(default: %(default)s)")


def _add_scene(parser: argparse.ArgumentParser, more: str = "") -> None:
    group = _group(parser, "scene", "two_link --preset standard --set mu=0.3 --set v_plate=0.8")
    parser.add_argument("scene", metavar="SCENE", help=f"built-in scene, Python file (.py) or model file (.mca){more}")
    group.add_argument("--preset", metavar="NAME", help="(default: the scene's first)")
    group.add_argument(
        "--refine", type=float, metavar="R", help="cells R times smaller than the recipes say; below 1 larger ones"
    )
    group.add_argument(
        "--units", metavar="SYSTEM", help="run an LS-DYNA deck, in SI, t-mm-s, kg-mm-ms, g-mm-ms or g-cm-us"
    )
    help_text = "a keyword that the deck is read without, as DAMPING_GLOBAL or 'DAMPING_*'; once for each"
    group.add_argument("--leave-out", action="append", default=[], metavar="KEYWORD", help=help_text)
    help_text = "change a parameter; once for each"
    _add_element(group, choices=None)  # `--import` may bring more
    _add_import(group)
    group.add_argument("--set", dest="settings", action="append", default=[], metavar="KEY=VALUE", help=help_text)
    help_text = "what must hold, as 'max_von_mises(shell) < 60e6', else exit status 3; once for each"
    group.add_argument("--criterion", dest="criteria", action="append", default=[], metavar="TEXT", help=help_text)
