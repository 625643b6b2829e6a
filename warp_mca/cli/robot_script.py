"""Owns the answer to `warp-mca run arm.xml`: a scene file in which the robot strikes, to start from."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.robots.reading import SUFFIXES

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine
    from warp_mca.robots.robot import Robot

DROP = 0.05  # of the floor below the lowest point of a machine that has nothing else to strike [m]

_SCRIPT = '''"""{name} swings until it touches something, and strikes it."""

import warp_mca as mca

# Links: {links}
# flexible={{"LINK": recipe}}, material=... and mounts={{"LINK": "NODE SET"}} make one of finite elements.
# Joints, with their start [m, rad]: {joints}
# Actuators: {actuators}
# Keyframes: {keys}


def build(*, stiffness: float = 1e8, mu: float = 0.0) -> mca.Scene:
    robot = mca.Robot({path}{more})
    impact = mca.ImpactPhase(duration=2e-3, output_interval=2e-6)
    return robot.strike(impact=impact, stiffness=stiffness, mu=mu)
'''


def is_robot(name: str) -> bool:
    """Whether a file of that name holds a robot, not a scene."""
    return Path(name).suffix.lower() in SUFFIXES


def robot_script(name: str) -> str:
    """A scene file in which the robot in the file `name` strikes; with a floor where the file has nothing to touch.

    Raises:
        RequestError: the file cannot be read, or holds what a machine does not carry.
    """
    from warp_mca.robots.machine import Machine
    from warp_mca.robots.robot import Robot
    from warp_mca.scene import RigidPlane

    path = Path(name).resolve()
    keys, qpos = _start(path)
    given: dict[str, Any] = {"keyframe": keys[0] if keys else None, "qpos": qpos or None}
    machine = Machine(Robot(path, **given))
    low, apart = _surroundings(Robot(path, **given, against=(RigidPlane(normal=(0.0, 0.0, 1.0)),)), machine)
    more = f', keyframe="{keys[0]}"' if keys else ""
    more += f", qpos={json.dumps(qpos)}" if qpos else ""
    more += f", touch={apart!r}" if apart else ""
    if not machine.meets_the_world:
        more += f", against=(mca.RigidPlane(point=(0.0, 0.0, {low - DROP:.3f}), normal=(0.0, 0.0, 1.0)),)"
    start = zip(machine.names.joints, machine.model.jnt_qposadr, strict=True)
    return _SCRIPT.format(
        name=path.name,
        links=", ".join(machine.names.bodies),
        joints=", ".join(f"{joint} {machine.start[at]:.4g}" for joint, at in start) or "none",
        actuators=", ".join(machine.names.actuators) or "none; servos={'JOINT': mca.PositionServo(...)} adds some",
        keys=", ".join(keys) or "none; qpos= and qvel= give the start",
        path=json.dumps(str(path)),
        more=more,
    )


def _surroundings(robot: Robot, machine: Machine) -> tuple[float, tuple[str, ...]]:
    """Height of a machine's lowest point [m], and links that may touch where others overlap each other at the start.

    Args:
        robot: against a floor at a height of 0.
        machine: of it.
    """
    from warp_mca.robots.reading import scenery

    q, beside = machine.start[: machine.nq], scenery(machine.model)
    low, links, overlapping = math.inf, [], set()
    for pair in robot.pairs(machine):
        gap, own = pair.gap(0.0, q), [side.link for side in (pair.first, pair.second)]
        if pair.second.plane is not None:
            low = min(low, gap)
            links.append(pair.first.link)
        elif gap < 0.0 and not beside[own].any():
            overlapping |= set(own)
    apart = [link for link in dict.fromkeys(links) if link not in overlapping]
    low = low if math.isfinite(low) else 0.0
    return low, tuple(machine.names.body(link) for link in apart) if overlapping else ()


def _start(path: Path) -> tuple[list[str], dict[str, float]]:
    """Names of a file's keyframes, and middles of the ranges of joints that start beyond them, without or at the first.

    Raises:
        RequestError: the file cannot be read.
    """
    from warp_mca.robots.machine import Names
    from warp_mca.robots.reading import compiled, mujoco
    from warp_mca.robots.robot import Robot

    mj, (_, model) = mujoco("Robot.file", path), compiled(Robot(path))
    named = [(key, mj.mj_id2name(model, int(mj.mjtObj.mjOBJ_KEY), key)) for key in range(model.nkey)]
    keys = [(key, name) for key, name in named if name]
    q = model.key_qpos[keys[0][0]] if keys else model.qpos0
    found = {}
    for joint, (low, high) in enumerate(model.jnt_range.tolist()):
        scalar = int(model.jnt_type[joint]) >= int(mj.mjtJoint.mjJNT_SLIDE)
        if scalar and model.jnt_limited[joint] and not low <= q[model.jnt_qposadr[joint]] <= high:
            found[Names(mj, model).joints[joint]] = round(0.5 * (low + high), 4)
    return [name for _, name in keys], found


def print_script(name: str) -> None:
    """Print a scene file for the robot in the file `name`, and say on standard error what to do with it.

    Raises:
        RequestError: as in `robot_script`.
    """
    print(robot_script(name), end="")
    script = f"{Path(name).stem}_strike.py"
    print(
        f"{Path(name).name} is a robot, not a scene: in the script on standard output it strikes; save it with "
        f"'warp-mca run {name} > {script}', then run it with 'warp-mca run {script}'",
        file=sys.stderr,
    )


def no_scene(name: str) -> RequestError:
    """The error that the robot in the file `name` is no scene, for commands that make none of it."""
    script = f"{Path(name).stem}_strike.py"
    remedy = f"it is a robot, not a scene; make one with 'warp-mca run {name} > {script}', then name {script}"
    return bad_value("scene", name, remedy)
