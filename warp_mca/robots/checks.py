"""Owns the checks of what a `Robot` is given."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from types import NoneType
from typing import TYPE_CHECKING, Any

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene import Body, PositionServo, RigidPlane
from warp_mca.scene.materials import Material

if TYPE_CHECKING:
    from warp_mca.robots.robot import Robot


def check(robot: Robot) -> None:
    """Check the fields of a robot, but for its file and the bodies of flexible links.

    Raises:
        RequestError: one is not what it must be.
    """
    validate.kinds("Robot", (str, os.PathLike), "give the path of a file", path=robot.path)
    validate.kinds("Robot", Mapping, "give a Body for each link by its name", flexible=robot.flexible)
    validate.kinds("Robot", Mapping, "give a PositionServo for each joint by its name", servos=robot.servos)
    validate.kinds("Robot", Mapping, "give the node set that holds each flexible link", mounts=robot.mounts)
    for name in robot.mounts:
        if name not in robot.flexible:
            raise bad_value("Robot.mounts", name, "this link is rigid; name it in flexible, or leave it out")
    for name, servo in robot.servos.items():
        validate.kind_of(f"Robot.servos[{name!r}]", servo, PositionServo, "give a PositionServo")
        if not validate.is_number(servo.target):
            raise bad_value(f"Robot.servos[{name!r}].target", "Amplitude", "give a number, or a controller")
    validate.kinds("Robot", (str, NoneType), "give the name of a keyframe", keyframe=robot.keyframe)
    validate.members("Robot", (RigidPlane, Body), against=robot.against)
    for item in robot.against:
        if isinstance(item, Body) and item.is_inertia:
            raise bad_value("Robot.against", item.name, "it is a mass without surface; give it a geometry")
    validate.kinds("Robot", (tuple, list), "give a tuple of names", touch=robot.touch)
    validate.texts("Robot", **{f"touch[{k}]": name for k, name in enumerate(robot.touch)})
    validate.unique("Robot.against", [body.name for body in robot.against if isinstance(body, Body)], "body")
    if robot.controller is not None and not callable(robot.controller):
        raise bad_value("Robot.controller", validate.brief(robot.controller), "give a function of (t, qpos, qvel)")
    if (robot.controller is None) != (robot.period is None):
        raise bad_value("Robot.period", robot.period, "give a controller and the period at which it is called")
    if robot.period is not None:
        validate.times("Robot", period=robot.period)
    validate.finite("Robot", clock=robot.clock)


def flexible_body(name: str, item: Any, material: Material | None) -> Body:
    """The body that a flexible link is made of, by the link's name.

    Raises:
        RequestError: it is none, is rigid, or moves by itself.
    """
    owner = f"Robot.flexible[{name!r}]"
    validate.texts("Robot", flexible=name)
    if not isinstance(item, Body):
        if material is None:
            raise bad_value("Robot.material", None, f"give the material of {owner}, or a Body there")
        return Body(name=name, geometry=item, material=material)
    for key in ("velocity", "angular_velocity"):
        if any(getattr(item, key)):
            raise bad_value(f"{owner}.{key}", getattr(item, key), "a link moves as the machine does; leave it 0")
    if item.rigid:
        raise bad_value(f"{owner}.rigid", True, "links that are not named in flexible are rigid; leave it out")
    return replace(item, name=name)
