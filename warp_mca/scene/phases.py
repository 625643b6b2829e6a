"""Owns the phases of a run: rigid swing, with what drives it, and finite-element impact."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from types import NoneType
from typing import TYPE_CHECKING, Literal

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Vec3
from warp_mca.scene.contacts import RigidPlane, Surface

if TYPE_CHECKING:
    from warp_mca.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Tip:
    """The sphere of a chain's last link that will touch the target first.

    Attributes:
        body: the link that carries it.
        centre: of the sphere in that body's frame [m].
        radius: [m].
    """

    body: str
    centre: Vec3
    radius: float

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Tip", body=self.body)
        validate.vectors("Tip", centre=self.centre)
        validate.positive("Tip", radius=self.radius)


@dataclass(frozen=True, kw_only=True)
class BaseMotion:
    """Velocity of the ground hinge over time, linear between the given times, held constant beyond its ends.

    Attributes:
        times: [s], increasing, counted from the release.
        vx, vy: velocities along x and y [m/s], as many as times.
    """

    times: tuple[float, ...]
    vx: tuple[float, ...]
    vy: tuple[float, ...]

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.table("BaseMotion", self.times, vx=self.vx, vy=self.vy)


@dataclass(frozen=True, kw_only=True)
class Slide:
    """A carriage that bears the ground hinge and slides freely along a direction.

    Attributes:
        direction: in the xy plane [-], of any length.
        carriage_mass: [kg].
        velocity: of the carriage along the direction at the release [m/s].
    """

    direction: Vec3 = (1.0, 0.0, 0.0)
    carriage_mass: float = 0.0
    velocity: float = 0.0

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.vectors("Slide", direction=self.direction)
        if not any(self.direction[:2]) or self.direction[2]:
            raise bad_value("Slide.direction", self.direction, "give a direction in the xy plane")
        if not (validate.is_number(self.carriage_mass) and self.carriage_mass >= 0.0):
            raise bad_value("Slide.carriage_mass", self.carriage_mass, "give a finite number, 0 or above")
        validate.finite("Slide", velocity=self.velocity)


@dataclass(frozen=True, kw_only=True)
class JointTorque:
    """Torque that a drive exerts in a joint over time, linear between the given times, held constant beyond its ends.

    It turns the joint's outer link to greater angles (`RigidPhase`) and acts reversed on the link before it, or on the
    ground.

    Attributes:
        joint: name of a revolute joint of the chain.
        times: [s], increasing, counted from the release.
        torques: [N m], as many as times.
    """

    joint: str
    times: tuple[float, ...]
    torques: tuple[float, ...]

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("JointTorque", joint=self.joint)
        validate.table("JointTorque", self.times, torques=self.torques)


@dataclass(frozen=True, kw_only=True)
class RigidPhase:
    """The large timescale: a planar chain of rigid links swings until its tip reaches the target.

    The links and their hinges are read off the scene's revolute joints, from the ground outwards. Angles are
    measured from the downward vertical, positive clockwise about z seen from +z (the paper's convention):
    a link at angle theta points along (-sin theta, -cos theta, 0). Base motion, slide, torques, friction and damping
    act during impacts too, see docs/theory.md.

    Attributes:
        theta: initial angle of each link [rad].
        theta_dot: initial angular velocity of each link [rad/s].
        tip: the sphere whose touch ends the phase.
        target: contact surface that it will touch.
        inertia: "mesh" takes mass, centre and inertia from the finite-element mesh; "slender" takes uniform
            slender rods from hinge to hinge (the paper's Eq. 3).
        centre_target: the target's body is placed so that its frame origin lies under the tip at contact.
        t_max: give up when nothing was touched by then [s].
        base_motion: how the ground hinge moves, with its rail where it slides; None: it does not.
        slide: carriage that bears the ground hinge, or None.
        joint_friction: Coulomb friction torque of each link's inbound joint [N m]; () for none.
        joint_damping: viscous torque over rate of each of these joints [N m s/rad]; () for none.
        friction_rate: rate above which a joint slips with its whole friction torque [rad/s]; the torque is that times
            tanh(rate / friction_rate). Smaller rates hold a joint at rest better and take longer to compute.
        torques: of drives in joints.
    """

    theta: tuple[float, ...]
    theta_dot: tuple[float, ...]
    tip: Tip
    target: Surface | RigidPlane
    inertia: Literal["mesh", "slender"] = "mesh"
    centre_target: bool = True
    t_max: float = 5.0
    base_motion: BaseMotion | None = None
    slide: Slide | None = None
    joint_friction: tuple[float, ...] = ()
    joint_damping: tuple[float, ...] = ()
    friction_rate: float = 1e-2
    torques: tuple[JointTorque, ...] = ()

    def __post_init__(self) -> None:
        validate.plain(self)
        for name, values in (("theta", self.theta), ("theta_dot", self.theta_dot)):
            if not validate.is_list(values):
                raise bad_value(f"RigidPhase.{name}", values, "give finite numbers, one for each link")
        if len(self.theta) != len(self.theta_dot) or not len(self.theta):
            raise bad_value("RigidPhase.theta_dot", self.theta_dot, "give one angle and one rate for each link")
        validate.kinds("RigidPhase", Tip, "give a Tip", tip=self.tip)
        validate.kinds("RigidPhase", (Surface, RigidPlane), "give a Surface or a RigidPlane", target=self.target)
        validate.choice("RigidPhase", ("mesh", "slender"), inertia=self.inertia)
        validate.flags("RigidPhase", centre_target=self.centre_target)
        validate.positive("RigidPhase", t_max=self.t_max, friction_rate=self.friction_rate)
        validate.kinds("RigidPhase", (BaseMotion, NoneType), "give a BaseMotion or None", base_motion=self.base_motion)
        validate.kinds("RigidPhase", (Slide, NoneType), "give a Slide or None", slide=self.slide)
        validate.members("RigidPhase", JointTorque, torques=self.torques)
        for name, values in (("joint_friction", self.joint_friction), ("joint_damping", self.joint_damping)):
            if not (validate.is_list(values) and all(value >= 0.0 for value in values)):
                raise bad_value(f"RigidPhase.{name}", values, "give finite numbers, 0 or above, one for each link")
            if len(values) not in (0, len(self.theta)):
                raise bad_value(f"RigidPhase.{name}", values, f"give {len(self.theta)} numbers, one for each link")


@dataclass(frozen=True, kw_only=True)
class Settle:
    """Bodies come to rest under gravity, before the impact begins.

    Bodies without an initial velocity move until they rest; those that have one wait where they are, and take it when
    the impact begins. The others are damped in proportion to mass, and the ledger books that energy as `damping`.
    A `Bolt` is tightened meanwhile, and a `Prony` series relaxes at once, as the branches of a loss factor do: what
    rests has the moduli of a long time.

    Attributes:
        duration: the run stops if they do not rest by then [s].
        tolerance: they rest when their kinetic energy has stayed below this share of its greatest value for as long as
            they took to reach that, and for a quarter of the period of what still moves [-].
        falling: bodies with an initial velocity do not wait: they settle without it and take it when the impact begins.
            Nothing has weight meanwhile, as in free fall. For parts with bolts that fall on a floor out of their reach.
    """

    duration: float = 0.1
    tolerance: float = 1e-6
    falling: bool = False

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.times("Settle", duration=self.duration)
        validate.within("Settle", 1e-14, 0.1, tolerance=self.tolerance)
        validate.flags("Settle", falling=self.falling)


# That `Scene.phases` may hold: others have a method advance(impact, tell) that returns a `phases.stretch.Stretch`.
PHASES: dict[str, type] = {"Settle": Settle}


@dataclass(frozen=True, kw_only=True)
class ImpactPhase:
    """The small timescale: explicit finite elements.

    Attributes:
        duration: simulated time [s].
        output_interval: time between rows of the history [s].
        time_step_scale: share of the stable time step that is used [-], in (0, 1].
        energy_tolerance: imbalance, as a share of initial energy and external work, that stops the run [-]. From 0.01
            on and with penalties left to the program, ten times as much is allowed of what contact springs make as
            they close and open within a step, with a warning.
        mass_scaling: None, or what elements that are too small gain mass for: a factor above 1 by which the stable step
            grows [-], or the stable step itself, as "2e-8s".
        open_time: how long all contacts must be open for an impact to end, in a run of many phases [s]; None takes the
            longest period of bending of a link, see docs/theory.md.
        bulk_viscosity: linear and quadratic coefficient of a viscous pressure [-], as (0.06, 1.2), or the linear one
            alone; None: no viscosity. It damps vibration of the length of a cell, such as the ringing of flat contact,
            for 6 % shorter steps at 0.06, and the energy that it takes is `damping`; see docs/theory.md.
    """

    duration: float
    output_interval: float = 1e-6
    time_step_scale: float = 0.9
    energy_tolerance: float = 0.01
    mass_scaling: float | str | None = None
    open_time: float | None = None
    bulk_viscosity: float | tuple[float, float] | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.times("ImpactPhase", duration=self.duration, output_interval=self.output_interval)
        validate.positive("ImpactPhase", energy_tolerance=self.energy_tolerance)
        if self.output_interval > self.duration:
            raise bad_value(
                "ImpactPhase.output_interval", self.output_interval, f"at most duration = {self.duration:g}"
            )
        if self.mass_scaling is not None and not is_mass_scaling(self.mass_scaling):
            remedy = "give a factor of 1 or above for the stable step, or a step in seconds as 2e-8s"
            raise bad_value("ImpactPhase.mass_scaling", validate.brief(self.mass_scaling), remedy)
        if self.open_time is not None:
            validate.times("ImpactPhase", open_time=self.open_time)
        if not (validate.is_number(self.time_step_scale) and 0.0 < self.time_step_scale <= 1.0):
            raise bad_value("ImpactPhase.time_step_scale", self.time_step_scale, "must lie in (0, 1]")
        if not (len(self.viscosity) == 2 and all(map(_is_coefficient, self.viscosity))):
            remedy = "give a linear coefficient from 0 to 10, or that and a quadratic one as (0.06, 1.2)"
            raise bad_value("ImpactPhase.bulk_viscosity", validate.brief(self.bulk_viscosity), remedy)

    @property
    def viscosity(self) -> tuple[float, float]:
        """Linear and quadratic coefficient of bulk viscosity [-]; 0 without."""
        given = 0.0 if self.bulk_viscosity is None else self.bulk_viscosity
        return given if isinstance(given, tuple) else (given, 0.0)


def _is_coefficient(value: object) -> bool:
    return validate.is_number(value) and 0.0 <= value <= 10.0  # pyright: ignore[reportOperatorIssue]


def is_mass_scaling(value: object) -> bool:
    """Whether it is a factor for the stable step, or a step as "2e-8s"."""
    if isinstance(value, str) and value.endswith("s"):
        with suppress(ValueError):
            return validate.is_time(float(value[:-1]))
    return validate.is_number(value) and value >= 1.0  # pyright: ignore[reportOperatorIssue]


def check_t_end(scene: Scene) -> None:
    """Refuse an end that no cycle of swings and impacts can reach.

    Raises:
        RequestError: it is no time above 0, or the scene does not swing, has driven nodes or absorbing sides.
    """
    if scene.t_end is None:
        return
    validate.times("Scene", t_end=scene.t_end)
    if scene.rigid is None:
        raise bad_value("Scene.t_end", scene.t_end, "swings and impacts in turn need a RigidPhase; give one")
    if scene.impact.mass_scaling is not None:
        remedy = "links that get rigid again have their own masses; leave mass_scaling out, or t_end"
        raise bad_value("ImpactPhase.mass_scaling", scene.impact.mass_scaling, remedy)
    for present, why in (
        (scene.absorbing, "a cut body with absorbing sides does not move between impacts as the large one"),
        ([a for a in scene.loads if not a.inner], "loads act in an impact alone, not in the swings between"),
        (any(item.bond for item in scene.listed), "bonds act in an impact alone, not in the swings between"),
        (scene.failing, "elements that failed cannot become rigid again"),
        (scene.prescribed, "nodes with a Prescribed velocity cannot follow it between impacts"),
    ):
        if present:
            raise bad_value("Scene.t_end", scene.t_end, f"{why}; leave t_end out")
