"""Scenes of rigid bodies alone, whatever their rows: their steps, their first energy, and their figures at the end."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from test_advice import alone
from warning_pairs import joined_cubes
from watched import told_of

import warp_mca as mca
from warp_mca.verify.body_joints import INERTIA, link, mujoco_positions, pendulum_chain, worlds
from warp_mca.watch import meshes

ROWS = (5, 20, 200)


def second(rows: int) -> mca.ImpactPhase:
    """A second in so many rows."""
    return mca.ImpactPhase(duration=1.0, output_interval=1.0 / rows)


def test_a_double_pendulum_swings_alike_in_few_and_many_rows():
    """As in MuJoCo to 2e-5 rad; the summary ends where the history does, in velocity too."""
    pytest.importorskip("mujoco")
    body = ""
    for k, axis in ((1, "0 0.6 0.8"), (0, "0 1 0")):
        inertia = f'<inertial pos="0.5 0 0" mass="2" diaginertia="{" ".join(map(str, INERTIA))}"/>'
        body = f'<body pos="{k} 0 0">{inertia}<joint type="hinge" axis="{axis}"/>{body}</body>'
    known = mujoco_positions(worlds(body), 200)
    slope = (known[-3] - 4.0 * known[-2] + 3.0 * known[-1]) / 0.01
    for rows in ROWS:
        result = mca.run(replace(pendulum_chain(2, 1), impact=second(rows)), device="cpu")
        found = np.stack([result[f"joint_J{k}_q1_rad"] for k in range(2)], axis=1)
        assert found == pytest.approx(known[:: 200 // rows], abs=2e-5)
        assert abs(result["E_kinetic"][0]) < 1e-5 * result["E_kinetic"].max()
        for k in range(2):
            end = result.summary["joints"][f"J{k}"]
            assert end["position"][0]["value"] == found[-1, k]
            assert end["rate"][0]["value"] == pytest.approx(slope[k], abs=2e-3)
        hung = result.summary["rigid_bodies"]["b0"]  # on J0, whose axis is y
        q, rate = found[-1, 0], result.summary["joints"]["J0"]["rate"][0]["value"]
        assert hung["rotation"] == pytest.approx([0.0, q, 0.0], abs=1e-12)
        assert hung["centre"] == pytest.approx([0.5 * np.cos(q), 0.0, -0.5 * np.sin(q)], abs=1e-12)
        speed = 2.0 * 0.5 * rate * np.array([-np.sin(q), 0.0, -np.cos(q)])
        assert hung["momentum"] == pytest.approx(speed, abs=1e-4)


def test_an_asymmetric_top_tumbles_alike_in_few_and_many_rows():
    """Euler's equations, near the middle axis, about which it turns over."""
    J, w = np.array([0.02, 0.03, 0.045]), np.array([0.1, 8.0, 0.2])

    def slope(_, y):
        rate = y[4:] / J
        turn = np.append(y[3] * rate + np.cross(y[:3], rate), -y[:3] @ rate)  # q (rate, 0)
        return np.concatenate([0.5 * turn, np.cross(y[4:], rate)])

    known = solve_ivp(slope, (0.0, 1.0), np.concatenate([[0, 0, 0, 1.0], J * w]), rtol=1e-11, atol=1e-12).y[:, -1]
    turned = Rotation.from_quat(known[:4])
    top = link("top", centre=(0.0, 0.0, 0.0), inertia=tuple(J), angular_velocity=tuple(w))
    for rows in ROWS:
        result = mca.run(mca.Scene(name="top", bodies=(top,), impact=second(rows)), device="cpu")
        end = result.summary["rigid_bodies"]["top"]
        assert (Rotation.from_rotvec(end["rotation"]) * turned.inv()).magnitude() < 2e-3
        assert end["spin"] == pytest.approx(J * w, rel=1e-12)
        assert result["E_kinetic"][0] == pytest.approx(0.5 * J @ w**2, rel=1e-4)


