"""Owns `read_deck`: a scene from an LS-DYNA keyword deck."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.decks.bodies import DeckBody, body_of, deck_bodies, deck_parts
from warp_mca.decks.cards import Content
from warp_mca.decks.contacts import Contacts, ties
from warp_mca.decks.materials import materials
from warp_mca.decks.motion import Motion, gravity, held_nodes
from warp_mca.decks.places import Places
from warp_mca.decks.units import Units
from warp_mca.geometry.end_marks import missing_end
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.quality import volumes
from warp_mca.scene.articulations import Articulation
from warp_mca.scene.bodies import Body
from warp_mca.scene.drives import Fixed
from warp_mca.scene.freedoms import Freedom
from warp_mca.scene.phases import ImpactPhase
from warp_mca.scene.scene import Scene

ROWS = 400  # of the history
QUADRATIC, LINEAR = 1.5, 0.06  # coefficients of bulk viscosity that decks have by default
NO_WORD = 0.05  # share of the stable step that may be lost with the default, 0.9 of it
FLATTEST = 0.05  # share of the stable step below which the estimate does not go


def read_deck(path: str | Path, units: str, leave_out: Sequence[str] = ()) -> Scene:
    """A scene from an LS-DYNA keyword deck and the files that it includes, in SI units.

    A keyword that is not understood is refused with its line, unless it is known to change no result, as *DATABASE_...;
    these are listed. What is taken otherwise than LS-DYNA does is said in a warning, which the run keeps. What is read:

    - *PART, *SECTION_SOLID: a body, one for parts that share nodes, with finite strain. ELFORM 1 is hex8r, 2 hex8,
      -1, -2 and 18 hex8i; tetrahedra are tet4 or tet10, wedges wedge6 where the element allows.
    - *MAT_ELASTIC, *MAT_PLASTIC_KINEMATIC (any beta; with rates 1), *MAT_RIGID (constraints along the world's axes),
      *MAT_PIECEWISE_LINEAR_PLASTICITY (points or a curve), *MAT_JOHNSON_COOK, with *EOS_LINEAR_POLYNOMIAL of C1 alone:
      the same laws, with failure by strain. Rates are those of plastic strain.
    - *INITIAL_VELOCITY, _NODE, _GENERATION, _RIGID_BODY: a rigid motion of each body.
    - *BOUNDARY_SPC_NODE, _SET, codes of *NODE: `Fixed` along axes of the world.
    - *CONTACT_AUTOMATIC_SINGLE_SURFACE: `ContactAll`; _SURFACE_TO_SURFACE, _NODES_TO_SURFACE, also ONE_WAY: `Contact`,
      with the springs of this program; *CONTACT_TIED_...: `Tie` of the faces that meet.
    - *RIGIDWALL_PLANAR: `RigidPlane` for the nodes that it names, with penalty 10. *LOAD_BODY_X, _Y, _Z: gravity, or
      `BodyForce` where its curve changes.
    - *CONTROL_TERMINATION, *CONTROL_TIMESTEP (TSSFAC, DT2MS), *CONTROL_BULK_VISCOSITY, by default 0.06 and 1.5:
      `ImpactPhase`. The step does not follow cells that flatten, see `flattening`.
    - *INCLUDE, *INCLUDE_PATH, *PARAMETER, *PARAMETER_EXPRESSION; *SET_NODE (list, range, box, part), *SET_PART,
      *SET_SEGMENT; *DEFINE_BOX, *DEFINE_COORDINATE_SYSTEM, _NODES, _VECTOR, *DEFINE_CURVE.

    Args:
        path: of the deck.
        units: "SI", "t-mm-s", "kg-mm-ms", "g-mm-ms" or "g-cm-us": masses, lengths and times of the deck.
        leave_out: keywords to be left out, as patterns, such as "DAMPING_*".

    Raises:
        RequestError: the deck cannot be read, or has what a scene cannot have.
    """
    if not isinstance(path, (str, Path)):
        raise bad_value("deck", validate.brief(path), "give the path of a keyword file")
    if isinstance(leave_out, str) or not all(isinstance(name, str) for name in leave_out):
        raise bad_value("leave_out", validate.brief(leave_out), 'give a list of keywords, as ["DAMPING_GLOBAL"]')
    own, path = Units(units), Path(path)
    try:
        if not path.is_file():
            raise bad_value("deck", str(path), "there is no such file; check the path")
        return _scene(path, own, [name.upper().lstrip("*") for name in leave_out])
    except RequestError:
        raise
    except (ValueError, OSError, IndexError, OverflowError) as error:
        raise bad_value("deck", str(path), str(error)) from error


def _scene(path: Path, units: Units, leave_out: Sequence[str]) -> Scene:
    content = Content(path, units, leave_out)
    if mark := missing_end(path):
        content.notes.append(f"{path} lacks {mark}: if it was cut off, something is missing")
    places = Places(content)
    parts = deck_parts(content, materials(content, places))
    found = deck_bodies(content, parts)
    motion = Motion(content, places)
    duration = _duration(content)
    held = held_nodes(content, places, motion, found)
    touching = Contacts(content, places, found, duration)
    moved = {body.name: motion.of_body(body) for body in found}
    bodies = [body_of(content, path, body, moved[body.name]) for body in found]
    meshes = {body.name: geometry_of(body) for body in bodies}
    acceleration, loads = gravity(content, places, found, duration)
    constraints = [item for body, own in zip(bodies, found, strict=True) for item in _constraints(body, own)]
    impact = _impact(content, duration, bodies, motion)
    bound = ties(touching.ties, meshes)
    notes = tuple(dict.fromkeys(content.notes))
    for note in notes:
        logging.getLogger("warp_mca").warning("%s", note)
    first = geometry_of(bodies[0])
    bodies[0] = replace(bodies[0], geometry=replace(first, notes=(*first.notes, *notes)))
    return Scene(
        name=path.stem,
        bodies=tuple(bodies),
        contacts=tuple(touching.contacts),
        ties=tuple(bound),
        fixed=tuple(item for item in (*held, *constraints) if isinstance(item, Fixed)),
        prescribed=tuple(item for item in held if not isinstance(item, Fixed)),
        joints=tuple(item for item in constraints if isinstance(item, Articulation)),
        loads=tuple(loads),
        gravity=acceleration,
        impact=impact,
    )


def geometry_of(body: Body) -> Mesh:
    """The finished mesh of a body of a deck."""
    assert isinstance(body.geometry, Mesh)
    return body.geometry


def _duration(content: Content) -> float:
    """End of the run [s]."""
    card = content.last("termination", "endtim endcyc dtmin endeng endmas nosol")
    if card is None or not card.number("endtim", "time") > 0.0:
        raise ValueError("no *CONTROL_TERMINATION gives an end above 0; add it")
    card.refuse("endcyc", "give the end by ENDTIM alone")
    if any(card.number(name) for name in ("dtmin", "endeng", "endmas")):
        content.notes.append(f"{card.place}: DTMIN, ENDENG and ENDMAS are left out: guards of this program end a run")
    return card.number("endtim", "time")


def _impact(content: Content, duration: float, bodies: Sequence[Body], motion: Motion) -> ImpactPhase:
    """The phase of finite elements: its end, steps and viscosity.

    LS-DYNA's step follows the cells as they flatten, here it is that of the start: TSSFAC is lowered for bodies that
    strike fast for their yield stress.
    """
    scale, more = 0.9, dict[str, Any]()
    if card := content.last("time_step", "dtinit tssfac isdo tslimt dt2ms lctm erode ms1st"):
        card.refuse("dtinit lctm erode", "the step is that of the smallest cell; set it to 0")
        scale = min(card.number("tssfac") or scale, 1.0)
        step = card.number("dt2ms", "time")
        if step > 0.0:
            raise ValueError(f"{card.place}: DT2MS above 0 is not read: give it below 0, where small cells gain mass")
        if step < 0.0:
            more["mass_scaling"] = f"{-step!r}s"
    quadratic, linear = QUADRATIC, LINEAR
    if card := content.last("viscosity", "q1 q2 type"):
        quadratic, linear = card.number("q1", default=QUADRATIC), card.number("q2", default=LINEAR)
    share = flattening(bodies, motion)
    if share < 1.0 - NO_WORD:
        scale = float(f"{scale * share:.2g}")
        content.notes.append(
            f"{content.mesh.deck.path}: the step is {scale:g} of the stable one, as cells may flatten at this speed"
        )
    return ImpactPhase(
        duration=duration,
        output_interval=duration / ROWS,
        time_step_scale=scale,
        bulk_viscosity=(linear, quadratic),
        **more,
    )


def flattening(bodies: Sequence[Body], motion: Motion) -> float:
    """Share of the stable step that is left when the end of a bar has flattened, 1 where speeds are low [-].

    A bar that strikes a wall with v has the strain e at its foot, e^2 / (1 - e) = rho v^2 / sigma_y (Hawkyard, Int. J.
    Mech. Sci. 11 (1969) 313); cells at the rim flatten by more, some (1 - e)^2.
    """
    speeds = np.linalg.norm(motion.velocities, axis=1)
    v = float(speeds.max()) if len(speeds) else 0.0
    share = 1.0
    for body in bodies:
        laws = body.material.values() if isinstance(body.material, Mapping) else (body.material,)
        for law in laws:
            if body.rigid or not math.isfinite(law.yield_stress):
                continue
            D = law.rho * v * v / law.yield_stress
            e = 0.5 * (math.sqrt(D * D + 4.0 * D) - D)
            share = min(share, (1.0 - e) ** 2)
    return max(share, FLATTEST)


def _constraints(body: Body, own: DeckBody) -> list[Fixed | Articulation]:
    """What holds a rigid part, by the codes of *MAT_RIGID.

    Raises:
        ValueError: two rotations are free, which no joint is.
    """
    part = own.parts[0]
    shifts, turns = part.material.held
    if not own.rigid or not (shifts or turns):
        return []
    if len(shifts) == len(turns) == 3:
        return [Fixed(body=body.name, nodes="boundary", axes="xyz")]
    free = [axis for axis in "xyz" if axis not in turns]
    if len(free) == 2:
        raise ValueError(
            f"{part.place}: part {part.number} is held about one axis, which is not read; hold it about all"
        )
    mesh = geometry_of(body)
    units = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    weight = volumes(mesh)
    middles = np.concatenate([mesh.points[cells].mean(axis=1) for cells in mesh.cells.values()])
    x, y, z = (float(value) for value in weight @ middles / weight.sum())
    freedoms = [Freedom(kind="slide", axis=units[axis]) for axis in "xyz" if axis not in shifts]
    if len(free) == 3:
        freedoms.append(Freedom(kind="ball"))
    else:
        freedoms += [Freedom(axis=units[axis]) for axis in free]
    return [Articulation(name=f"{body.name} held", body=body.name, at=(x, y, z), freedoms=tuple(freedoms))]
