"""Owns `Robot`: a machine in three dimensions, read from an MJCF or URDF file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import NoneType
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.mesh import Mesh
from warp_mca.robots.checks import check, flexible_body
from warp_mca.robots.warned import warnings_logged
from warp_mca.scene import Body, Fixed, ImpactPhase, PositionServo, RigidPlane, Scene
from warp_mca.scene.materials import Material

if TYPE_CHECKING:
    from warp_mca.phases.every import Every
    from warp_mca.recorders.recorder import Recorder
    from warp_mca.results.result import Result
    from warp_mca.robots.course import RobotRun
    from warp_mca.robots.handback import HandBack
    from warp_mca.robots.machine import Machine
    from warp_mca.robots.masses import MassProperties
    from warp_mca.robots.skins import Skin
    from warp_mca.robots.swing import RobotSwing
    from warp_mca.robots.touching import Pair

Values = Sequence[float] | Mapping[str, float | Sequence[float]]
Controller = Callable[[float, Array, Array], Sequence[float]]


@dataclass(frozen=True)
class Robot:
    """A machine in three dimensions from an MJCF or URDF file, which MuJoCo reads (extra `robots`).

    Trees of links and loops of equality constraints, with all joint types, limits, springs, damping, dry friction,
    armature, motors and servos, mimic joints and fixed tendons. Fixed links of a URDF stay links. Spatial tendons,
    flexes, muscles, plugins, mocap bodies and height fields are refused by name.

    Attributes:
        path: of the file, with suffix .xml, .mjcf or .urdf.
        flexible: recipes or meshes by the name of the link that is to be made of them, in the link's frame; or Bodies,
            whose position and rotation are those in the link's frame.
        material: of the recipes in `flexible`.
        keyframe: name of the file's keyframe to start from.
        qpos: start in place of the file's: all of MuJoCo's coordinates, or some by the name of their joint [m, rad].
        qvel: likewise rates [m/s, rad/s].
        ctrl: likewise controls, by the name of the actuator.
        servos: by joint, where the file has no drive, as a URDF.
        controller: gives the controls at time t [s], coordinates and rates: controller(t, qpos, qvel). It is called at
            each period, and its controls are held in between.
        period: of the controller [s].
        clock: time at the start, with which the controller is called first [s].
        mounts: node set by which each flexible link is held: by its parent, or by what rides on it, see `strike`.
            Where several links hold it: a dict of node sets by the name of the other link.
        against: planes and bodies beside the machine that it may touch.
        touch: names of links or geoms: pairs without one of these are not looked at. () for all that the file lets
            collide, and all that may meet `against`.
    """

    path: str | os.PathLike[str]
    flexible: Mapping[str, Any] = field(default_factory=dict)
    material: Material | None = None
    keyframe: str | None = None
    qpos: Values | None = None
    qvel: Values | None = None
    ctrl: Values | None = None
    servos: Mapping[str, PositionServo] = field(default_factory=dict)
    controller: Controller | None = None
    period: float | None = None
    clock: float = 0.0
    mounts: Mapping[str, Any] = field(default_factory=dict)
    against: tuple[RigidPlane | Body, ...] = ()
    touch: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check(self)
        object.__setattr__(self, "path", os.fspath(self.path))
        bodies = {name: flexible_body(name, item, self.material) for name, item in self.flexible.items()}
        object.__setattr__(self, "flexible", bodies)

    @warnings_logged()
    def swing(self, *, t_max: float = 5.0, t_end: float | None = None) -> RobotSwing:
        """Swing from the start until the machine touches something, or to a time.

        Steps are those of DOP853 under error control, whatever the file's timestep. A limit is a stiff spring with
        critical damping; loops are kept closed exactly. The touch is that of the surfaces that contact uses: skins of
        flexible links and bodies, and geoms. It is located to 1e-9 s between spheres, capsules, boxes, cylinders and
        planes; other pairs meet where a node of the one meets a face of the other, edges that cross are not seen.

        Args:
            t_max: give up when nothing was touched by then [s].
            t_end: end then in place of t_max, touch or not, and do not look for touches [s].

        Raises:
            RequestError: the file cannot be read, holds what a machine does not carry, or MuJoCo is not installed;
                the start is none of it; surfaces overlap at the start; nothing touches by t_max.
        """
        from warp_mca.robots.swing import swing

        validate.times("Robot.swing", t_max=t_max)
        if t_end is not None:
            validate.times("Robot.swing", t_end=t_end)
            return swing(self, self._machine(), (), t_end, stops=False)
        machine = self._machine()
        pairs = self.pairs(machine)
        if not pairs:
            remedy = "nothing may touch: name in against what stands beside the machine, or give a t_end"
            raise bad_value("Robot.against", (), remedy)
        found = swing(self, machine, pairs, t_max)
        if found.touch is None:
            gap, t = found.closest
            remedy = f"nothing touches by t_max = {t_max:g} s, closest at t = {t:.6g} s; start nearer or swing longer"
            raise bad_value("closest gap of the machine [m]", gap, remedy)
        return found

    @warnings_logged()
    def strike(
        self,
        *,
        impact: ImpactPhase,
        stiffness: float = 1e8,
        mu: float = 0.0,
        swing: RobotSwing | None = None,
        fixed: tuple[Fixed, ...] = (),
        faces: int = 24,
        drawn: bool = False,
        name: str = "strike",
    ) -> Scene:
        """The machine at its first touch as a scene, to run, to save or to change: an impact by finite elements.

        Flexible links get their meshes, all others are rigid bodies with the file's mass, centre and inertia. Joints
        are Articulations with springs, dampers, friction, armature, limits and drives, which go on acting at the
        controls that are held. Joints that equalities gear follow by a `Coupler`; a tendon of joints that are free of
        each other acts on bodies of almost no mass, "NAME relay 1" and so on, which couplers move by its length, as do
        further actuators of a joint with a clamp of their own. Of the file's geoms those are meshed that may touch
        within the impact; a round one has a node where it touches first. Geoms of the world are held. What the file's
        link has beyond the mass of its mesh rides on it as a rigid body, "NAME rest", to which it is mounted; where
        they differ by no more than 2 %, the link swings with the mass of its mesh.

        Args:
            impact: the phase.
            stiffness: of contact between rigid surfaces, of each node [N/m]; others have the default of `Contact`.
            mu: coefficient of friction of all contacts [-]; that of the file is not read.
            swing: how it came there; None: its swing to the first touch.
            faces: around a round geom [-], whose middles lie 0.0086 of its radius inside at 24. Where two round geoms
                meet, one has a flat face at the touch, as wide as these, so that the force points right while they do
                not slide far. Softer contact needs fewer, more than that makes corners of the face touch.
            drawn: whether geoms that cannot touch are meshed too, so that recorders show whole links.
            fixed: nodes of bodies beside the machine that are held.
            name: of the scene.

        Raises:
            RequestError: as in `swing`; the machine has something that an impact does not carry; a controller would be
                called during the impact; a mesh has more mass than its link, or a flexible link is held nowhere.
        """
        from warp_mca.robots.handoff import HandOff
        from warp_mca.robots.swing import RobotSwing

        validate.kinds("Robot.strike", ImpactPhase, "give an ImpactPhase", impact=impact)
        validate.positive("Robot.strike", stiffness=stiffness)
        validate.counts("Robot.strike", faces=faces)
        validate.flags("Robot.strike", drawn=drawn)
        if faces % 4 or faces < 8:
            raise bad_value("Robot.strike.faces", faces, "give a multiple of 4, 8 at least")
        if self.period is not None and self.period < impact.duration:
            remedy = f"controls are held during an impact, which lasts {impact.duration:g} s; give no shorter one"
            raise bad_value("Robot.period", self.period, remedy)
        validate.kinds("Robot.strike", (RobotSwing, NoneType), "give a RobotSwing of this machine", swing=swing)
        found = self.swing() if swing is None else swing
        machine = self._machine()
        if len(found.qpos) != machine.nq or len(found.qvel) != machine.nv or not machine.made(found):
            raise bad_value("Robot.strike.swing", f"RobotSwing to {found.t_end:.6g} s", "it is of another machine")
        scene = HandOff(self, machine, found).scene(impact, self.pairs(machine), (stiffness, mu, faces), name, drawn)
        return replace(scene, fixed=(*scene.fixed, *fixed))

    @warnings_logged()
    def after(self, swing: RobotSwing, scene: Scene, result: Result) -> HandBack:
        """The machine after an impact, to swing on.

        The motion at the end of the impact goes to the joints so that generalised momenta are kept; what vibrates is
        lost, and stated. Flexible links get their shape back, so they must not have yielded.

        Args:
            swing: of this machine, at whose end it was handed over.
            scene: that `strike` made of it.
            result: of the run of that scene.

        Raises:
            RequestError: the result is not one of the scene, a flexible link yielded, or a flexible body beside moves.
        """
        from warp_mca.results.result import Result
        from warp_mca.robots.handback import hand_back
        from warp_mca.robots.swing import RobotSwing

        validate.kinds("Robot.after", RobotSwing, "give the RobotSwing that ended at the impact", swing=swing)
        validate.kinds("Robot.after", Scene, "give the scene that strike made", scene=scene)
        validate.kinds("Robot.after", Result, "give what mca.run made of it", result=result)
        return hand_back(self, swing, scene, result)

    def run(
        self,
        *,
        t_end: float,
        impact: ImpactPhase,
        recorders: Sequence[Recorder] = (),
        device: str = "cpu",
        precision: str = "mixed",
        threads: int | None = None,
        out: str | os.PathLike[str] | None = None,
        checkpoint: str | Every | None = None,
        force: bool = False,
        **strike: Any,
    ) -> RobotRun:
        """Swing and strike in turn until a time: `swing`, `strike`, `mca.run` and `after`, again and again.

        Recorders see all of it as one run, whose times count from the first touch: flexible links and the geoms that
        MuJoCo's viewer shows, of groups 0 to 2, or all of a link that has no others. Each swing and impact has as many
        frames as a `Cadence` says of a run.

        Args:
            t_end: of the run, from the start [s]; an impact that has begun by then is run to its end.
            impact: each one, at whose end all contacts must be open.
            recorders: what shows or writes the run, see `warp_mca.recorders`.
            device, precision, threads: of the impacts, as in `mca.run`.
            out: folder for the state on the way, from which the same call goes on to the same bits; empty at the end.
            checkpoint, force: of `out`, as in `mca.run`; by default each 30 s. Swings are computed again.
            strike: further arguments of `strike`: stiffness, mu, fixed, faces, name.

        Raises:
            RequestError: as in `swing` and `strike`; an output cannot be made.
            GuardError: an impact lost its footing.
        """
        from warp_mca.robots.course import checked_run

        kept = (out, checkpoint, force)
        return checked_run(self, t_end, {"impact": impact, **strike}, (device, precision, threads), recorders, kept)

    def _machine(self) -> Machine:
        from warp_mca.robots.machine import Machine

        return Machine(self)

    def pairs(self, machine: Machine) -> list[Pair]:
        """Pairs of surfaces that may touch, of this robot's machine."""
        from warp_mca.robots.geoms import geom_side
        from warp_mca.robots.reading import mujoco
        from warp_mca.robots.touching import pairs_of

        mj = mujoco("Robot.file", self.path)
        geoms = lambda side: geom_side(mj, machine, side)  # noqa: E731
        return pairs_of(mj, self, machine, self._skins, geoms)

    @cached_property
    def meshes(self) -> dict[str, Mesh]:
        """Meshes of the flexible links, in the links' frames, and of the bodies beside, by name.

        Raises:
            RequestError: one cannot be meshed.
        """
        from warp_mca.phases.meshing import mesh

        bodies = (*self.flexible.values(), *(item for item in self.against if isinstance(item, Body)))
        if not bodies:
            return {}
        found = mesh(Scene(name="robot", bodies=bodies, impact=ImpactPhase(duration=1e-3)))
        for name, body in self.flexible.items():
            turned = found[name].points @ rotation_matrix(body.rotation).T
            found[name] = replace(found[name], points=np.array(body.position) + turned)
        return found

    @cached_property
    def mesh_masses(self) -> dict[str, MassProperties]:
        """Mass properties of the meshes of flexible links, in the links' frames."""
        from warp_mca.physics.elements.cells import nodal_masses
        from warp_mca.robots.masses import of_nodes

        bodies = tuple(self.flexible.values())
        scene = Scene(name="robot", bodies=bodies, impact=ImpactPhase(duration=1e-3)) if bodies else None
        masses = nodal_masses(scene, self.meshes) if scene else {}
        return {name: of_nodes(self.meshes[name].points, masses[name]) for name in self.flexible}

    @cached_property
    def _skins(self) -> dict[str, Skin]:
        from warp_mca.robots.skins import Skin

        return {name: Skin.of(mesh) for name, mesh in self.meshes.items()}
