"""Owns parts as scenes: `warp-mca run part.step` prints a scene file that drops it, or runs that with `--height`."""

from __future__ import annotations

import argparse
import json
import logging
import math
import sys
from collections.abc import Container, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.base.log import LOGGER, warn
from warp_mca.geometry.keyword_file import KEYWORD_SUFFIXES

MESH_SUFFIXES = (".msh", ".unv", ".bdf", ".nas", ".fem", ".inp", ".k", ".key", ".dyn", ".vtu", ".vtk", ".med")
SHOWN = 12  # node sets, solids and pairs of them that the script lists
_UNIT = {1.0: "metres", 1e-3: "millimetres"}
_OTHER = {1.0: "1e-3 for millimetres", 1e-3: "1 for metres"}
OPTIONS = ("height", "pose", "onto")  # of the command line, which are parameters of the script
EVERY = "all"  # value of --pose for a sweep over all poses

_SCRIPT = '''"""{name} falls on a floor."""

from typing import Annotated

import warp_mca as mca

{listing}


def build(
    *,
    height: Annotated[float, mca.Param("of the fall", "m", low=0.0, exclusive=True)] = 0.5,
    pose: Annotated[str, mca.Param("face, edge, corner, one of mca.POSES, or degrees about x, y: 30/45")] = "face",
    onto: Annotated[str, mca.Param("floor", choices=("rigid", "steel", "concrete", "wood"))] = "rigid",
    mu: Annotated[float, mca.Param("coefficient of friction", "-", low=0.0)] = 0.2,
    struck: Annotated[str, mca.Param("size of cells where it strikes [m], auto or off")] = "auto",
    penalty: Annotated[
        float | None, mca.Param("factor of the floor's contact stiffness", low=0.0, exclusive=True, words=("auto",))
    ] = None,
    material: Annotated[str, mca.Param("of mca.library", choices=("steel", *mca.library.materials()))] = "steel",
{more}) -> mca.Scene:
    steel = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=250e6, E_t=1e9)
    chosen = {{"steel": steel, **mca.library.materials()}}[material]
{parts}
    return mca.drop_test(parts, height=height, pose=pose, onto=onto, mu=mu, struck=struck, penalty=penalty)
'''
_ACROSS = '    across: Annotated[float, mca.Param("elements over a wall", "-", low=0.25, high=64.0)] = 1.0,\n'
_SCALE = '    scale: Annotated[float, mca.Param("metres for one unit of the file", "m", low=1e-12)] = {scale!r},\n'
_BODY = """    part = {part}  # {size}
    kinematics = "finite" if chosen.finite_only else "corotational"
    parts = mca.Body(name="part", geometry=part, material=chosen, kinematics=kinematics)"""
_ASSEMBLY = """    # {size}; materials={{"NAME": ..., "*": ...}} by solid, join={{("NAME", "NAME"): "glue"}} by pair
    parts = mca.Assembly({path}, across=across{scale}, materials={{"*": chosen}}, mu=mu)"""


def is_part(name: str) -> bool:
    """Whether a file of that name holds a part or a mesh, not a scene."""
    from warp_mca.geometry.cad import UNITS

    return Path(name).suffix.lower() in (*UNITS, *MESH_SUFFIXES)


class PartScript(NamedTuple):
    """A scene file that drops a part.

    Attributes:
        text: of the scene file.
        size: sentence on the size of the part, and on the unit in which its file counts.
        unit_named: whether the file names that unit; else it is a guess.
    """

    text: str
    size: str
    unit_named: bool


def part_script(name: str) -> PartScript:
    """A scene file that drops the part in the file `name` on a floor; the file is read for its size and its names.

    Raises:
        RequestError: the file cannot be read.
    """
    from warp_mca.geometry.cad import UNITS, Cad, extent
    from warp_mca.geometry.cad_drawing import file_stamp
    from warp_mca.geometry.cad_solids import inspected
    from warp_mca.geometry.mesh_file import MeshFile
    from warp_mca.watch.units import LONGEST

    path = Path(name).resolve()
    suffix = path.suffix.lower()
    unit, solids, touching = UNITS.get(suffix, 1.0), [], []
    if suffix not in UNITS:
        sides = np.ptp(MeshFile(path).build().points, axis=0)
    elif suffix == ".stl":
        sides = extent(path)
    else:
        solids, touching = inspected(path, unit, file_stamp(path))
        sides = np.max([solid.high for solid in solids], axis=0) - np.min([solid.low for solid in solids], axis=0)
    named = unit != 1.0  # by the file
    if not named and math.hypot(*sides) > LONGEST:
        unit, sides = 1e-3, 1e-3 * sides
        solids, touching = inspected(path, unit, file_stamp(path)) if solids else ([], [])
    size = f"{' x '.join(f'{side:.3g}' for side in sides)} m"
    size += ", by the unit that the file names" if named else f", taken as {_UNIT[unit]} since the file names no unit"
    shown, more = json.dumps(str(path)), "" if suffix not in UNITS else _ACROSS
    more, scale = (more, "") if named else (more + _SCALE.format(scale=unit), ", scale=scale")
    if len(solids) > 1:
        rows = [f"{solid.name} ({1e6 * solid.volume:.4g} cm^3)" for solid in solids]
        listing = [*_listed("Solids, bodies of these names:", rows)]
        listing += _listed("Those that touch, press on each other unless they are joined:", [t.text for t in touching])
        parts = _ASSEMBLY.format(path=shown, scale=scale, size=size)
    else:
        if suffix in UNITS:
            mesh = Cad(path, across=1.0, scale=unit).build()
            code = f"mca.Cad({shown}, across=across{scale})"
        else:
            mesh, code = MeshFile(path, scale=unit).build(), f"mca.MeshFile({shown}{scale})"
        centres = {key: mesh.points[nodes].mean(axis=0) for key, nodes in mesh.node_sets.items() if len(nodes)}
        rows = [f"{key} ({x:.4g}, {y:.4g}, {z:.4g})" for key, (x, y, z) in centres.items()]
        title = "Node sets, with their centres [m]; mca.Surface, mca.Fixed and others name them, mca.Select makes more:"
        listing, parts = _listed(title, rows), _BODY.format(part=code, size=size)
    text = _SCRIPT.format(name=_plain(path.name), listing="\n".join(listing), parts=parts, more=more)
    remedy = "" if named else f"; --set scale={_OTHER[unit]}, scale=0.0254 for inches"
    return PartScript(text, f"{_plain(path.name)} is {size}{remedy}", named)


