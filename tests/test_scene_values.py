"""Tests that the classes of a scene refuse values of another kind in one sentence, wherever they are given."""

from __future__ import annotations

import math

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.errors import RequestError

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
BOX = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1))
SIDE = mca.Surface(body="a", nodes="xmax")
BODY = mca.Body(name="a", geometry=BOX, material=STEEL)
LINE = mca.Line(body="a", start=(0.0, 0.0, 0.0), end=(1.0, 0.0, 0.0))
TIP = mca.Tip(body="a", centre=(0.0, 0.0, 0.0), radius=0.1)
SOUND = {
    mca.Elastic: {"E": 210e9, "nu": 0.3, "rho": 7850.0},
    mca.J2Bilinear: {"E": 210e9, "nu": 0.3, "rho": 7850.0, "sigma_y": 4e8, "E_t": 1e9, "beta": 0.5},
    mca.Body: {"name": "a", "geometry": BOX, "material": STEEL, "position": (0.0, 0.0, 0.0)},
    mca.Point: {"body": "a", "at": (0.0, 0.0, 0.0)},
    mca.Line: {"body": "a", "start": (0.0, 0.0, 0.0), "end": (1.0, 0.0, 0.0), "position": 0.0},
    mca.RigidPlane: {"point": (0.0, 0.0, 0.0)},
    mca.Contact: {"slave": SIDE, "master": mca.RigidPlane(), "mu": 0.3, "penalty": 1.0},
    mca.Revolute: {"name": "O", "body": "a", "at": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)},
    mca.Fixed: {"body": "a", "nodes": "xmin", "axes": "xy"},
    mca.Prescribed: {"body": "a", "nodes": "xmin", "axis": "x", "times": (0.0, 1.0), "velocities": (0.0, 1.0)},
    mca.RigidPhase: {"theta": (1.0,), "theta_dot": (0.0,), "tip": TIP, "target": mca.RigidPlane()},
    mca.BaseMotion: {"times": (0.0, 1.0), "vx": (0.0, 1.0), "vy": (0.0, 0.0)},
    mca.Slide: {"direction": (1.0, 0.0, 0.0), "carriage_mass": 0.1, "velocity": 0.0},
    mca.JointTorque: {"joint": "O", "times": (0.0, 1.0), "torques": (0.0, 1.0)},
    mca.ImpactPhase: {"duration": 1e-3, "time_step_scale": 0.9},
    mca.Surface: {"body": "a", "nodes": "xmin"},
    mca.Tip: {"body": "a", "centre": (0.0, 0.0, 0.0), "radius": 0.1},
    mca.Path: {"name": "p", "lines": (LINE,), "spacing": 0.1},
    mca.Scene: {"name": "s", "bodies": (BODY,), "impact": mca.ImpactPhase(duration=1e-3)},
}


