"""Owns the options of the command line for recorders, and the recorders that they ask for."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mca.base.errors import bad_value
from warp_mca.cli.own_recorder import own_recorder

if TYPE_CHECKING:
    from warp_mca.recorders import Recorder

# Options for recorders, and their defaults.
DRAWING = {"frames": 100, "field": "von_mises", "magnify": 1.0, "pixels": None, "camera": None, "hide": []}


def add_options(group: argparse._ArgumentGroup) -> None:
    """Options of recorders, in a group of the command's."""
    from warp_mca.pictures.snapshot import FIELDS
    from warp_mca.recorders import FILES

    group.add_argument(
        "--viewer", default="none", choices=("rerun", "none"), help="open a viewer and stream to it (default: none)"
    )
    for option, kind in FILES.items():
        group.add_argument(f"--{option}", metavar="FILE", type=Path, action="append", default=[], help=kind.help)
    group.add_argument(
        "--recorder",
        dest="recorders",
        action="append",
        default=[],
        metavar="MODULE:NAME[,KEY=VALUE…]",
        help="a recorder of your own, the class NAME of a module here; may be given several times",
    )
    group.add_argument(
        "--frames",
        type=int,
        default=DRAWING["frames"],
        metavar="N",
        help="frames of each file (default: %(default)s)",
    )
    group.add_argument(
        "--snapshot",
        dest="snapshots",
        type=float,
        action="append",
        default=[],
        metavar="SECONDS",
        help="draw the bodies at this time after first contact; may be given several times",
    )
    group.add_argument(
        "--field",
        default=DRAWING["field"],
        choices=tuple(FIELDS),
        metavar="FIELD",
        help="what colours --snapshot and --animate: %(choices)s (default: %(default)s)",
    )
    group.add_argument(
        "--magnify",
        type=float,
        default=DRAWING["magnify"],
        metavar="F",
        help="draw F times the deformation there (default: 1)",
    )
    group.add_argument(
        "--pixels", type=int, metavar="N", help="size of the longer side there (default: 800, films 600)"
    )
    group.add_argument(
        "--camera", type=_direction, metavar="X,Y,Z", help="direction from the bodies to the eye there: --camera=-1,0,2"
    )
    group.add_argument(
        "--hide", action="append", default=[], metavar="BODY", help="leave a body out there; may be given several times"
    )


def _direction(text: str) -> tuple[float, ...]:
    """Three numbers between commas."""
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: give three numbers, as 0,0,1") from None
    return x, y, z


def recorders_of(args: argparse.Namespace, out: Path) -> list[Recorder]:
    """The recorders that the arguments ask for."""
    from warp_mca.recorders import FILES, Cadence, SnapshotFile, View

    _check_drawing(args)
    cadence = Cadence(frames=args.frames)
    drawn = {"field": args.field, "magnify": args.magnify}
    drawn["view"] = View(pixels=args.pixels, camera=args.camera, hidden=tuple(args.hide))
    found: list[Recorder] = []
    files = {option: list(getattr(args, option)) for option in FILES}
    if args.viewer == "rerun":
        first = files["rrd"].pop(0) if files["rrd"] else None
        found.append(FILES["rrd"].make(first, viewer=True, cadence=cadence))
    for option, kind in FILES.items():
        more = {**({"cadence": cadence} if kind.frames else {}), **(drawn if kind.pictures else {})}
        found += [kind.make(file, **more) for file in files[option]]
    found += [own_recorder(text, cadence) for text in args.recorders]
    other = "" if args.field == "von_mises" else f"-{args.field}"
    return found + [
        SnapshotFile(out / f"snapshot-{_time_words(t)}{other}.png", time=t, **drawn) for t in args.snapshots
    ]


def _check_drawing(args: argparse.Namespace) -> None:
    """Refuse options of recorders where no recorder takes them: nothing would come of them.

    Raises:
        RequestError: so it is.
    """
    from warp_mca.recorders import FILES

    kinds = [kind for option, kind in FILES.items() if getattr(args, option)]
    takers = {
        "frames": args.viewer != "none" or bool(args.recorders) or any(kind.frames for kind in kinds),
        "field": bool(args.snapshots) or any(kind.pictures for kind in kinds),
    }
    for option, default in DRAWING.items():
        if getattr(args, option) != default and not takers.get(option, takers["field"]):
            remedy = "no file that is asked for has frames" if option == "frames" else "no picture or film is asked for"
            raise bad_value(f"--{option}", getattr(args, option), f"{remedy}; add one, or leave this out")


def _time_words(t: float) -> str:
    """A time [s] in a file's name: in microseconds, as impacts last, or in seconds from 10 ms on."""
    return f"{t:g}s" if t >= 0.01 else f"{1e6 * t:g}us"
