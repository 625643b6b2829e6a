"""Owns drop tests: parts turned into a pose, just above a floor, with the speed of their fall."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, Literal

import numpy as np

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.scene import library
from warp_mca.scene.absorbing import Absorbing
from warp_mca.scene.bodies import Body, Vec3
from warp_mca.scene.bolts import Bolt
from warp_mca.scene.cad_assembly import Assembly
from warp_mca.scene.contacts import Contact, ContactAll, RigidPlane, Surface
from warp_mca.scene.drop_time import contact_time
from warp_mca.scene.elastic import Elastic
from warp_mca.scene.extent import Extent, extent_of, mesh_of
from warp_mca.scene.phases import ImpactPhase, Settle
from warp_mca.scene.scene import Scene
from warp_mca.scene.struck import PENALTY, finer_where_struck

_SIDES = [signs for signs in product((-1, 0, 1), repeat=3) if any(signs)]
POSES = tuple(
    "-".join(f"{axis}{'max' if sign > 0 else 'min'}" for axis, sign in zip("xyz", signs, strict=True) if sign)
    for signs in sorted(_SIDES, key=lambda signs: sum(map(abs, signs)))
)  # what of the box around the parts meets the floor: 6 faces, 12 edges, 8 corners
NAMED = {"face": "zmin", "edge": "xmin-zmin", "corner": "xmin-ymin-zmin"}
FLOORS: dict[str, Elastic | None] = {
    "rigid": None,
    "steel": library.STRUCTURAL_STEEL,
    "concrete": library.CONCRETE_C30,
    "wood": library.RED_OAK,
}
GAP = 1e-6  # between the lowest node and the floor at the start [m]
_SWELLING = 1e-4  # of the diagonal of the parts: more of it, into which bolts may press them before the fall [-]
_STILL = 1e-3  # of the energy with which bolts move them, which is far less than that of a fall [-]
_SPEED, _PASSES, _ROWS = 5000.0, 20, 400  # of waves in metals [m/s], along the parts in a run, intervals of output
_WIDTH, _DEPTH, _CELLS = 1.25, 0.45, 20  # of a real floor over the diagonal of the parts [-], cells along its width
_ANGLES = re.compile(r"([^/]+)/([^/]+)")


def drop_test(
    parts: Body | Sequence[Body] | Assembly,
    *,
    height: float,
    pose: str = "face",
    onto: str = "rigid",
    mu: float = 0.2,
    contacts: Sequence[Contact | ContactAll] = (),
    gravity: float = 9.81,
    struck: float | str = "auto",
    penalty: float | Literal["auto"] | None = None,
    impact: ImpactPhase | None = None,
    name: str = "drop",
    **more: Any,
) -> Scene:
    """A scene in which parts fall on the floor z = 0; it begins just before the impact, at sqrt(2 g h).

    Args:
        parts: a body, several, or an assembly with its contacts; they are meshed for their boxes and their mass.
        height, gravity: of the fall from rest [m], and g [m/s^2].
        pose: what of the box around the parts meets the floor: one of `POSES`, as "zmin" for a face, "xmax-zmin" for an
            edge, "xmin-ymax-zmin" for a corner; or "face", "edge" or "corner" for the one at least x, y and z. The
            centre of mass is above an edge or a corner. "A/B": turned by A about x, then by B about y [degrees].
        onto: "rigid", or a floor of "steel", "concrete" or "wood" (`mca.library` has their source): an elastic block
            whose other sides let waves out, with 20 cells over 1.25 times the diagonal of the parts.
        mu, penalty: of the contact of all bodies with the floor, as in `Contact`; None: 10 of bodies with finer cells.
        contacts: of the bodies with each other; they become `internal`, so that F_n is the floor's.
        struck: greatest edge of cells where a `Cad` or an `Assembly` strikes [m]; such bodies take strains as large.
            "auto": on an edge, a corner or a round place that yields, the depth that the fall crushes over `across`, or
            a quarter of the size without; a `size` of a body stays. "off": none.
        impact: its phase; None: 400 rows over 20 passes of a wave in metal along the parts, or their contact if longer.
        name, more: of the scene, with other fields of it, as `criteria`; places in space are those above the floor.

    Returns:
        The scene; its parameters are height, pose and onto.

    Raises:
        RequestError: pose or floor are unknown, height or gravity no positive number, or a part cannot be meshed.
    """
    if isinstance(parts, Assembly):
        parts, contacts = parts.bodies, (*parts.contacts, *contacts)
    bodies = (parts,) if isinstance(parts, Body) else tuple(parts)
    _check(bodies, contacts, onto, more)
    validate.positive("drop_test", height=height, gravity=gravity)
    extent = extent_of(bodies)
    gap, more = _settled(more, extent)
    placed = _struck_bodies(bodies, extent, pose_rotation(pose, extent), gap, height * gravity, _size_asked(struck))
    down: Vec3 = (0.0, 0.0, -gravity)
    floor = _floor(onto, extent.diagonal)
    sides = tuple(Absorbing(body="floor", nodes=side, centre=(0.0, 0.0, 0.0)) for side in _OPEN) if floor else ()
    return Scene(
        name=name,
        bodies=tuple(body.drop(height, down) for body in placed) + ((floor,) if floor else ()),
        contacts=_contacts(contacts, bodies, placed, floor, mu, penalty),
        absorbing=(*more.pop("absorbing", ()), *sides),
        gravity=down,
        impact=impact or _phase(extent, placed, math.sqrt(2.0 * gravity * height), FLOORS[onto]),
        parameters={"height": float(height), "pose": pose, "onto": onto},
        **more,
    )


def _phase(extent: Extent, placed: Sequence[Body], speed: float, floor: Elastic | None) -> ImpactPhase:
    """Long enough for waves along the parts and for their contact with the floor."""
    bodies = [body for body in placed if not body.is_inertia]
    touching = contact_time(bodies, [mesh_of(body) for body in bodies], extent.mass, speed, floor)
    duration = max(_PASSES * extent.diagonal / _SPEED, touching)
    return ImpactPhase(duration=duration, output_interval=duration / _ROWS)


def _struck_bodies(
    bodies: Sequence[Body], extent: Extent, turn: Array, gap: float, gravity_height: float, struck: float | str
) -> list[Body]:
    """Bodies in their pose, with finer cells where they strike; `gravity_height` is g h [m^2/s^2]."""
    placed = _placed(bodies, turn, gap)
    finer = finer_where_struck(placed, [mesh_of(body) for body in bodies], extent.mass * gravity_height, struck)
    # placed again, since nodes of smaller cells on round faces may lie lower
    return _placed(finer, np.eye(3), gap) if finer else placed


def _size_asked(struck: float | str) -> float | str:
    """The size of cells where parts strike, which a command line gives as text: "auto", "off" or metres.

    Raises:
        RequestError: it is none of them.
    """
    if struck in ("auto", "off"):
        return struck
    try:
        struck = float(struck) if isinstance(struck, str) else struck
    except ValueError:
        raise bad_value("drop_test.struck", struck, "choose auto, off, or a size of cells [m]") from None
    validate.positive("drop_test", struck=struck)
    return struck


def _settled(more: dict[str, Any], extent: Extent) -> tuple[float, dict[str, Any]]:
    """Gap to the floor [m], and the fields of a scene, whose bolts are tightened before the impact."""
    if not any(isinstance(load, Bolt) and load.preload for load in more.get("loads", ())):
        return GAP, more
    return GAP + _SWELLING * extent.diagonal, {"phases": (Settle(falling=True, tolerance=_STILL),), **more}


def _check(bodies: Sequence[Body], contacts: Sequence[object], onto: str, more: Mapping[str, object]) -> None:
    """Raise RequestError for what no drop can be of."""
    validate.members("drop_test", Body, parts=bodies)
    validate.members("drop_test", (Contact, ContactAll), contacts=contacts)
    if not bodies:
        raise bad_value("drop_test.parts", (), "give at least one body")
    if onto not in FLOORS:
        raise bad_value("drop_test.onto", validate.brief(onto), f"choose {', '.join(FLOORS)}")
    for field in {"bodies", "parameters"} & set(more):
        raise bad_value(f"drop_test.{field}", validate.brief(more[field]), "drop_test makes it; leave it out")


def _contacts(
    contacts: Sequence[Contact | ContactAll],
    bodies: Sequence[Body],
    placed: Sequence[Body],
    floor: Body | None,
    mu: float,
    penalty: float | Literal["auto"] | None,
) -> tuple[Contact | ContactAll, ...]:
    """The contacts of the bodies with each other, and of each with the floor, which has none with itself.

    Without a penalty springs are stiffer of bodies whose geometry in their place has finer cells.
    """
    master = Surface(body="floor", nodes="zmax") if floor else RigidPlane(normal=(0.0, 0.0, 1.0))
    skins = [Surface(body=body.name, nodes="boundary") for body in bodies if not body.is_inertia]
    among = [replace(c, internal=True) for c in contacts]
    if floor:
        itself = ("floor", "floor")
        among = [replace(c, exclude=(*c.exclude, itself)) if isinstance(c, ContactAll) else c for c in among]
    finer = {b.name: PENALTY for a, b in zip(bodies, placed, strict=True) if _places(a) != _places(b)}
    chosen: dict[str, float | Literal["auto"] | None]
    chosen = {skin.body: finer.get(skin.body) if penalty is None else penalty for skin in skins}
    return (*among, *(Contact(slave=skin, master=master, mu=mu, penalty=chosen[skin.body]) for skin in skins))


def _places(body: Body) -> object:
    """Places with finer cells in a body's geometry."""
    return getattr(body.geometry, "finer", ())


