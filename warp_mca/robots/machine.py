"""Owns the equations of motion of a machine: MuJoCo's, with loops exact and limits and dry friction as in an impact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.robots.masses import MassProperties, of_link, regular, rest_of
from warp_mca.robots.reading import Names, compiled, mujoco, scenery, with_masses
from warp_mca.robots.sockets import sockets_of
from warp_mca.robots.start import start_of
from warp_mca.robots.switches import switched_off
from warp_mca.robots.warned import warnings_logged

if TYPE_CHECKING:
    from warp_mca.robots.robot import Robot
    from warp_mca.robots.swing import RobotSwing

LIMIT_RATE = 2000.0  # of the spring of a limit on the inertia of its joint [rad/s], with critical damping
FRICTION_RATE = 1e-2  # rate over which dry friction builds up, as in `RigidPhase.friction_rate` [rad/s, m/s]
LOOP_RATE = 100.0  # at which gaps of loops decay (Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972) 1) [1/s]
NUDGE = 1e-6  # time for the difference that gives J' v [s]


class Motion(NamedTuple):
    """Pose and motion of a link.

    Attributes:
        origin: of its frame [m], shape (3,), float64.
        rotation: from its frame to the world [-], shape (3, 3), float64.
        velocity: of the origin [m/s], shape (3,), float64.
        spin: angular velocity [rad/s], shape (3,), float64.
    """

    origin: Array
    rotation: Array
    velocity: Array
    spin: Array

    def turn(self, rotation: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
        """Rotation vector of a frame that is turned by `rotation` in that of the link [rad], shape (3,), float64."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_matrix(self.rotation @ rotation_matrix(rotation)).as_rotvec()


