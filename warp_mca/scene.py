"""Owns the public vocabulary of a scene: bodies, joints, contacts, constraints, phases.

A scene is plain, immutable data. Every class checks its own values and raises `RequestError` with the field,
the value and the remedy. Nothing here meshes, allocates or imports Warp.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import NoneType
from typing import TYPE_CHECKING, Literal

from warp_mca import validate
from warp_mca.elements import ELEMENTS
from warp_mca.errors import bad_value
from warp_mca.materials import MATERIALS, Material

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.geometry.recipe import Recipe

Vec3 = tuple[float, float, float]
OVERLAP_CHOICES = ("refuse", "stress_free", "press")


@dataclass(frozen=True, kw_only=True)
class Body:
    """A deformable body.

    Attributes:
        name: unique in the scene.
        geometry: a recipe that makes the mesh when it is needed, or a finished mesh, in the body's own frame.
        material: one material, or one for each cell set of the mesh; the key "*" stands for the other cells.
        element: formulation of its hexahedra, wedges and pyramids: "hex8" fully integrated, "hex8r" one point with
            hourglass stiffness; "tet4" cuts them to tetrahedra. Tetrahedra are tet4 always.
        kinematics: "corotational" takes strains as small, in the rotated frame; "finite" as logarithmic, for large
            plastic deformation.
        position: of the body frame's origin [m].
        rotation: of the body frame, as a rotation vector [rad].
        velocity: initial velocity of the body frame's origin [m/s].
        angular_velocity: initial angular velocity about the body frame's origin [rad/s].
    """

    name: str
    geometry: Recipe | Mesh
    material: Material | Mapping[str, Material]
    element: str = "hex8"
    kinematics: Literal["corotational", "finite"] = "corotational"
    position: Vec3 = (0.0, 0.0, 0.0)
    rotation: Vec3 = (0.0, 0.0, 0.0)
    velocity: Vec3 = (0.0, 0.0, 0.0)
    angular_velocity: Vec3 = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Body", name=self.name)
        if isinstance(self.geometry, type) or not (hasattr(self.geometry, "build") or hasattr(self.geometry, "points")):
            raise bad_value(f"Body {self.name}.geometry", self.geometry, "give a recipe, as Box(...), or a Mesh")
        materials = self.material.values() if isinstance(self.material, Mapping) else (self.material,)
        if not all(type(material) in MATERIALS.values() for material in materials):  # others have no kernels
            known = " or ".join(f"{'an' if name[0] in 'AEIOU' else 'a'} {name}" for name in MATERIALS)
            remedy = f"give {known}, no class made of them, or one for each cell set"
            raise bad_value(f"Body {self.name}.material", self.material, remedy)
        if self.element not in tuple(ELEMENTS):
            raise bad_value(f"Body {self.name}.element", self.element, f"choose among {', '.join(ELEMENTS)}")
        if self.kinematics not in ("corotational", "finite"):
            raise bad_value(f"Body {self.name}.kinematics", self.kinematics, "choose corotational or finite")
        validate.vectors(
            f"Body {self.name}",
            position=self.position,
            rotation=self.rotation,
            velocity=self.velocity,
            angular_velocity=self.angular_velocity,
        )


@dataclass(frozen=True, kw_only=True)
class Point:
    """A material point: the mesh node of `body` that lies nearest to `at` [m] in the body's frame."""

    body: str
    at: Vec3

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Point", body=self.body)
        validate.vectors(f"Point of {self.body}", at=self.at)


@dataclass(frozen=True, kw_only=True)
class Line:
    """A straight part of a path.

    Attributes:
        body: that it runs through.
        start, end: its ends in the body's frame [m].
        position: of its start along the path [m].
    """

    body: str
    start: Vec3
    end: Vec3
    position: float = 0.0

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Line", body=self.body)
        validate.vectors(f"Line in {self.body}", start=self.start, end=self.end)
        if not validate.is_number(self.position):
            raise bad_value(f"Line in {self.body}.position", self.position, "give a finite number")
        if self.start == self.end:
            raise bad_value(f"Line in {self.body}.end", self.end, "give a point other than the start")

    @property
    def length(self) -> float:
        """[m]."""
        return math.dist(self.start, self.end)