def script_of_drop(name: str, given: Container[str]) -> str:
    """The scene file of a part that is dropped at once; logs its size, as a warning where the unit is a guess.

    Args:
        name: of the file.
        given: names of the parameters that the command sets.

    Raises:
        RequestError: the file cannot be read.
    """
    script = part_script(name)
    if script.unit_named:
        logging.getLogger(LOGGER).info("%s", script.size)
    elif "scale" not in given:
        warn([script.size])
    return script.text


def _listed(title: str, rows: Sequence[str]) -> list[str]:
    """Lines of a comment."""
    left = [f"and {len(rows) - SHOWN} more"] if len(rows) > SHOWN else []
    return [f"# {title}", *(f"#   {_plain(row)}" for row in [*rows[:SHOWN], *left] or ["none"])]


def _plain(text: str) -> str:
    """The text of a file, which anybody may have written, so that it ends no line and no string of the script."""
    return "".join(c if c.isprintable() and c not in '"\\' else "_" for c in text)


def add_options(group: argparse._ArgumentGroup) -> None:
    """Those of a drop."""
    group.add_argument("--height", type=float, metavar="METRES", help="run the drop of a part from this height")
    group.add_argument(
        "--onto", metavar="FLOOR", help="run it onto a floor: rigid, steel, concrete or wood (default: rigid)"
    )
    group.add_argument(
        "--pose",
        help="run it with this side down: face, edge, corner, one as xmin-zmax, degrees about x and y as 30/45; all: a "
        "sweep over faces, edges and corners of the box around it, 26 (default: face)",
    )


def is_drop(args: argparse.Namespace) -> bool:
    """Whether the options of a drop are given."""
    return any(getattr(args, name, None) is not None for name in OPTIONS)


def check_drop(args: argparse.Namespace) -> None:
    """Refuse options with which no drop of a part is run.

    Raises:
        RequestError: there is one.
    """
    if not is_part(args.scene):
        name = next(name for name in OPTIONS if getattr(args, name, None) is not None)
        remedy = f"it is for parts (.step, .msh, ...); --set changes what {args.scene} has as a parameter"
        raise bad_value(f"--{name}", getattr(args, name), remedy)
    kept = f"print a scene with 'warp-mca run {args.scene} > drop.py', then run that"
    if getattr(args, "units", None) is not None:
        raise bad_value(
            "--units", args.units, f"a deck runs as the scene that it is; leave it or the drop out, or {kept}"
        )
    if args.method != "mca":
        raise bad_value("--method", args.method, f"a drop starts at the impact; {kept}")
    if args.checkpoint is not None:
        raise bad_value("--checkpoint", args.checkpoint, f"a run goes on from a scene file; {kept}")


def print_script(name: str) -> None:
    """Print a scene file for the part in the file `name`, and say on standard error what to do with it.

    Raises:
        RequestError: the file cannot be read.
    """
    made = part_script(name)
    print(made.text, end="")
    script = f"{Path(name).stem}_drop.py"
    deck = Path(name).suffix.lower() in KEYWORD_SUFFIXES
    print(
        f"{made.size}\n"
        f"{Path(name).name} is a part, not a scene: the script on standard output drops it on a floor; save it with "
        f"'warp-mca run {name} > {script}', then run it with 'warp-mca run {script}'"
        + ("; --units t-mm-s, or others, runs the deck's own materials, speeds and contacts" if deck else ""),
        file=sys.stderr,
    )


def no_scene(name: str) -> RequestError:
    """The error that the part in the file `name` is no scene, for commands that make none of it."""
    script = f"{Path(name).stem}_drop.py"
    remedy = f"it is a part, not a scene; make one with 'warp-mca run {name} > {script}', then name {script}"
    return bad_value("scene", name, remedy)