@pytest.mark.parametrize(
    ("kind", "field", "value"),
    [
        (mca.Elastic, "E", "210e9"),
        (mca.Elastic, "E", None),
        (mca.Elastic, "E", 10**400),
        (mca.Elastic, "nu", "0.3"),
        (mca.J2Bilinear, "E_t", None),
        (mca.J2Bilinear, "beta", "isotropic"),
        (mca.Body, "geometry", "part.msh"),
        (mca.Body, "geometry", mca.Box),
        (mca.Body, "material", "steel"),
        (mca.Body, "material", {"core": "steel"}),
        (mca.Body, "position", 0.0),
        (mca.Body, "position", ("0", "0", "0")),
        (mca.Point, "at", (0.0, math.nan, 0.0)),
        (mca.Line, "position", math.nan),
        (mca.RigidPlane, "point", None),
        (mca.Contact, "slave", "a"),
        (mca.Contact, "master", "b"),
        (mca.Contact, "mu", "rough"),
        (mca.Revolute, "axis", (0.0, 0.0, 0.0)),
        (mca.Fixed, "axes", 1),
        (mca.Prescribed, "times", (0.0, math.nan)),
        (mca.Prescribed, "velocities", (0.0, math.inf)),
        (mca.RigidPhase, "theta", (math.nan,)),
        (mca.RigidPhase, "theta_dot", 0.0),
        (mca.BaseMotion, "vx", (0.0, math.nan)),
        (mca.BaseMotion, "vy", (0.0,)),
        (mca.Slide, "direction", (0.0, 0.0, 1.0)),
        (mca.Slide, "carriage_mass", -1.0),
        (mca.JointTorque, "joint", 5),
        (mca.JointTorque, "torques", None),
        (mca.ImpactPhase, "duration", "1e-3"),
        (mca.ImpactPhase, "time_step_scale", None),
        (mca.Body, "name", 5),
        (mca.Point, "body", None),
        (mca.Line, "body", 5),
        (mca.Surface, "nodes", ["xmin"]),
        (mca.Revolute, "other", 5),
        (mca.Fixed, "nodes", 5),
        (mca.Prescribed, "nodes", None),
        (mca.Prescribed, "times", {0.0: 0.0, 1.0: 1.0}),
        (mca.Prescribed, "times", {0.0, 1.0}),
        (mca.Prescribed, "velocities", np.float64(1.0) + np.zeros(())),
        (mca.Prescribed, "velocities", (x for x in (0.0, 1.0))),
        (mca.RigidPhase, "tip", SIDE),
        (mca.RigidPhase, "target", "a"),
        (mca.Tip, "body", 5),
        (mca.Path, "lines", LINE),
        (mca.Path, "name", None),
        (mca.Scene, "name", None),
        (mca.Scene, "bodies", BODY),
        (mca.Scene, "bodies", (body for body in [BODY])),
        (mca.Scene, "contacts", mca.Contact(slave=SIDE, master=mca.RigidPlane())),
        (mca.Scene, "impact", None),
        (mca.Scene, "rigid", mca.ImpactPhase(duration=1.0)),
        (mca.Scene, "tip", SIDE),
        (mca.Scene, "target", "a"),
        (mca.Scene, "parameters", None),
    ],
)
def test_another_kind_of_value_is_refused_by_name(kind, field, value):
    kind(**SOUND[kind])
    with pytest.raises(RequestError, match=rf"\b{field} = .+: (give|must|use|name|the tangent|Poisson)") as error:
        kind(**{**SOUND[kind], field: value})
    assert "\n" not in str(error.value)


def test_parts_of_another_kind_are_named_by_their_place():
    with pytest.raises(RequestError, match=r"Scene\.joints\[1\] = 'Surface': give a Revolute"):
        hinge = mca.Revolute(name="O", body="a", at=(0.0, 0.0, 0.0))
        mca.Scene(**{**SOUND[mca.Scene], "joints": [hinge, SIDE]})


def test_a_pair_of_surfaces_meets_once():
    bodies = (mca.Body(name="a", geometry=BOX, material=STEEL),)
    pair = mca.Contact(slave=SIDE, master=mca.RigidPlane())
    again = mca.Contact(slave=SIDE, master=mca.RigidPlane(), mu=0.1)
    impact = mca.ImpactPhase(duration=1e-6)
    corner = [mca.RigidPlane(normal=np.eye(3)[k]) for k in range(2)]  # one surface may meet two planes, given as arrays
    walls = tuple(mca.Contact(slave=SIDE, master=plane) for plane in corner)
    mca.Scene(name="s", bodies=bodies, contacts=walls, impact=impact)
    mca.Scene(name="s", bodies=bodies, contacts=(pair,), impact=impact)
    with pytest.raises(RequestError, match=r"Scene\.contacts = 'xmax of a': it meets the same master twice"):
        mca.Scene(name="s", bodies=bodies, contacts=(pair, again), impact=impact)


def test_a_point_off_its_body_is_refused():
    body = mca.Body(name="a", geometry=BOX, material=STEEL)
    near, far = (mca.Point(body="a", at=(x, 0.5, 0.5)) for x in (1.05, 2.0))
    mca.run(mca.Scene(name="s", bodies=(body,), tip=near, impact=mca.ImpactPhase(duration=1e-6)))
    with pytest.raises(RequestError, match=r"Point of a\.at = \(2.0, 0.5, 0.5\): that is 1 m off the body"):
        mca.run(mca.Scene(name="s", bodies=(body,), tip=far, impact=mca.ImpactPhase(duration=1e-6)))


def test_a_name_that_no_file_can_hold_is_refused():
    with pytest.raises(RequestError, match=r"Scene\.name = .*UTF-8 can encode"):
        mca.Scene(name="\ud800", bodies=(), impact=mca.ImpactPhase(duration=1.0))
