"""Builds the arms of `single_link`, `two_link` and `three_link`: rods hinged in a row over a plate."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import warp_mca as mca
from warp_mca.base.errors import bad_value

Angles = tuple[float, ...]


def fine(axial: int) -> dict[str, object]:
    """The preset "fine" of arms whose rods have `axial` cells along their cylinders."""
    return {
        "section": 12,
        "ring": 4,
        "axial": axial,
        "focus_size": 0.33e-3,
        "focus_layers": 7,
        "plate_core": 18,
        "plate_core_depth": 5,
        "plate_layers": 12,
        "plate_extension": 20,
    }


@lru_cache(maxsize=64)  # who chooses a model of the scene builds it again
def _approach_angle(
    names: tuple[str, ...], length: float, radius: float, H: float, gravity: float, theta: Angles
) -> float:
    """Angle of the last link at contact [rad], by the slender-rod chain: where the tip's mesh must be fine."""
    from warp_mca.rigid.chain import Chain
    from warp_mca.rigid.link import slender_link
    from warp_mca.rigid.swing import swing

    count, last = len(names), names[-1]
    if count * length <= H:
        raise bad_value("H", H, f"the tip reaches {count * length:g} m below O and never touches the plate; lower H")
    links = tuple(
        slender_link(name, (length, 0.0), mass=1.0, hinge_out=(0.0, 0.0) if name == last else (length, 0.0))
        for name in names
    )
    chain = Chain(links=links, origin=(0.0, 0.0), gravity=(0.0, -gravity))
    centre = length - radius

    def gap(_t: float, angle) -> float:
        height = H
        for k in range(count - 1):
            height -= length * math.cos(angle[k])
        return height - centre * math.cos(angle[-1]) - radius

    angle = round(float(swing(chain, theta, [0.0] * count, gap, t_max=5.0, kept=False).theta[-1]), 3)
    if abs(angle) > math.radians(60.0):
        remedy = f"{last} would strike at {math.degrees(angle):.0f} deg, beyond the tip's fine end; raise H"
        raise bad_value("H", H, remedy)
    return angle


def _bodies(
    links: Sequence[str],
    rods: Sequence[mca.Rod],
    materials: Mapping[str, mca.Elastic],
    plate: mca.Body,
) -> tuple[mca.Body, ...]:
    """The rods, the last one with its tip, and the plate."""
    *inner, last = (
        mca.Body(name=link, geometry=rod, element=plate.element, material=materials["body"], exact_mass=False)
        for link, rod in zip(links, rods, strict=True)  # published figures of these scenes are of the mass of its cells
    )
    tip = replace(last, material={"body": materials["body"], "tip": materials["tip"]})
    return (*inner, tip, plate)


def _rods(meshes: Sequence[Mapping[str, Any]], hinge: str) -> list[mca.Rod]:
    """The rods: plain ones, or with an eye at the inner end of each and a fork for the next one's eye."""
    if hinge == "plain":
        return [mca.Rod(**mesh) for mesh in meshes]
    *inner, last = meshes
    return [*(mca.LugRod(**mesh, end="fork") for mesh in inner), mca.LugRod(**last)]


def _tied_nodes(rod: mca.Rod, joint_nodes: str, pin_radius: float | None) -> dict[str, Any]:
    """What `mca.Revolute` takes for the nodes of a hinge.

    Raises:
        RequestError: a pin in a shaft hole has another radius.
    """
    if isinstance(rod, mca.LugRod):
        if pin_radius is not None:
            raise bad_value("pin_radius", pin_radius, "with hinge=lug a pin fills its hole; leave it out")
        return {"nodes": "hole", "pin_radius": rod.hole_radius}
    if joint_nodes == "pin" or pin_radius is not None:  # which other hinges refuse
        return {"nodes": joint_nodes, "pin_radius": 0.75 * rod.radius if pin_radius is None else pin_radius}
    return {"nodes": joint_nodes}


def _absorbing(which: str) -> tuple[mca.Absorbing, ...]:
    """Absorbing boundaries of the plate, as `absorbs` of `arm`."""
    ends = ("xmin", "xmax")
    if which == "all":
        middle = (0.0, 0.0, 0.0)
        return tuple(mca.Absorbing(body="plate", nodes=n, centre=middle) for n in (*ends, "zmin", "zmax", "bottom"))
    return tuple(mca.Absorbing(body="plate", nodes=nodes) for nodes in ends) if which == "ends" else ()