def told(bodies, joints, duration: float, **more) -> list[str]:
    """What a run of a machine says of it."""
    impact = mca.ImpactPhase(duration=duration, output_interval=duration / 10, **more)
    scene = mca.Scene(name="machine", bodies=tuple(bodies), joints=tuple(joints), impact=impact)
    return list(mca.run(scene, device="cpu").warnings)


def test_freedoms_that_become_one_are_told_with_joint_and_time():
    """Three hinges of a ball that turns by pi / 2 about the middle one at 10 rad/s, and by 1 rad."""
    body = link("r", centre=(0.0, 0.0, 0.0), inertia=(0.1, 0.1, 0.1), angular_velocity=(0.0, 10.0, 0.0))
    axes = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    joint = mca.Articulation(name="G", body="r", freedoms=tuple(mca.Freedom(axis=axis) for axis in axes))
    (said,) = told((body,), (joint,), 0.2)
    assert "joint G came near a pose in which two of its freedoms make the same motion, at t = 0.1571 s" in said
    assert told((body,), (joint,), 0.1) == []


def test_a_loop_at_a_dead_point_is_told_with_joint_and_time():
    """A parallelogram whose crank starts at 1 rad at 10 rad/s: it is flat at pi, after 0.2142 s."""
    c, s = np.cos(1.0), np.sin(1.0)
    own = {"mass": 1.0, "inertia": (0.001, 0.01, 0.01)}
    crank = own | {"rotation": (0.0, 0.0, 1.0), "angular_velocity": (0.0, 0.0, 10.0), "centre": (0.1, 0.0, 0.0)}
    bodies = (
        link("crank", **crank),
        link("coupler", (0.2 * c, 0.2 * s, 0.0), centre=(0.25, 0.0, 0.0), velocity=(-2.0 * s, 2.0 * c, 0.0), **own),
        link("rocker", (0.5, 0.0, 0.0), **crank),
    )
    pin = {"nodes": None, "axis": (0.0, 0.0, 1.0), "at": (0.0, 0.0, 0.0)}
    joints = (
        mca.Revolute(name="O", body="crank", **pin),
        mca.Revolute(name="P", body="coupler", other="crank", other_at=(0.2, 0.0, 0.0), **pin),
        mca.Revolute(name="D", body="rocker", **pin),
        mca.Revolute(name="Q", body="coupler", other="rocker", other_at=(0.2, 0, 0), **pin | {"at": (0.5, 0.0, 0.0)}),
    )
    (said,) = told(bodies, joints, 0.25)
    assert "joint O and those that close a loop with it came to a dead point at t = 0.214" in said
    assert told(bodies, joints, 0.2) == []


def test_a_body_that_turns_too_far_in_a_step_is_told_with_the_scale_that_helps():
    motor = mca.Amplitude(times=(0.0,), values=(10.0,))
    joint = mca.Articulation(name="J", body="b", freedoms=(mca.Freedom(motor=motor),))
    body = link("b", centre=(0.0, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    (said,) = told((body,), (joint,), 1.0)
    assert "body b turned by 0.089 rad in a step, which makes angles some 0.001 of themselves wrong" in said
    assert "set time_step_scale to 0.2" in said and told((body,), (joint,), 1.0, time_step_scale=0.2) == []


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: mca.Freedom(limits=(0.0, 1.0), limit_stiffness=0.0),
            "limit_stiffness = 0.0: springs of limits need a",
        ),
        (
            lambda: mca.Contact(slave=mca.Surface(body="a", nodes="b"), master=mca.RigidPlane(), stiffness=1e20),
            "Contact.stiffness = 1e+20: give a number from 0 to 1e+12",
        ),
    ],
)
def test_stiffnesses_that_nobody_means_are_refused(make, said):
    with pytest.raises(mca.RequestError) as error:
        make()
    assert said in str(error.value)


def test_pieces_of_a_rigid_body_stay_together():
    found = []
    for rigid in (False, True):
        scene = alone(joined_cubes((0.015, 0.005, 0.005)))
        scene = replace(scene, bodies=tuple(replace(body, rigid=rigid) for body in scene.bodies))
        found.append(len(told_of(meshes.loose_pieces, scene)))
    assert found == [1, 0]
