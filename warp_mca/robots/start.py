"""Owns the start of a machine: coordinates, rates and controls, from the file and from what is given beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import RequestError, bad_value

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine
    from warp_mca.robots.robot import Robot

BEYOND = 0.01  # of the range of a joint that it may be beyond a limit at the start, as after an impact
CLOSED = 1e-8  # gap of a loop at the start [m, rad], and rate at which it opens [m/s, rad/s]


def start_of(machine: Machine, robot: Robot) -> Array:
    """Coordinates and rates at the start, shape (nq + nv,), float64; sets the machine's controls too.

    Raises:
        RequestError: a name is not known, numbers are missing, or the start violates a limit or opens a loop.
    """
    model, data, names = machine.model, machine.data, machine.names
    machine.mj.mj_resetData(model, data)
    if robot.keyframe is not None:
        keys = machine.keyframes
        if robot.keyframe not in keys:
            raise bad_value("Robot.keyframe", robot.keyframe, f"the file's are {', '.join(keys) or 'none'}")
        machine.mj.mj_resetDataKeyframe(model, data, keys.index(robot.keyframe))
    ends = {"q": [*model.jnt_qposadr, machine.nq], "v": [*model.jnt_dofadr, machine.nv]}
    place = lambda key: lambda k: slice(int(ends[key][k]), int(ends[key][k + 1]))  # noqa: E731
    q = filled("Robot.qpos", robot.qpos, np.array(data.qpos), names.joints, place("q"), "joint")
    v = filled("Robot.qvel", robot.qvel, np.array(data.qvel), names.joints, place("v"), "joint")
    if robot.keyframe is None:
        _follow(machine, robot, q, v)
    ctrl = np.array(data.ctrl)
    for name, servo in robot.servos.items():
        ctrl[names.actuators.index(name)] = servo.target
    one = lambda k: slice(k, k + 1)  # noqa: E731
    machine.ctrl = filled("Robot.ctrl", robot.ctrl, ctrl, names.actuators, one, "actuator")
    y = np.concatenate([q, v])
    machine.set(data, y)
    machine.mj.mj_fwdPosition(model, data)
    _check_limits(machine, y)
    _check_loops(machine)
    return y


def _follow(machine: Machine, robot: Robot, q: Array, v: Array) -> None:
    """Let joints that equalities gear follow, as mimic joints of a URDF, where no start is given for them.

    q_1 = q_1(0) + p(q_2 - q_2(0)) with a polynomial p.
    """
    model, names = machine.model, machine.names
    kind = int(machine.mj.mjtEq.mjEQ_JOINT)
    geared = [k for k in range(model.neq) if model.eq_active0[k] and int(model.eq_type[k]) == kind]
    free = lambda given, k: given is None or (isinstance(given, Mapping) and names.joint(k) not in given)  # noqa: E731
    for _ in geared:  # one may follow another one
        for k in geared:
            one, other = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            p, x, rate = np.polynomial.Polynomial(model.eq_data[k, :5]), 0.0, 0.0
            if other >= 0:
                place = int(model.jnt_qposadr[other])
                x, rate = q[place] - model.qpos0[place], v[model.jnt_dofadr[other]]
            if free(robot.qpos, one):
                q[model.jnt_qposadr[one]] = model.qpos0[model.jnt_qposadr[one]] + p(x)
            if free(robot.qvel, one):
                v[model.jnt_dofadr[one]] = p.deriv()(x) * rate


def _check_limits(machine: Machine, y: Array) -> None:
    beyond = []
    for place, dof, (low, high) in zip(machine.limited_q, machine.limited, machine.range, strict=True):
        if not low - (more := BEYOND * (high - low)) <= y[place] <= high + more:
            beyond.append((machine.names.joint(int(machine.model.dof_jntid[dof])), float(y[place]), low, high))
    if beyond:
        (name, value, low, high), *others = beyond
        also = f"; so must {', '.join(other for other, *_ in others)}" if others else ""
        raise bad_value(f"Robot.qpos of joint {name}", value, f"start within its limits, {low:g} to {high:g}{also}")


def _check_loops(machine: Machine) -> None:
    data = machine.data
    if not data.nefc:
        return
    machine.mj.mj_fwdVelocity(machine.model, data)
    for field, value, unit in (("qpos", data.efc_pos, "m or rad"), ("qvel", data.efc_vel, "m/s or rad/s")):
        if (worst := float(np.abs(value).max())) > CLOSED:
            remedy = f"it opens the loops of the file by {worst:.3g} {unit}; give one that keeps them closed"
            raise bad_value(f"Robot.{field}", "as given", remedy)


def filled(field: str, given: Any, start: Array, names: list[str], places: Callable[[int], slice], what: str) -> Array:
    """A copy of the vector `start` with what is given for it: all of it, or parts by the name of joint or actuator.

    Raises:
        RequestError: a name is not known, or the numbers are not as many as needed.
    """
    values = start.copy()
    if given is None:
        return values
    if not isinstance(given, Mapping):
        if not validate.is_list(given) or len(given) != len(start):
            remedy = f"give {len(start)} finite numbers, or some by the name of the {what}"
            raise bad_value(field, validate.brief(given), remedy)
        values[:] = given
        return values
    for name, value in given.items():
        if name not in names:
            raise bad_value(field, name, f"the file's {what}s are {', '.join(names) or 'none'}")
        place = places(names.index(name))
        entry = (value,) if validate.is_number(value) else value
        if not validate.is_list(entry) or len(entry) != place.stop - place.start:
            count = place.stop - place.start
            raise RequestError(f"{field}[{name!r}] = {validate.brief(value)}: give {count} finite number(s)")
        values[place] = entry
    return values
