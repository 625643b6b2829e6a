"""Owns the answer to `warp-mca run part.step`: a scene file that drops the part on a floor, to start from."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.geometry.keyword_file import KEYWORD_SUFFIXES

MESH_SUFFIXES = (".msh", ".unv", ".bdf", ".nas", ".fem", ".inp", ".k", ".key", ".dyn", ".vtu", ".vtk", ".med")
CELLS = 8  # ten-node tetrahedra along the diagonal of a CAD part
SPEED = 5000.0  # of waves in metals [m/s]
PASSES = 20  # of a wave along the part in the simulated time
ROWS = 400  # of the history
SHOWN = 12  # node sets that the script lists

_SCRIPT = '''"""{name} falls on a rigid floor."""

import warp_mca as mca

# Node sets, with their centres [m]; mca.Surface, mca.Fixed and others name them, mca.Select makes more:
{sets}


def build(*, height: float = 0.5, mu: float = 0.2) -> mca.Scene:
    steel = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=250e6, E_t=1e9)
    part = {part}  # {unit}
    floor, gravity = mca.RigidPlane(normal=(0.0, 0.0, 1.0)), (0.0, 0.0, -9.81)
    body = mca.Body(name="part", geometry=part, material=steel).place_on(floor, gap=1e-6).drop(height, gravity)
    return mca.Scene(
        name="drop",
        bodies=(body,),
        contacts=(mca.Contact(slave=mca.Surface(body="part", nodes="boundary"), master=floor, mu=mu),),
        gravity=gravity,
        impact=mca.ImpactPhase(duration={duration:.2g}, output_interval={interval:.2g}),
    )
'''


def is_part(name: str) -> bool:
    """Whether a file of that name holds a part or a mesh, not a scene."""
    from warp_mca.geometry.cad import UNITS

    return Path(name).suffix.lower() in (*UNITS, *MESH_SUFFIXES)


def part_script(name: str) -> str:
    """A scene file that drops the part in the file `name` on a floor; the part is meshed for its size and node sets.

    Raises:
        RequestError: the file cannot be read.
    """
    from warp_mca.geometry.cad import UNITS, Cad, extent
    from warp_mca.geometry.mesh_file import MeshFile
    from warp_mca.watch.units import LONGEST

    path = Path(name).resolve()
    is_cad = path.suffix.lower() in UNITS
    scale = UNITS.get(path.suffix.lower(), 1.0)
    diagonal = extent(path) if is_cad else math.hypot(*np.ptp(MeshFile(path).build().points, axis=0))
    if scale == 1.0 and diagonal > LONGEST:  # the file names no unit
        scale, diagonal = 1e-3, 1e-3 * diagonal
    if is_cad:
        part = Cad(path, size=float(f"{diagonal / CELLS:.2g}"), scale=scale)
        code = f"mca.Cad({json.dumps(str(path))}, size={part.size:g}, scale={scale:g})"
    else:
        part, code = MeshFile(path, scale=scale), f"mca.MeshFile({json.dumps(str(path))}, scale={scale:g})"
    mesh = part.build()
    centres = {key: mesh.points[nodes].mean(axis=0) for key, nodes in mesh.node_sets.items() if len(nodes)}
    rows = [f"#   {key} ({x:.4g}, {y:.4g}, {z:.4g})" for key, (x, y, z) in list(centres.items())[:SHOWN]]
    rows += [f"#   and {len(centres) - SHOWN} more"] if len(centres) > SHOWN else []
    duration = PASSES * diagonal / SPEED
    return _SCRIPT.format(
        name=path.name,
        sets="\n".join(rows or ["#   none"]),
        part=code,
        unit="millimetres" if scale == 1e-3 else "metres",
        duration=duration,
        interval=float(f"{duration:.2g}") / ROWS,
    )


def print_script(name: str) -> None:
    """Print a scene file for the part in the file `name`, and say on standard error what to do with it.

    Raises:
        RequestError: the file cannot be read.
    """
    print(part_script(name), end="")
    script = f"{Path(name).stem}_drop.py"
    deck = Path(name).suffix.lower() in KEYWORD_SUFFIXES
    print(
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