@dataclass(frozen=True, kw_only=True)
class Path:
    """Probes along lines, at which stress is recorded in every output interval.

    Attributes:
        name: unique in the scene.
        lines: its parts.
        spacing: largest distance between neighbouring probes of a line [m].
    """

    name: str
    lines: tuple[Line, ...]
    spacing: float

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Path", name=self.name)
        validate.positive(f"Path {self.name}", spacing=self.spacing)
        validate.members(f"Path {self.name}", Line, lines=self.lines)
        if not self.lines:
            raise bad_value(f"Path {self.name}.lines", self.lines, "give at least one line")


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Boundary faces of `body` that the node set `nodes` covers; "boundary" is the whole skin, unless it is a set."""

    body: str
    nodes: str

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Surface", body=self.body, nodes=self.nodes)


@dataclass(frozen=True, kw_only=True)
class RigidPlane:
    """An immovable, analytic half-space; the free side is where `normal` points.

    Attributes:
        point: any point of the plane [m].
        normal: its normal [-]; need not have unit length.
        velocity: of the plane along itself [m/s], as of a belt.
    """

    point: Vec3 = (0.0, 0.0, 0.0)
    normal: Vec3 = (0.0, 1.0, 0.0)
    velocity: Vec3 = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.vectors("RigidPlane", point=self.point, normal=self.normal, velocity=self.velocity)
        if math.hypot(*self.normal) == 0.0:
            raise bad_value("RigidPlane.normal", self.normal, "give a vector that is not zero")
        if abs(sum(v * n for v, n in zip(self.velocity, self.normal, strict=True))) > 1e-12 * math.hypot(
            *self.velocity
        ):
            raise bad_value("RigidPlane.velocity", self.velocity, "it must be perpendicular to the normal")


@dataclass(frozen=True, kw_only=True)
class Contact:
    """Node-to-surface penalty contact with stick-slip friction.

    Attributes:
        slave: surface whose nodes are kept out of the master.
        master: surface of another body, or a rigid plane.
        mu: coefficient of friction [-]; 0 runs no friction at all.
        penalty: factor f of the penalty stiffness k = f K A^2 / V [-]. None takes k = c E / (1 - nu^2) A^2 / V, with
            c = 3.8 where a surface is curved and 0.76 where both are flat: at nu = 0.3 that is f = 5 and f = 1.
        two_way: the master's nodes are also kept out of the slave's faces.
        initial_overlap: what to do where bodies overlap before the first step: "refuse" the scene; start "stress_free",
            with springs that count depth from there; or "press", with the springs' full force.
        name: unique in the scene; None for the bodies' names, "slave–master" or "slave–plane", numbered where a pair
            has several contacts. Results list forces by it.
        normal: direction of the force on the slave that F_n_N reports [-], of any length. None takes the master's mean
            normal at hand-off, or adds up the normal forces as they are where the master is closed. Give it where the
            master turns before the impact, or where only a part of a curved master is touched.
        tangent: direction that F_t_N reports [-], made perpendicular to the normal. None takes normal x z, or the
            perpendicular nearest to +x where the normal is within 20 degrees of the z axis.
    """

    slave: Surface
    master: Surface | RigidPlane
    mu: float = 0.0
    penalty: float | None = None
    two_way: bool = False
    initial_overlap: Literal["refuse", "stress_free", "press"] = "refuse"
    name: str | None = None
    normal: Vec3 | None = None
    tangent: Vec3 | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.kinds("Contact", Surface, "give a Surface", slave=self.slave)
        validate.kinds("Contact", (Surface, RigidPlane), "give a Surface or a RigidPlane", master=self.master)
        if self.penalty is not None:
            validate.positive("Contact", penalty=self.penalty)
        if self.initial_overlap not in OVERLAP_CHOICES:
            raise bad_value("Contact.initial_overlap", self.initial_overlap, f"choose {' or '.join(OVERLAP_CHOICES)}")
        if not (validate.is_number(self.mu) and self.mu >= 0.0):
            raise bad_value("Contact.mu", self.mu, "give a finite coefficient of friction, 0 or above")
        validate.flags("Contact", two_way=self.two_way)
        if self.two_way and isinstance(self.master, RigidPlane):
            raise bad_value("Contact.two_way", self.two_way, "a rigid plane has no nodes; leave two_way off")
        if isinstance(self.master, Surface) and self.master.body == self.slave.body:
            raise bad_value("Contact.master.body", self.master.body, "name a body other than the slave's")
        if self.name is not None:
            validate.texts("Contact", name=self.name)
        for axis in ("normal", "tangent"):
            value = getattr(self, axis)
            if value is not None:
                validate.vectors("Contact", **{axis: value})
                if not any(value):
                    raise bad_value(f"Contact.{axis}", value, "give a direction other than zero")


@dataclass(frozen=True, kw_only=True)
class Revolute:
    """A hinge ("re-joint"): pairs of coincident nodes on the hinge axis move as one.

    Attributes:
        name: unique in the scene.
        body: first body.
        at: a point of the hinge axis in the frame of `body` [m].
        other: second body, or None for the ground.
        other_at: the same point in the frame of `other` [m].
        axis: direction of the hinge axis in the frame of both bodies [-].
        nodes: "axis" ties every node on the axis, as a pin does; "ends" the two outermost pairs, as the paper does.
    """

    name: str
    body: str
    at: Vec3
    other: str | None = None
    other_at: Vec3 = (0.0, 0.0, 0.0)
    axis: Vec3 = (0.0, 0.0, 1.0)
    nodes: Literal["axis", "ends"] = "axis"

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Revolute", name=self.name, body=self.body)
        validate.kinds(
            f"Revolute {self.name}", (str, NoneType), "name a body, or None for the ground", other=self.other
        )
        validate.vectors(f"Revolute {self.name}", at=self.at, other_at=self.other_at, axis=self.axis)
        if not any(self.axis):
            raise bad_value(f"Revolute {self.name}.axis", self.axis, "give a direction other than zero")
        if self.nodes not in ("axis", "ends"):
            raise bad_value(f"Revolute {self.name}.nodes", self.nodes, "choose axis or ends")


@dataclass(frozen=True, kw_only=True)
class Fixed:
    """Nodes of a set that keep their initial velocity along some axes: no acceleration there.

    Attributes:
        body: body that owns the set.
        nodes: node set of its mesh.
        axes: any of the letters x, y, z in the world frame.
    """

    body: str
    nodes: str
    axes: str = "xyz"

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Fixed", body=self.body, nodes=self.nodes)
        if not isinstance(self.axes, str) or not self.axes or set(self.axes) - set("xyz"):
            raise bad_value("Fixed.axes", self.axes, "use letters out of x, y and z")


@dataclass(frozen=True, kw_only=True)
class Prescribed:
    """Nodes of a set whose velocity along one axis follows a table, held constant beyond its ends.

    Attributes:
        body: body that owns the set.
        nodes: node set of its mesh.
        axis: one of the letters x, y, z in the world frame.
        times: [s], increasing, counted from the start of the impact phase.
        velocities: [m/s], as many as times.
    """

    body: str
    nodes: str
    axis: str
    times: tuple[float, ...]
    velocities: tuple[float, ...]

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Prescribed", body=self.body, nodes=self.nodes)
        if self.axis not in ("x", "y", "z"):
            raise bad_value("Prescribed.axis", self.axis, "use one of x, y and z")
        for name, values in (("times", self.times), ("velocities", self.velocities)):
            if not validate.is_list(values):
                raise bad_value(f"Prescribed.{name}", values, "give finite numbers")
        if len(self.times) != len(self.velocities) or not len(self.times):
            raise bad_value("Prescribed.velocities", self.velocities, "give one velocity for each time")
        if any(b <= a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise bad_value("Prescribed.times", self.times, "list them in increasing order")


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
class RigidPhase:
    """The large timescale: a planar chain of rigid links swings until its tip reaches the target.

    The links and their hinges are read off the scene's revolute joints, from the ground outwards. Angles are
    measured from the downward vertical, positive clockwise about z seen from +z (the paper's convention):
    a link at angle theta points along (-sin theta, -cos theta, 0).

    Attributes:
        theta: initial angle of each link [rad].
        theta_dot: initial angular velocity of each link [rad/s].
        tip: the sphere whose touch ends the phase.
        target: contact surface that it will touch.
        inertia: "mesh" takes mass, centre and inertia from the finite-element mesh; "slender" takes uniform
            slender rods from hinge to hinge (the paper's Eq. 3).
        centre_target: the target's body is placed so that its frame origin lies under the tip at contact.
        t_max: give up when nothing was touched by then [s].
    """

    theta: tuple[float, ...]
    theta_dot: tuple[float, ...]
    tip: Tip
    target: Surface | RigidPlane
    inertia: Literal["mesh", "slender"] = "mesh"
    centre_target: bool = True
    t_max: float = 5.0

    def __post_init__(self) -> None:
        validate.plain(self)
        for name, values in (("theta", self.theta), ("theta_dot", self.theta_dot)):
            if not validate.is_list(values):
                raise bad_value(f"RigidPhase.{name}", values, "give finite numbers, one for each link")
        if len(self.theta) != len(self.theta_dot) or not len(self.theta):
            raise bad_value("RigidPhase.theta_dot", self.theta_dot, "give one angle and one rate for each link")
        validate.kinds("RigidPhase", Tip, "give a Tip", tip=self.tip)
        validate.kinds("RigidPhase", (Surface, RigidPlane), "give a Surface or a RigidPlane", target=self.target)
        if self.inertia not in ("mesh", "slender"):
            raise bad_value("RigidPhase.inertia", self.inertia, "choose mesh or slender")
        validate.flags("RigidPhase", centre_target=self.centre_target)
        validate.positive("RigidPhase", t_max=self.t_max)


@dataclass(frozen=True, kw_only=True)
class ImpactPhase:
    """The small timescale: explicit finite elements.

    Attributes:
        duration: simulated time [s].
        output_interval: time between rows of the history [s].
        time_step_scale: share of the stable time step that is used [-], in (0, 1].
        energy_tolerance: imbalance, as a share of initial energy and external work, that stops the run [-].
    """

    duration: float
    output_interval: float = 1e-6
    time_step_scale: float = 0.9
    energy_tolerance: float = 0.01

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.positive("ImpactPhase", duration=self.duration, output_interval=self.output_interval)
        validate.positive("ImpactPhase", energy_tolerance=self.energy_tolerance)
        if self.output_interval > self.duration:
            raise bad_value(
                "ImpactPhase.output_interval", self.output_interval, f"at most duration = {self.duration:g}"
            )
        if not (validate.is_number(self.time_step_scale) and 0.0 < self.time_step_scale <= 1.0):
            raise bad_value("ImpactPhase.time_step_scale", self.time_step_scale, "must lie in (0, 1]")


_PARTS = {
    "bodies": Body,
    "joints": Revolute,
    "contacts": Contact,
    "fixed": Fixed,
    "prescribed": Prescribed,
    "paths": Path,
}


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything that a run needs to know.

    Attributes:
        name: of the scene.
        bodies: at least one.
        impact: the finite-element phase.
        rigid: the rigid phase before it, or None: then the bodies' own initial motion applies.
        joints, contacts, fixed, prescribed: what binds the bodies.
        gravity: [m/s^2].
        paths: lines along which stress is recorded.
        tip: point whose velocity the history lists as tip_vx, tip_vy, tip_vz.
        target: point whose velocity the history lists as plate_vx, plate_vy, plate_vz.
        parameters: the values that a built-in scene was made from, for the record.
    """

    name: str
    bodies: tuple[Body, ...]
    impact: ImpactPhase
    rigid: RigidPhase | None = None
    joints: tuple[Revolute, ...] = ()
    contacts: tuple[Contact, ...] = ()
    fixed: tuple[Fixed, ...] = ()
    prescribed: tuple[Prescribed, ...] = ()
    paths: tuple[Path, ...] = ()
    gravity: Vec3 = (0.0, 0.0, 0.0)
    tip: Point | None = None
    target: Point | None = None
    parameters: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Scene", name=self.name)
        for name, kind in _PARTS.items():
            validate.members("Scene", kind, **{name: getattr(self, name)})
        validate.kinds("Scene", ImpactPhase, "give an ImpactPhase", impact=self.impact)
        validate.kinds("Scene", (RigidPhase, NoneType), "give a RigidPhase or None", rigid=self.rigid)
        validate.kinds("Scene", (Point, NoneType), "give a Point or None", tip=self.tip, target=self.target)
        validate.kinds("Scene", Mapping, "give a dict of values by name", parameters=self.parameters)
        for key in self.parameters:
            validate.kind_of("Scene.parameters", key, str, "give each value under its name, a text")
        names = [body.name for body in self.bodies]
        if not names:
            raise bad_value("Scene.bodies", (), "give at least one body")
        if len(set(names)) != len(names):
            raise bad_value("Scene.bodies", names, "give each body a name of its own")
        paths = [path.name for path in self.paths]
        if len(set(paths)) != len(paths):
            raise bad_value("Scene.paths", paths, "give each path a name of its own")
        contacts = [contact.name for contact in self.contacts if contact.name is not None]
        if len(set(contacts)) != len(contacts):
            raise bad_value("Scene.contacts", contacts, "give each contact a name of its own")
        pairs = [(item.slave, item.master) for item in self.contacts]
        for slave, master in pairs:
            if pairs.count((slave, master)) > 1:
                what = f"{slave.nodes} of {slave.body}"
                raise bad_value("Scene.contacts", what, "it meets the same master twice; list each pair once")
        validate.vectors("Scene", gravity=self.gravity)
        for field_name, body in self._named_bodies():
            if body not in names:
                raise bad_value(field_name, body, f"the scene's bodies are {', '.join(names)}")

    def _named_bodies(self) -> list[tuple[str, str]]:
        named = [("Fixed.body", item.body) for item in self.fixed]
        named += [("Prescribed.body", item.body) for item in self.prescribed]
        named += [(f"Revolute {item.name}.body", item.body) for item in self.joints]
        named += [(f"Revolute {item.name}.other", item.other) for item in self.joints if item.other is not None]
        named += [("Contact.slave.body", item.slave.body) for item in self.contacts]
        named += [("Contact.master.body", m.body) for m in (c.master for c in self.contacts) if isinstance(m, Surface)]
        named += [(f"Path {path.name}.body", line.body) for path in self.paths for line in path.lines]
        named += [(f"Scene.{key}.body", p.body) for key, p in (("tip", self.tip), ("target", self.target)) if p]
        if self.rigid:
            named.append(("RigidPhase.tip.body", self.rigid.tip.body))
            if isinstance(self.rigid.target, Surface):
                named.append(("RigidPhase.target.body", self.rigid.target.body))
        return named

    def body(self, name: str) -> Body:
        """The body of that name."""
        return next(body for body in self.bodies if body.name == name)
