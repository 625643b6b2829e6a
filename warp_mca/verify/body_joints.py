"""Owns the cases of joints between whole bodies: trees beside MuJoCo, and chains in free flight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.base.rotation import rotation_matrix
from warp_mca.verify.case import Row, Setup, case

SECOND = "the scheme is of order 2 in the step"
ROUND_OFF = "round-off: impulses are equal and opposite at one point"
AXES = ((0.0, 1.0, 0.0), (0.0, 0.6, 0.8), (1.0, 0.5, 0.0))  # of the hinges of pendulums
INERTIA = (0.02, 0.03, 0.025)
REFERENCE_STEP = 1e-4  # of MuJoCo's Runge-Kutta scheme of order 4 [s]


def link(name: str, at: Sequence[float] | Array = (0.0, 0.0, 0.0), **more: Any) -> mca.Body:
    """A rigid link of 2 kg whose mass centre lies 0.5 m along x."""
    own: dict[str, Any] = {"mass": 2.0, "inertia": INERTIA, "centre": (0.5, 0.0, 0.0)}
    return mca.Body(name=name, rigid=True, position=(float(at[0]), float(at[1]), float(at[2])), **(own | more))


def machine(
    bodies: Sequence[mca.Body], joints: Sequence[Any], steps: int, duration: float = 1.0, **more: Any
) -> mca.Scene:
    """A scene with so many rows, each of which is a step, or more where it must be shorter."""
    impact = mca.ImpactPhase(duration=duration, output_interval=duration / steps)
    return mca.Scene(name="machine", bodies=tuple(bodies), joints=tuple(joints), impact=impact, **more)


def pendulum_chain(count: int, steps: int) -> mca.Scene:
    """Links of 1 m on hinges in different directions, let go from the horizontal; g = 9.81 m/s^2."""
    bodies = [link(f"b{k}", (k, 0.0, 0.0)) for k in range(count)]
    joints = [
        mca.Articulation(
            name=f"J{k}", body=f"b{k}", other=f"b{k - 1}" if k else None, freedoms=(mca.Freedom(axis=AXES[k]),)
        )
        for k in range(count)
    ]
    return machine(bodies, joints, steps, gravity=(0.0, 0.0, -9.81))


def mujoco_positions(xml: str, rows: int, control: Sequence[float] = ()) -> Array:
    """qpos of a MuJoCo model over a second, shape (rows + 1, position_count), float64."""
    import mujoco

    library: Any = mujoco
    model = library.MjModel.from_xml_string(xml)
    data = library.MjData(model)
    data.ctrl[:] = control
    found = [data.qpos.copy()]
    for _ in range(rows):
        for _ in range(round(1.0 / rows / REFERENCE_STEP)):
            library.mj_step(model, data)
        found.append(data.qpos.copy())
    return np.array(found)


def worlds(body: str, actuator: str = "") -> str:
    """A MuJoCo model without contact."""
    option = f'<option gravity="0 0 -9.81" timestep="{REFERENCE_STEP}" integrator="RK4">'
    return (
        f'<mujoco><compiler angle="radian"/>{option}<flag contact="disable"/></option>'
        f"<worldbody>{body}</worldbody><actuator>{actuator}</actuator></mujoco>"
    )


@case(
    group="rigid",
    title="Double and triple pendulums in three dimensions swing on joints without nodes as MuJoCo computes them",
    reference="MuJoCo 4, Runge-Kutta of order 4, steps of 0.1 ms.",
    elements=(),
    needs="mujoco",
)
def jointed_pendulums(setup: Setup) -> list[Row]:
    """Rigid links of 2 kg and 1 m, horizontal at rest at first, over a second."""
    rows, samples = [], setup.choose((2000, 4000), (4000, 8000, 16000))
    for count, name in ((2, "double"), (3, "triple")):
        body = ""
        for k in reversed(range(count)):
            axis = " ".join(map(str, AXES[k]))
            inertia = f'<inertial pos="0.5 0 0" mass="2" diaginertia="{" ".join(map(str, INERTIA))}"/>'
            body = f'<body pos="{min(k, 1)} 0 0">{inertia}<joint type="hinge" axis="{axis}"/>{body}</body>'
        known = mujoco_positions(worlds(body), 100)
        off = []
        for steps in samples:
            result = setup.run(pendulum_chain(count, steps))
            angles = np.stack([result[f"joint_J{k}_q1_rad"] for k in range(count)], axis=1)
            off.append(float(np.abs(angles[:: steps // 100] - known).max()))
        sizes = tuple(1.0 / steps for steps in samples)
        rows.append(
            Row(f"{name} pendulum, greatest difference of an angle", 0.0, off, "rad", 1e-5, SECOND, sizes, 1.0, 1.8)
        )
    return rows


TREE = """<body><inertial pos=".5 0 0" mass="2" diaginertia=".02 .03 .025"/><joint type="ball" damping="0.3"/>
<body pos="1 0 0"><inertial pos=".3 .1 0" mass="1" diaginertia=".02 .03 .025"/>
<joint type="slide" axis="1 0 0" stiffness="200" springref="0.02" damping="2" armature="0.5"/>
<joint name="h" type="hinge" axis="0 1 0.2" pos="0.05 0 0" armature="0.1" damping=".5" stiffness="3"/>
<body pos=".6 .1 0"><inertial pos=".3 0 0" mass=".5" diaginertia=".005 .003 .004"/>
<joint type="hinge" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/></body></body></body>"""


def tree(steps: int, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> mca.Scene:
    """The machine of TREE, all of it turned by a rotation vector [rad]."""
    R, servo = rotation_matrix(turn), mca.PositionServo(kp=20.0, kv=1.0, target=0.5, limits=(-4.0, 4.0))
    slide = mca.Freedom(kind="slide", axis=(1.0, 0.0, 0.0), stiffness=200.0, rest=0.02, damping=2.0, armature=0.5)
    hinge = mca.Freedom(
        axis=(0.0, 1.0, 0.2), at=(0.05, 0.0, 0.0), armature=0.1, damping=0.5, stiffness=3.0, motor=servo
    )
    bodies = (
        link("a", rotation=turn),
        link("b", R @ [1.0, 0.0, 0.0], mass=1.0, centre=(0.3, 0.1, 0.0), rotation=turn),
        link("c", R @ [1.6, 0.1, 0.0], mass=0.5, centre=(0.3, 0.0, 0.0), inertia=(0.005, 0.003, 0.004), rotation=turn),
    )
    y, z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    joints = (
        mca.Articulation(name="A", body="a", freedoms=(mca.Freedom(kind="ball", damping=0.3),)),
        mca.Articulation(name="B", body="b", other="a", other_at=(1.0, 0.0, 0.0), freedoms=(slide, hinge)),
        mca.Universal(name="C", body="c", other="b", other_at=(0.6, 0.1, 0.0), axis=y, second_axis=z),
    )
    g = (R @ [0.0, 0.0, -9.81]).tolist()
    return machine(bodies, joints, steps, gravity=(g[0], g[1], g[2]))


@case(
    group="rigid",
    title="A ball, a slide with a hinge and a universal joint, with springs, dampers, rotors and a servo",
    reference="MuJoCo 4, Runge-Kutta of order 4, steps of 0.1 ms.",
    elements=(),
    needs="mujoco",
)
def jointed_tree(setup: Setup) -> list[Row]:
    """Three links; the servo is at its limit for a time; a copy that is turned as a whole must turn its motion."""
    known = mujoco_positions(worlds(TREE, '<position joint="h" kp="20" kv="1" forcerange="-4 4"/>'), 100, (0.5,))
    names, off, samples = (
        ("B_q1_m", "B_q2_rad", "C_q1_rad", "C_q2_rad"),
        [],
        setup.choose((2000, 4000), (4000, 8000, 16000)),
    )
    found = np.zeros(0)
    result = None
    for steps in samples:
        result = setup.run(tree(steps))
        found = np.stack([result[f"joint_{name}"] for name in names], axis=1)
        off.append(float(np.abs(found[:: steps // 100] - known[:, 4:]).max()))
    turned = setup.run(tree(samples[-1], (0.5, 1.0, -2.0)))
    apart = float(np.abs(np.stack([turned[f"joint_{name}"] for name in names], axis=1) - found).max())
    assert result is not None
    sizes = tuple(1.0 / steps for steps in samples)
    error, most = float(np.abs(result["E_total_error"]).max()), float(result["E_kinetic"].max())
    return [
        Row("greatest difference of a position", 0.0, off, "-", 1e-5, SECOND, sizes, 1.0, 1.8),
        Row("the same of a turned copy", 0.0, (apart,), "-", 1e-9, "round-off", scale=1.0),
        Row("greatest imbalance of the ledger", 0.0, (error,), "J", 1e-5, SECOND, scale=most),
    ]


@case(
    group="rigid",
    title="A chain in free flight keeps momentum and angular momentum",
    reference="Conservation laws.",
    elements=(),
)
def free_chain(setup: Setup) -> list[Row]:
    """Three links on crosses with springs and dampers tumble for a second."""
    W, V = np.array([1.0, 2.0, -3.0]), np.array([0.3, 0.0, 1.0])
    bodies, joints = [], []
    for k in range(3):
        x, y, z = (V + np.cross(W, [k, 0.0, 0.0])).tolist()
        bodies.append(link(f"b{k}", (k, 0.0, 0.0), mass=1.0 + k, velocity=(x, y, z), angular_velocity=(1.0, 2.0, -3.0)))
        cross = (mca.Freedom(axis=(0.0, 1.0, 0.0), stiffness=100.0, damping=0.5), mca.Freedom(axis=(1.0, 0.0, 0.0)))
        if k:
            joints.append(mca.Articulation(name=f"J{k}", body=f"b{k}", other=f"b{k - 1}", freedoms=cross))
    probes = tuple(mca.Probe(name=body.name, body=body.name, at=body.centre) for body in bodies)
    scene = machine(bodies, joints, 4000, probes=probes)
    result = setup.run(scene)
    before, after = np.zeros(6), np.zeros(6)
    for body, probe in zip(bodies, result.probes, strict=True):
        centre = np.array(body.position) + body.centre
        spin = np.diag(np.diag(body.inertia)) @ W
        p = body.mass * (V + np.cross(W, centre))
        before += np.concatenate([p, spin + np.cross(centre, p)])
        own = result.summary["rigid_bodies"][body.name]
        p, centre = np.array(own["momentum"]), probe.position[-1]
        after += np.concatenate([p, own["spin"] + np.cross(centre, p)])
    change = after - before
    sizes = [float(np.linalg.norm(before[part])) for part in (slice(0, 3), slice(3, 6))]
    return [
        Row("change of the momentum", 0.0, (float(np.linalg.norm(change[:3])),), "N s", 1e-10, ROUND_OFF,
            scale=sizes[0]),
        Row("change of the angular momentum", 0.0, (float(np.linalg.norm(change[3:])),), "N m s", 1e-10, ROUND_OFF,
            scale=sizes[1]),
    ]  # fmt: skip
