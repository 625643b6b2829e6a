"""Scenes of rigid bodies alone, whatever their rows: their steps, their first energy, and their figures at the end."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import warp_mca as mca
from warp_mca.verify.body_joints import INERTIA, link, mujoco_positions, pendulum_chain, worlds

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