class Machine:
    """A robot's model, its data at the latest time asked for, and forces that MuJoCo does not compute here.

    y holds coordinates and rates, then the work of drives and of all other forces but gravity and springs [J].

    Attributes:
        mj: the module `mujoco`.
        model, data: of MuJoCo.
        names: of what the model holds.
        rests: what flexible links have beyond their meshes, by name.
        ctrl: controls that are held, shape (nu,), float64.
        limited, limited_q: index of the rate and of the coordinate of each joint with a limit, int.
        range: its limits [rad, m], shape (count, 2), float64.
        off: what the file's option switches off, as "ACTUATION" for all drives.
        limit_stiffness: of these limits [N m/rad, N/m], float64.
        limit_damping: of these limits [N m s/rad, N s/m], float64.
        sockets: balls with a range.
    """

    @warnings_logged()
    def __init__(self, robot: Robot) -> None:
        """Compile the file and set the start.

        Raises:
            RequestError: the file, or the start, is not one of a machine.
        """
        self.mj: Any = mujoco("Robot.file", robot.path)
        self.model: Any
        spec, self.model = compiled(robot)
        self.names = Names(self.mj, self.model)
        self.rests = self._rests(robot, spec)
        self.data: Any = self.mj.MjData(self.model)
        self._beside: Any = self.mj.MjData(self.model)
        self.nq, self.nv = int(self.model.nq), int(self.model.nv)
        self.off = switched_off(self.mj, spec.option.disableflags)
        scalar = self.model.jnt_type >= int(self.mj.mjtJoint.mjJNT_SLIDE)
        joints = np.flatnonzero(self.model.jnt_limited.astype(bool) & scalar)
        self.range, self.limited = self.model.jnt_range[joints], self.model.jnt_dofadr[joints]
        self.limited_q, self._friction = self.model.jnt_qposadr[joints], self.model.dof_frictionloss.copy()
        self.ctrl = np.zeros(self.model.nu)
        self.start = start_of(self, robot)
        mobility = np.asarray(np.diag(np.linalg.inv(regular(self))), dtype=np.float64)
        inertia = 1.0 / mobility[self.limited]
        self.limit_stiffness = inertia * LIMIT_RATE**2
        self.limit_damping = 2.0 * inertia * LIMIT_RATE
        self.sockets = sockets_of(self, mobility, LIMIT_RATE)

    def _rests(self, robot: Robot, spec: Any) -> dict[str, MassProperties]:
        """What flexible links have beyond their meshes; those that have nothing take the mass of the mesh.

        Raises:
            RequestError: a name is not known, or a mesh has more than its link.
        """
        for name in robot.flexible:
            if name not in self.names.bodies:
                raise bad_value("Robot.flexible", name, f"the file's links are {', '.join(self.names.bodies)}")
            if int(self.model.body_weldid[1 + self.names.bodies.index(name)]) == 0:
                raise bad_value("Robot.flexible", name, "this link never moves; give it as a Body in against")
        own = {name: of_link(self, 1 + self.names.bodies.index(name)) for name in robot.flexible}
        found = {name: rest_of(name, file, robot.mesh_masses[name]) for name, file in own.items()}
        if alike := {name: robot.mesh_masses[name] for name, rest in found.items() if rest is None}:
            self.model = with_masses(self.mj, robot, spec, alike)
        return {name: rest for name, rest in found.items() if rest is not None}

    @property
    def keyframes(self) -> list[str]:
        """Names of the file's keyframes; empty texts where it gives none."""
        kind = int(self.mj.mjtObj.mjOBJ_KEY)
        return [self.mj.mj_id2name(self.model, kind, k) or "" for k in range(self.model.nkey)]

    @property
    def meets_the_world(self) -> bool:
        """Whether the file has a geom beside the machine, not of its base, that something may touch."""
        beside = scenery(self.model)[self.model.geom_bodyid]
        return "CONTACT" not in self.off and bool((self.model.geom_contype | self.model.geom_conaffinity)[beside].any())

    def set(self, data: Any, y: Array) -> None:
        """Give data coordinates and rates."""
        data.qpos[:], data.qvel[:] = y[: self.nq], y[self.nq : self.nq + self.nv]
        self.mj.mj_normalizeQuat(self.model, data.qpos)

    def place(self, q: Array) -> Any:
        """The data with all frames at coordinates q."""
        if not np.array_equal(self.data.qpos, q):
            self.data.qpos[:] = q
            self.mj.mj_normalizeQuat(self.model, self.data.qpos)
        self.mj.mj_kinematics(self.model, self.data)
        return self.data

    def coordinate_rates(self, q: Array, v: Array) -> Array:
        """q' of coordinates q at rates v, shape (nq,), float64: v itself, of quaternions q' = q (0, omega) / 2."""
        rates = np.empty(self.nq)
        for kind, at, dof in zip(self.model.jnt_type, self.model.jnt_qposadr, self.model.jnt_dofadr, strict=True):
            if kind >= int(self.mj.mjtJoint.mjJNT_SLIDE):
                rates[at] = v[dof]
                continue
            if kind == int(self.mj.mjtJoint.mjJNT_FREE):
                rates[at : at + 3], at, dof = v[dof : dof + 3], at + 3, dof + 3
            w, x, y, z = q[at : at + 4]
            a, b, c = v[dof : dof + 3]
            product = (-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a)
            rates[at : at + 4] = 0.5 * np.array(product)
        return rates

    def own_forces(self, q: Array, v: Array) -> Array:
        """Generalised forces of limits and dry friction, shape (nv,), float64.

        A limit gives -(k d + c d') where the joint is beyond it by d, as in an impact. Dry friction is its whole force
        times tanh(rate / FRICTION_RATE).
        """
        force = -self._friction * np.tanh(v / FRICTION_RATE)
        at, rate = q[self.limited_q], v[self.limited]
        beyond = at - np.clip(at, self.range[:, 0], self.range[:, 1])
        held = self.limit_stiffness * beyond + self.limit_damping * rate
        force[self.limited] -= np.where(beyond != 0.0, held, 0.0)
        for socket in self.sockets:
            force[socket.dof : socket.dof + 3] += socket.push(q, v)
        return force

    def advance(self, y: Array) -> Any:
        """The data with all forces and accelerations at y."""
        mj, model, data = self.mj, self.model, self.data
        self.set(data, y)
        data.ctrl[:] = self.ctrl
        data.qfrc_applied[:] = self.own_forces(data.qpos, data.qvel)
        mj.mj_fwdPosition(model, data)
        mj.mj_fwdVelocity(model, data)
        mj.mj_fwdActuation(model, data)
        mj.mj_fwdAcceleration(model, data)
        return data

    def rates(self, _t: float, y: Array) -> Array:
        """y' at time t [s], shape (nq + nv + 2,), float64."""
        data = self.advance(y)
        v = y[self.nq : self.nq + self.nv]
        a = data.qacc_smooth + self._loop_acceleration()
        others = data.qfrc_damper + data.qfrc_applied + data.qfrc_gravcomp
        work = (v @ data.qfrc_actuator, v @ others)
        return np.concatenate([self.coordinate_rates(y[: self.nq], v), a, work])

    def _loop_acceleration(self) -> Array | float:
        """M^-1 J^T lambda that keeps loops closed: J a = -J' v - 2 w J v - w^2 gap, w = LOOP_RATE."""
        data = self.data
        if not data.nefc:
            return 0.0
        J, v = self.loop_jacobian(), np.array(data.qvel)
        ahead, behind = (self._loop_rate(sign * NUDGE) for sign in (1.0, -1.0))
        wanted = -(ahead - behind) / (2.0 * NUDGE) - 2.0 * LOOP_RATE * (J @ v) - LOOP_RATE**2 * data.efc_pos
        W = np.linalg.solve(self.mass_matrix(), J.T)
        return W @ np.linalg.lstsq(J @ W, wanted - J @ data.qacc_smooth, rcond=1e-10)[0]

    def _loop_rate(self, span: float) -> Array:
        """J v a time [s] later at the same rates."""
        beside = self._beside
        beside.qpos[:] = self.data.qpos
        self.mj.mj_integratePos(self.model, beside.qpos, self.data.qvel, span)
        self.mj.mj_fwdPosition(self.model, beside)
        return np.array(beside.efc_J).reshape(beside.nefc, self.nv) @ self.data.qvel

    def loop_jacobian(self) -> Array:
        """J of the loops at the latest data, shape (row_count, nv), float64; (0, nv) of a tree."""
        return np.array(self.data.efc_J).reshape(self.data.nefc, self.nv)

    def mass_matrix(self) -> Array:
        """M at the latest data, with armature [kg, kg m, kg m^2], shape (nv, nv), float64."""
        M = np.zeros((self.nv, self.nv))
        self.mj.mj_fullM(self.model, self.data, M)
        return M

    def made(self, swing: RobotSwing) -> bool:
        """Whether a swing with as many coordinates ended with the momenta that this machine has there."""
        self.advance(np.concatenate([swing.qpos, swing.qvel, np.zeros(2)]))
        return bool(np.allclose(self.mass_matrix() @ swing.qvel, swing.momentum, rtol=1e-6, atol=1e-9))

    def mobility(self) -> Array:
        """Rates over generalised impulses at the latest data, M^-1 less what loops take, shape (nv, nv), float64."""
        inverse, J = np.linalg.inv(self.mass_matrix()), self.loop_jacobian()
        if len(J):
            W = inverse @ J.T
            inverse = inverse - W @ np.linalg.pinv(J @ W, rcond=1e-10, hermitian=True) @ W.T
        return np.asarray(inverse, dtype=np.float64)

    def energies(self, y: Array) -> tuple[float, float]:
        """Kinetic energy, and that less works, plus the potential of gravity and springs, at y [J]."""
        data = self.advance(y)
        self.mj.mj_energyPos(self.model, data)
        kinetic = 0.5 * float(data.qvel @ self.mass_matrix() @ data.qvel)
        return kinetic, kinetic + float(data.energy[0]) - float(y[-2:].sum())

    def point_jacobian(self, body: int, point: Array) -> Array:
        """d(velocity of a point that moves with a body) / d(rates) at the latest data, shape (3, nv), float64."""
        J = np.zeros((3, self.nv))
        self.mj.mj_jac(self.model, self.data, J, None, np.asarray(point, dtype=np.float64), body)
        return J

    def rates_of(self, joint: int) -> int:
        """Number of independent rates of a joint."""
        return {0: 6, 1: 3}.get(int(self.model.jnt_type[joint]), 1)

    def carrier(self, link: int) -> int:
        """The body that a link without mass and joints belongs to: the next one with mass towards the root."""
        while link and self.model.body_mass[link] == 0.0 and self.model.body_jntnum[link] == 0:
            link = int(self.model.body_parentid[link])
        return link

    def motion(self, link: int) -> Motion:
        """Pose and motion of a link at the latest data."""
        J, turning = np.zeros((3, self.nv)), np.zeros((3, self.nv))
        origin = np.array(self.data.xpos[link])
        self.mj.mj_jac(self.model, self.data, J, turning, origin, link)
        v = np.array(self.data.qvel)
        return Motion(origin, np.array(self.data.xmat[link]).reshape(3, 3), J @ v, turning @ v)

    def point(self, link: int, local: Array) -> Array:
        """A point in the frame of a link, in the world [m], shape (3,), float64."""
        return np.array(self.data.xpos[link]) + np.array(self.data.xmat[link]).reshape(3, 3) @ local

    def local(self, link: int, point: Array) -> Array:
        """A point of the world in the frame of a link [m], shape (3,), float64."""
        return (point - np.array(self.data.xpos[link])) @ np.array(self.data.xmat[link]).reshape(3, 3)

    def matrix(self, quaternion: Array) -> Array:
        """The rotation of a quaternion (w, x, y, z) [-], shape (3, 3), float64."""
        found = np.zeros(9)
        self.mj.mju_quat2Mat(found, quaternion)
        return found.reshape(3, 3)

    def quaternion(self, matrix: Array) -> Array:
        """The quaternion (w, x, y, z) of a rotation [-], shape (4,), float64."""
        found = np.zeros(4)
        self.mj.mju_mat2Quat(found, np.ascontiguousarray(matrix).reshape(-1))
        return found

    def armature(self) -> Array:
        """Of all rates [kg m^2, kg], shape (nv,), float64."""
        return np.array(self.model.dof_armature)

    def momenta(self, link: int, centre: Array, momentum: Array, spin: Array) -> Array:
        """Generalised momenta of a body that a link carries at the latest data, shape (nv,), float64.

        Args:
            link: that carries it.
            centre: its mass centre [m], shape (3,).
            momentum, spin: linear [kg m/s] and angular about the centre [kg m^2/s], each shape (3,).
        """
        J, turning = np.zeros((3, self.nv)), np.zeros((3, self.nv))
        self.mj.mj_jac(self.model, self.data, J, turning, centre, link)
        return J.T @ momentum + turning.T @ spin
