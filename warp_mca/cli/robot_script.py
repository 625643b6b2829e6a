"""Owns the answer to `warp-mca run arm.xml`: a scene file in which the robot strikes, to start from."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.robots.reading import SUFFIXES

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

    path = Path(name).resolve()
    machine = Machine(Robot(path))
    keys = [key for key in machine.keyframes if key]
    if keys:
        machine = Machine(Robot(path, keyframe=keys[0]))
    more = f', keyframe="{keys[0]}"' if keys else ""
    if not machine.meets_the_world:
        more += ", against=(mca.RigidPlane(normal=(0.0, 0.0, 1.0)),)"
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