_OPEN = ("xmin", "xmax", "ymin", "ymax", "zmin")  # sides of a real floor that let waves out


def pose_rotation(pose: str, extent: Extent) -> Array:
    """Matrix that turns parts from the frame in which they are given into a pose above z = 0, shape (3, 3), float64.

    Raises:
        RequestError: there is no such pose.
    """
    remedy = f"choose {', '.join(NAMED)}, one of POSES, as {', '.join(POSES[::9])}, or two angles, as 30/45"
    if not isinstance(pose, str):
        raise bad_value("drop_test.pose", validate.brief(pose), remedy)
    if angles := _ANGLES.fullmatch(pose):
        try:
            a, b = (math.radians(float(angle)) for angle in angles.groups())
        except ValueError:
            raise bad_value("drop_test.pose", pose, remedy) from None
        if not math.isfinite(a + b):
            raise bad_value("drop_test.pose", pose, remedy)
        return rotation_matrix((0.0, b, 0.0)) @ rotation_matrix((a, 0.0, 0.0))
    side = NAMED.get(pose, pose)
    if side not in POSES:
        raise bad_value("drop_test.pose", pose, remedy)
    down = np.zeros(3)
    for word in side.split("-"):
        axis = "xyz".index(word[0])
        down[axis] = (extent.low if word.endswith("min") else extent.high)[axis] - extent.centre[axis]
    return _turning(down / np.linalg.norm(down))


