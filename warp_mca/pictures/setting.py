"""Owns the setting of pictures: which way is up, where the eye is, what is shown how large, rigid planes as meshes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene import RigidPlane, Scene

Array = NDArray[np.floating]

EYE = np.array([0.30, 0.35, 0.89])  # direction to the eye: right, upwards and to the viewer
PIXELS = (50, 8000)  # least and most along the longer side of a picture
CHECKS = 12  # squares along a side of a plane, at least
BEYOND = 0.5  # how far a plane reaches beyond the bodies, as a share of their size
TURN = 1.5  # how many times deeper than wide bodies are that are looked at from the side


@dataclass(frozen=True, kw_only=True)
class View:
    """What pictures show and from where: snapshots, films and the interactive plotter.

    Attributes:
        pixels: along the longer side; None for 800, of films 600.
        camera: direction from the bodies to the eye in the world frame, of any length [-]; None for one from the front
            right above.
        hidden: names of bodies that are left out.
    """

    pixels: int | None = None
    camera: tuple[float, float, float] | None = None
    hidden: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        low, high = PIXELS
        whole = isinstance(self.pixels, int | np.integer) and not isinstance(self.pixels, bool)
        if self.pixels is not None and not (whole and low <= self.pixels <= high):
            raise bad_value("View.pixels", validate.brief(self.pixels), f"give a whole number from {low} to {high}")
        if self.camera is not None:
            validate.vectors("View", camera=self.camera)
            if not any(self.camera):
                raise bad_value("View.camera", self.camera, "give a direction other than zero")
        validate.kind_of("View.hidden", self.hidden, (tuple, list), 'give a tuple of names, as ("floor",)')

    def check(self, bodies: Iterable[str]) -> None:
        """Refuse to hide what is not there, or everything.

        Raises:
            RequestError: so it is.
        """
        known = list(bodies)
        for name in self.hidden:
            if name not in known:
                raise bad_value("View.hidden", validate.brief(name), f"choose among {', '.join(known)}")
        if known and not set(known) - set(self.hidden):
            raise bad_value("View.hidden", tuple(self.hidden), "nothing would be left to show; leave one out")


VIEW = View()


def up_of(scene: Scene) -> Array:
    """Unit vector that points up in pictures of the scene, shape (3,), float64.

    It is `Scene.up`; else opposite to gravity; else the normal of the first rigid plane, which is a floor then; else y.
    """
    up = np.array(scene.up if scene.up is not None else [0.0, 0.0, 0.0])
    if scene.up is None and any(scene.gravity):
        up = -np.array(scene.gravity)
    elif scene.up is None:
        up = np.array(next((plane.normal for plane in rigid_planes(scene)), (0.0, 1.0, 0.0)))
    return up / np.linalg.norm(up)


def view_axes(up: Array, extent: Array | None = None) -> Array:
    """Directions to the right, upwards and to the viewer, as rows, shape (3, 3), float64.

    The viewer looks along -z where that is level, along y otherwise; bodies that are much deeper than wide are looked
    at from the side.

    Args:
        up: unit vector, shape (3,).
        extent: of the bodies along x, y and z [m], shape (3,); None where their shape does not matter.
    """
    viewer = np.array([0.0, 0.0, 1.0]) if abs(up[2]) < 0.8 else np.array([0.0, -1.0, 0.0])
    viewer -= (viewer @ up) * up
    viewer /= np.linalg.norm(viewer)
    right = np.cross(up, viewer)
    if extent is not None and np.abs(viewer) @ extent > TURN * (np.abs(right) @ extent):
        right, viewer = -viewer, right
    return np.array([right, up, viewer])


def eye_axes(up: Array, extent: Array, camera: tuple[float, float, float] | None = None) -> Array:
    """Directions to the right, upwards and to the eye, as rows, shape (3, 3); `camera` as in `View`."""
    axes = view_axes(up, extent)
    eye = EYE @ axes if camera is None else np.array(camera, dtype=float)
    eye = eye / np.linalg.norm(eye)
    right = np.cross(up, eye)
    if np.linalg.norm(right) < 1e-6:  # from right above or below
        right = axes[0]
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(eye, right), eye])


@dataclass(frozen=True)
class PlaneMesh:
    """A part of a rigid plane as a chequered mesh, so that one sees it move.

    Attributes:
        points: corners of its squares at t = 0 [m], shape (point_count, 3), float64.
        quads: counter-clockwise from the free side, shape (square_count, 4), int32.
        dark: whether each square is a dark one, shape (square_count,), bool.
        normal: unit vector to the free side [-], shape (3,), float64.
        velocity: of the plane along itself [m/s], shape (3,), float64.
        period: after which way along the velocity the pattern repeats [m].
    """

    points: Array
    quads: NDArray[np.int32]
    dark: NDArray[np.bool_]
    normal: Array
    velocity: Array
    period: float

    @cached_property
    def moves(self) -> bool:
        """Whether the plane moves."""
        return bool(self.velocity.any())

    def shift(self, time: float) -> Array:
        """How far the pattern is moved at `time` [s], less whole periods [m], shape (3,)."""
        speed = float(np.linalg.norm(self.velocity))
        return self.velocity / speed * ((speed * time) % self.period) if speed else np.zeros(3)


def rigid_planes(scene: Scene) -> list[RigidPlane]:
    """The rigid planes of a scene's contacts, each once."""
    found: list[RigidPlane] = []
    for contact in scene.listed:
        if isinstance(contact.master, RigidPlane) and contact.master not in found:
            found.append(contact.master)
    return found


def plane_meshes(scene: Scene, points: NDArray[np.floating]) -> list[PlaneMesh]:
    """The rigid planes of a scene as far as bodies with these points [m], shape (point_count, 3), cover them."""
    return [plane_mesh(plane, points, up_of(scene)) for plane in rigid_planes(scene)]


def plane_mesh(plane: RigidPlane, points: NDArray[np.floating], up: Array) -> PlaneMesh:
    """A rigid plane as far as bodies with these points [m], shape (point_count, 3), cover it; `up` as from `up_of`."""
    normal = np.array(plane.normal) / np.linalg.norm(plane.normal)
    velocity = np.array(plane.velocity)
    along = velocity if velocity.any() else view_axes(up)[0] - (view_axes(up)[0] @ normal) * normal
    if np.linalg.norm(along) < 1e-3:  # the plane faces the direction that is to the right in pictures
        along = up - (up @ normal) * normal
    along = along / np.linalg.norm(along)
    axes = np.array([along, np.cross(normal, along)])
    flat = (points - np.array(plane.point)) @ axes.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    reach = BEYOND * float(np.ptp(points, axis=0).max())
    square = rounded((float((high - low).max()) + 2.0 * reach) / CHECKS)
    first = np.floor((low - reach) / square).astype(int)
    last = np.ceil((high + reach) / square).astype(int)
    s, t = (np.arange(a, b + 1) for a, b in zip(first, last, strict=True))
    corner = np.stack(np.meshgrid(s, t, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(corner)).reshape(len(s), len(t))
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    return PlaneMesh(
        points=np.array(plane.point) + square * corner @ axes,
        quads=quads.astype(np.int32),
        dark=corner[quads[:, 0]].sum(axis=1) % 2 == 1,
        normal=normal,
        velocity=velocity,
        period=2.0 * square,
    )


def rounded(length: float) -> float:
    """The next length below that is 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** np.floor(np.log10(length))
    return decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= length)