def _made_rigid(bodies: tuple[mca.Body, ...], names: str | None) -> tuple[mca.Body, ...]:
    """The bodies, those of the `names` rigid.

    Raises:
        RequestError: a name is none of a body.
    """
    wanted = {name.strip() for name in (names or "").split(",")} - {""}
    known = [body.name for body in bodies]
    if wanted - set(known):
        remedy = f"name some of {', '.join(known)}, with commas between them"
        raise bad_value("rigid_bodies", names, remedy)
    return tuple(replace(body, rigid=body.name in wanted) for body in bodies)


def arm(
    name: str,
    links: Sequence[str],
    *,
    theta: Angles,
    length: float,
    radius: float,
    H: float,
    gravity: float,
    rods: Sequence[Mapping[str, Any]],
    focus: Mapping[str, Any],
    materials: Mapping[str, mca.Elastic],
    plate: mca.Plate,
    v_plate: float,
    contact: Mapping[str, Any],
    hinge: str,
    joint_nodes: str,
    pin_radius: float | None,
    rigid_inertia: str,
    impact: mca.ImpactPhase,
    paths: tuple[mca.Path, ...] = (),
    t_end: float | None = None,
    absorbs: str = "none",
    rigid_bodies: str | None = None,
    element: str = mca.Body.element,
) -> mca.Scene:
    """Equal rods, hinged in a row from O at the origin, whose hemispherical tip will strike a plate H below O.

    Args:
        name: of the scene.
        links: names of the rods' bodies, from O outwards; the first letter of each names its inbound hinge.
        theta: initial angles [rad].
        length, radius: of each rod [m].
        H: height of O above the plate [m].
        gravity: acceleration, along -y [m/s^2].
        rods: mesh parameters of each rod, of `mca.Rod`.
        focus: mesh parameters of the fine patch on the tip, without its angle.
        materials: of the rods' cylinders, the tip and the plate, under "body", "tip" and "plate".
        plate: with its origin in the middle of the top.
        v_plate: initial velocity of the plate along x [m/s].
        contact: parameters of the contact of tip and plate.
        hinge: "plain", of rods that meet on the axis, or "lug", a fork and an eye, whose holes a pin couples.
        joint_nodes, rigid_inertia: as `mca.Revolute` and `mca.RigidPhase` take them; lugs do without the former.
        pin_radius: of hinges with "pin" [m]; None: 0.75 of the rods' radius.
        impact: the impact phase.
        paths: lines along which stress is recorded.
        t_end: as in `mca.Scene`.
        absorbs: boundaries of the plate through which waves leave: "none"; its "ends"; "all" but the top, with springs
            in place of the support.
        rigid_bodies: names of the bodies that stay rigid in the impact, with commas between them.
        element: of rods and plate.
    """
    last, tip_centre = links[-1], (length - radius, 0.0, 0.0)
    top = mca.Surface(body="plate", nodes="top")
    ground = mca.Body(
        name="plate",
        geometry=plate,
        element=element,
        material=materials["plate"],
        position=(0.0, -H, 0.0),
        velocity=(v_plate, 0.0, 0.0),
    )
    angle = _approach_angle(tuple(links), length, radius, H, gravity, tuple(theta))
    meshes = [{"radius": radius, "length": length, "tip": "flat", **mesh} for mesh in rods[:-1]]
    meshes.append({"radius": radius, "length": length, **rods[-1], **focus, "focus_angle": angle})
    shapes = _rods(meshes, hinge)
    tied = _tied_nodes(shapes[0], joint_nodes, pin_radius)
    hinges: list[dict[str, Any]] = [{"name": "O", "body": links[0], "at": (0.0, 0.0, 0.0)}]
    hinges += [
        {"name": outer[0], "body": link, "at": (length, 0.0, 0.0), "other": outer} for link, outer in pairwise(links)
    ]
    return mca.Scene(
        name=name,
        bodies=_made_rigid(_bodies(links, shapes, materials, ground), rigid_bodies),
        joints=tuple(mca.Revolute(**hinge, **tied) for hinge in hinges),
        contacts=(mca.Contact(slave=mca.Surface(body=last, nodes="tip"), master=top, **contact),),
        fixed=() if absorbs == "all" else (mca.Fixed(body="plate", nodes="bottom", axes="yz"),),
        absorbing=_absorbing(absorbs),
        paths=paths,
        gravity=(0.0, -gravity, 0.0),
        rigid=mca.RigidPhase(
            theta=theta,
            theta_dot=(0.0,) * len(links),
            tip=mca.Tip(body=last, centre=tip_centre, radius=radius),
            target=top,
            inertia=rigid_inertia,  # pyright: ignore[reportArgumentType]
        ),
        impact=impact,
        t_end=t_end,
        tip=mca.Point(body=last, at=tip_centre),
        target=mca.Point(body="plate", at=(0.0, 0.0, 0.0)),
    )