def _turning(down: Array) -> Array:
    """The smallest rotation that turns a unit vector to -z; about x where it is +z."""
    target = np.array([0.0, 0.0, -1.0])
    axis = np.cross(down, target)
    sine, cosine = float(np.linalg.norm(axis)), float(down @ target)
    if sine < 1e-12:
        return np.eye(3) if cosine > 0.0 else np.diag([1.0, -1.0, -1.0])
    return rotation_matrix(axis / sine * math.atan2(sine, cosine))


def _placed(bodies: Sequence[Body], turn: Array, gap: float) -> list[Body]:
    """Bodies turned about the origin, then moved so that the lowest node is `gap` [m] above z = 0, the middle on z."""
    from scipy.spatial.transform import Rotation

    turned, lows, highs = [], [], []
    for body in bodies:
        rotation = turn @ rotation_matrix(np.array(body.rotation))
        position = turn @ np.array(body.position)
        points = mesh_of(body).points @ rotation.T + position
        lows.append(points.min(axis=0))
        highs.append(points.max(axis=0))
        turned.append((body, rotation, position))
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    shift = np.array([*(-0.5 * (low + high)[:2]), gap - low[2]])
    return [
        replace(
            body,
            position=tuple((position + shift).tolist()),
            rotation=tuple(Rotation.from_matrix(rotation).as_rotvec().tolist()),
            velocity=tuple((turn @ np.array(body.velocity)).tolist()),
            angular_velocity=tuple((turn @ np.array(body.angular_velocity)).tolist()),
        )
        for body, rotation, position in turned
    ]


def _floor(onto: str, length: float) -> Body | None:
    """A block below z = 0 for parts of this diagonal [m]; None for a rigid floor."""
    from warp_mca.geometry.box import Box

    material = FLOORS[onto]
    if material is None:
        return None
    width, depth = _WIDTH * length, _DEPTH * length
    cells = (_CELLS, _CELLS, round(_CELLS * depth / width))
    block = Box(size=(width, width, depth), divisions=cells, origin=(-0.5 * width, -0.5 * width, -depth))
    return Body(name="floor", geometry=block, material=material)
