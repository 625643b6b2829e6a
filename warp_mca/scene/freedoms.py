"""Owns the freedoms of joints between whole bodies: hinges, slides, balls, and what drives, holds and slows them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import NoneType
from typing import Literal

import numpy as np

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.scene.amplitude import Amplitude
from warp_mca.scene.bodies import Vec3

MOST = 1e12  # of stiffnesses, torques and inertias of freedoms


@dataclass(frozen=True, kw_only=True)
class PositionServo:
    """A motor that follows a position: its torque or force is kp (target - q) - kv q', within limits.

    Attributes:
        kp: [N m/rad], or [N/m] of a slide.
        kv: [N m s/rad], or [N s/m]; it acts as a damper, without delay.
        target: position [rad] or [m]; a number, or an `Amplitude` whose values are positions.
        limits: least and greatest torque [N m] or force [N]; None for no limits.
    """

    kp: float
    kv: float = 0.0
    target: float | Amplitude = 0.0
    limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.within("PositionServo", 0.0, MOST, kp=self.kp, kv=self.kv)
        if not isinstance(self.target, Amplitude):
            validate.within("PositionServo", -MOST, MOST, target=self.target)
        if self.limits is not None:
            check_limits("PositionServo", self.limits)

    @property
    def table(self) -> Amplitude:
        """The target over time."""
        return self.target if isinstance(self.target, Amplitude) else Amplitude(times=(0.0,), values=(self.target,))


@dataclass(frozen=True, kw_only=True)
class Controller:
    """A motor whose torque a Python function gives, which is asked at intervals; between them the torque is held.

    One object may drive several freedoms: the function then sees all of them, in the order of the scene's joints.
    Model files and batches take none. A run that goes on from a checkpoint repeats all calls before, so that a function
    with a state of its own has it again, and refuses one that then gives other numbers.

    Attributes:
        function: called as function(t, q, rate) with the time since the start of the impact phase [s], positions [rad]
            or [m] and rates half a step before [rad/s] or [m/s], each shape (freedom_count,), float64; returns torques
            [N m] or forces [N], likewise, or one number for all.
        period: between two calls [s], a multiple of `ImpactPhase.output_interval`.
    """

    function: Callable[[float, Array, Array], Array | Sequence[float] | float]
    period: float

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise bad_value("Controller.function", validate.brief(self.function), "give a function of t, q and rate")
        validate.times("Controller", period=self.period)

    def torques(self, t: float, positions: Array, rates: Array) -> Array:
        """What the function gives, shape (freedom_count,), float64.

        Raises:
            RequestError: it fails, or gives something else than finite numbers.
        """
        name = getattr(self.function, "__name__", type(self.function).__name__)
        given = validate.call("Controller.function", name, "it", self.function, t, positions, rates)
        try:
            found = np.broadcast_to(np.asarray(given, dtype=np.float64), positions.shape)
        except (TypeError, ValueError, OverflowError):
            found = np.full(1, np.nan)
        if not np.isfinite(found).all():
            remedy = f"at {t:g} s it gives {validate.brief(given)}; return {len(positions)} finite numbers"
            raise bad_value("Controller.function", name, remedy)
        return found


@dataclass(frozen=True, kw_only=True)
class Coupler:
    """Makes a freedom move in proportion to another one, as gears, belts, racks and mimic joints do, without play.

    Attributes:
        joint: name of the joint that has the other freedom.
        freedom: number of that among the freedoms there, from 1.
        ratio: way of this freedom over that of the other one [-], or [m/rad], [rad/m] between a slide and a hinge.
    """

    joint: str
    freedom: int = 1
    ratio: float = 1.0

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Coupler", joint=self.joint)
        validate.counts("Coupler", freedom=self.freedom)
        validate.within("Coupler", -MOST, MOST, ratio=self.ratio)


@dataclass(frozen=True, kw_only=True)
class Freedom:
    """A hinge or a slide along an axis, or a ball joint about a point, of a joint between whole bodies.

    The axis and the point are given in the frame of the joint's `body`, in the pose where all positions of the joint
    are 0; of several freedoms the first carries the second, as joints of a body do in MuJoCo. Positive positions turn
    `body` about the axis, or move it along, relative to `other`. Units in brackets are those of hinges, then of slides.

    Attributes:
        kind: "hinge", "slide" or "ball".
        axis: direction [-], of any length; a ball has none.
        at: point of the axis, or of a ball [m]; None takes that of the joint.
        position: q in the pose in which the scene places the bodies [rad], [m].
        stiffness: of a spring [N m/rad], [N/m].
        rest: position at which the spring is at rest [rad], [m]. That of a ball gives the torque -k r, r the rotation
            vector from rest; its `rest` is the rotation vector in the body's frame from the pose in which the scene
            places the bodies, or 0 for that pose.
        damping: of a viscous damper [N m s/rad], [N s/m]; a ball has one about all axes.
        friction: greatest torque [N m] or force [N] of Coulomb friction.
        friction_rate: rate above which friction is whole: it is `friction` times tanh(q' / friction_rate) [rad/s],
            [m/s].
        armature: inertia of a rotor that turns at the rate of the joint [kg m^2], [kg]; of a ball about all axes.
        limits: least and greatest position [rad], [m]; None for no limits.
        limit_stiffness: of the springs beyond the limits [N m/rad], [N/m]. They shorten the time step where their
            frequency asks for it.
        limit_damping: of a damper that acts beyond the limits [N m s/rad], [N s/m].
        motor: torque [N m] or force [N] over time as an `Amplitude`, a `PositionServo`, or a `Controller`; times count
            from the start of the impact phase.
        follows: another freedom to which this one is geared; forces of the gear do no work. None for none.
    """

    kind: Literal["hinge", "slide", "ball"] = "hinge"
    axis: Vec3 = (0.0, 0.0, 1.0)
    at: Vec3 | None = None
    position: float = 0.0
    stiffness: float = 0.0
    rest: float | Vec3 = 0.0
    damping: float = 0.0
    friction: float = 0.0
    friction_rate: float = 1e-3
    armature: float = 0.0
    limits: tuple[float, float] | None = None
    limit_stiffness: float = 1e6
    limit_damping: float = 0.0
    motor: Amplitude | PositionServo | Controller | None = None
    follows: Coupler | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.choice("Freedom", ("hinge", "slide", "ball"), kind=self.kind)
        owner = f"Freedom {self.kind}"
        validate.directions(owner, axis=self.axis)
        if self.at is not None:
            validate.vectors(owner, at=self.at)
        validate.within(owner, -MOST, MOST, position=self.position)
        if self.kind == "ball" and self.rest != 0.0:
            validate.vectors(owner, rest=self.rest)  # type: ignore[arg-type]
        else:
            validate.within(owner, -MOST, MOST, rest=self.rest)  # type: ignore[arg-type]
        validate.within(
            owner,
            0.0,
            MOST,
            stiffness=self.stiffness,
            damping=self.damping,
            friction=self.friction,
            armature=self.armature,
            limit_stiffness=self.limit_stiffness,
            limit_damping=self.limit_damping,
        )
        validate.positive(owner, friction_rate=self.friction_rate)
        if self.limits is not None:
            check_limits(owner, self.limits)
            if self.limit_stiffness == 0.0:
                remedy = "springs of limits need a stiffness above 0; give one, or leave limits out"
                raise bad_value(f"{owner}.limit_stiffness", self.limit_stiffness, remedy)
        remedy = "give an Amplitude of torques, a PositionServo, a Controller, or None"
        validate.kinds(owner, (Amplitude, PositionServo, Controller, NoneType), remedy, motor=self.motor)
        validate.kinds(owner, (Coupler, NoneType), "give a Coupler, or None", follows=self.follows)
        if self.kind == "ball":
            self._check_ball(owner)

    def _check_ball(self, owner: str) -> None:
        for name in ("position", "friction", "limits", "motor", "follows"):
            if getattr(self, name):
                remedy = "a ball has no axis for it; leave it out, or give three hinges whose axes meet"
                raise bad_value(f"{owner}.{name}", validate.brief(getattr(self, name)), remedy)

    @property
    def unit(self) -> tuple[float, float, float]:
        """Its axis as a unit vector [-]."""
        length = math.hypot(*self.axis)
        x, y, z = (component / length for component in self.axis)
        return x, y, z

    @property
    def rates(self) -> int:
        """Independent rates: three of a ball, else one."""
        return 3 if self.kind == "ball" else 1


def check_limits(owner: str, limits: object) -> None:
    """Refuse what is no pair of increasing numbers.

    Raises:
        RequestError: so it is.
    """
    if not (isinstance(limits, tuple) and len(limits) == 2 and validate.is_list(limits) and limits[0] < limits[1]):
        raise bad_value(f"{owner}.limits", limits, "give two finite numbers, the lower one first")


@dataclass(frozen=True)
class Whole:
    """What a joint between whole bodies says of them, see `scene.articulations.Articulation`.

    Attributes:
        freedoms: in turn, the first carries the second; none welds.
        at: the joint's point in the frame of its body [m].
        other_at: the same point in the frame of the other body [m], to be checked, or None.
        nodes, other_nodes: node sets that take part where a body is flexible, or None.
    """

    freedoms: tuple[Freedom, ...] = ()
    at: Vec3 = (0.0, 0.0, 0.0)
    other_at: Vec3 | None = None
    nodes: str | None = None
    other_nodes: str | None = None

    @property
    def points(self) -> tuple[Vec3, ...]:
        """A point of the axis of each freedom, or of a ball, in the frame of the body [m]."""
        return tuple(self.at if freedom.at is None else freedom.at for freedom in self.freedoms)

    @property
    def rates(self) -> int:
        """Independent rates of all freedoms."""
        return sum(freedom.rates for freedom in self.freedoms)
