"""Owns the cases of impacts on machines: a strike by the tip of jointed links, and a wrist that holds a bar."""

from __future__ import annotations

import math

import numpy as np

import warp_mca as mca
from warp_mca.verify.body_joints import link
from warp_mca.verify.case import Row, Setup, case

ALUMINIUM = mca.Elastic(E=70e9, nu=0.33, rho=2700.0)
BAR = (0.2, 0.02, 0.02)  # size [m]
ROOT = 0.1  # length of the steel block that holds the bar [m]


def wrist_arm(tied: bool) -> mca.Scene:
    """Six links, of which three have axes that meet; the last one holds a bar, which is struck at its end.

    The bar hangs on the mean motion of its end face, or, `tied`, on nodes of a rigid block that is welded to the link.
    """
    spec = (((0.0, 0.0, 1.0), 0.3), ((0.0, 1.0, 0.0), 0.4), ((0.0, 1.0, 0.0), 0.4))
    spec += (((1.0, 0.0, 0.0), 0.0), ((0.0, 1.0, 0.0), 0.0), ((0.0, 0.0, 1.0), 0.1))
    servo = mca.PositionServo(kp=500.0, kv=20.0)
    bodies, joints, x = [], [], 0.0
    for k, (axis, length) in enumerate(spec):
        own = {"mass": 5.0 - 0.6 * k, "inertia": (0.05, 0.06, 0.04), "centre": (0.5 * length, 0.0, 0.0)}
        bodies.append(link(f"l{k}", (x, 0.0, 0.0), **own))
        freedom = mca.Freedom(axis=axis, armature=0.1, damping=1.0, motor=servo)
        other = f"l{k - 1}" if k else None
        joints.append(mca.Articulation(name=f"J{k}", body=f"l{k}", other=other, freedoms=(freedom,)))
        x += length
    if tied:
        box = mca.Box(size=(ROOT, *BAR[1:]), divisions=(2, 4, 4), origin=(-ROOT, -0.01, -0.01))
        small = {"mass": 1e-3, "inertia": (1e-6, 1e-6, 1e-6)}
        bodies.append(mca.Body(name="root", geometry=box, rigid=True, position=(x, 0.0, 0.0), **small))
        joints.append(mca.Weld(name="R", body="root", other="l5"))
        joints.append(mca.Weld(name="T", body="bar", nodes="xmin", other="root", other_nodes="xmax"))
    else:
        joints.append(mca.Articulation(name="T", body="bar", nodes="xmin", other="l5"))
    bar = mca.Box(size=BAR, divisions=(20, 4, 4), origin=(0.0, -0.01, -0.01))
    bodies.append(mca.Body(name="bar", geometry=bar, material=ALUMINIUM, position=(x, 0.0, 0.0)))
    pulse = mca.Amplitude.half_sine(5e-4)
    return mca.Scene(
        name="wrist_arm",
        bodies=tuple(bodies),
        joints=tuple(joints),
        loads=(mca.Force(body="bar", nodes="xmax", force=(0.0, 0.0, 500.0), amplitude=pulse),),
        probes=(mca.Probe(name="end", body="bar", nodes="xmax"),),
        gravity=(0.0, 0.0, -9.81),
        impact=mca.ImpactPhase(duration=1e-3, output_interval=2e-5),
    )


@case(
    group="rigid",
    title="A rigid arm with a wrist holds a flexible bar by its face",
    reference="The same bar on nodes of a rigid block; the ledger.",
    elements=("hex8i",),
)
def wrist(setup: Setup) -> list[Row]:
    """A bar of 20 mm x 20 mm x 0.2 m on six driven axes is struck by 500 N for 0.5 ms."""
    held, known = (setup.run(wrist_arm(tied)) for tied in (False, True))
    end, tied_end = (run.probes[0].position[:, 2] for run in (held, known))
    most = float(np.abs(tied_end).max())
    error, worked = float(np.abs(held["E_total_error"]).max()), float(np.abs(held.summary["energy"]["external_work"]))
    soft = "the face may warp where its mean motion is held, and may not where its nodes are"
    return [
        Row("greatest difference of the bar's end from that on a rigid block", 0.0,
            (float(np.abs(end - tied_end).max()),), "m", 0.02, soft, scale=most),
        Row("greatest imbalance of the ledger", 0.0, (error,), "J", 3e-3, "as asked for", scale=worked),
    ]  # fmt: skip


MASS, ALONG, ACROSS = 2.0, 0.01, 0.03  # of each link of 1 m [kg], and its inertias [kg m^2]
RATES = np.array([0.5, 0.3])  # of both hinges before the strike [rad/s]
BALL, GAP = 0.05, 1e-6  # radius of the tip, and its height above the plane at first [m]


def strike(armature: float) -> mca.Scene:
    """Two links in a line, of which the second has a ball at its end, fall on a plane."""
    first, tip = float(RATES[0]), float(2.0 * RATES[0] + RATES[1])
    bodies = (
        link("a", mass=MASS, inertia=(ALONG, ACROSS, ACROSS), angular_velocity=(0.0, first, 0.0)),
        mca.Body(
            name="b",
            rigid=True,
            mass=MASS,
            inertia=(ACROSS, ACROSS, ALONG),
            centre=(0.0, 0.0, -0.5),
            geometry=mca.Sphere(radius=BALL, section=4),
            position=(2.0, 0.0, 0.0),
            rotation=(0.0, math.pi / 2.0, 0.0),  # its pole points down
            velocity=(0.0, 0.0, -tip),
            angular_velocity=(0.0, float(RATES.sum()), 0.0),
        ),
    )
    hinge = (mca.Freedom(axis=(0.0, 1.0, 0.0), armature=armature),)
    elbow = {"at": (0.0, 0.0, -1.0), "other": "a", "other_at": (1.0, 0.0, 0.0)}
    plane = mca.RigidPlane(point=(0.0, 0.0, -BALL - GAP), normal=(0.0, 0.0, 1.0))
    return mca.Scene(
        name="strike",
        bodies=bodies,
        joints=(
            mca.Articulation(name="A", body="a", freedoms=hinge),
            mca.Articulation(name="B", body="b", freedoms=hinge, **elbow),
        ),
        contacts=(mca.Contact(slave=mca.Surface(body="b", nodes="pole"), master=plane, penalty=0.1),),
        impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-5),
    )


@case(
    group="rigid",
    title="The tip of two jointed links strikes a plane elastically: impulse 2 m v of the effective mass",
    reference="m = 1 / (n M^-1 n) with the mass matrix M of both hinges and n = (2 m, 1 m).",
    elements=("hex8i",),
)
def jointed_strike(setup: Setup) -> list[Row]:
    """Links of 2 kg and 1 m without rotors in the hinges, and with rotors of 0.1 kg m^2."""
    rows, n = [], np.array([2.0, 1.0])
    for armature, name in ((0.0, "no rotors"), (0.1, "rotors")):
        first, second = np.array([0.5, 0.0]), np.array([1.5, 0.5])
        M = MASS * (np.outer(first, first) + np.outer(second, second)) + armature * np.eye(2)
        M += ACROSS * (np.outer([1.0, 0.0], [1.0, 0.0]) + np.ones((2, 2)))
        exact = 2.0 * float(n @ RATES) / float(n @ np.linalg.solve(M, n))
        result = setup.run(strike(armature))
        found = float(result["F_n_N"].sum()) * 1e-5
        rows.append(Row(f"impulse with {name}", exact, (found,), "N s", 1e-4, "the links turn a little meanwhile"))
    return rows
