"""Couplers between freedoms of joints: gear trains and racks of rigid bodies, against their closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import warp_mca as mca

IMPACT = mca.ImpactPhase(duration=1e-2, output_interval=1e-4)
I_1, I_2, MASS = 0.3, 0.05, 2.0


def wheel(name, inertia, **motion):
    return mca.Body(name=name, rigid=True, mass=MASS, inertia=(inertia,) * 3, **motion)


def end(result, joint):
    found = result.summary["joints"][joint]
    return found["position"][0]["value"], found["rate"][0]["value"]


@pytest.mark.parametrize("armature", [0.0, 0.4])
def test_a_gear_train_turns_as_the_inertia_that_its_motor_feels(armature):
    """Angle T t^2 / 2 (I_1 + r^2 (I_2 + A)), bearings far apart and on the ground."""
    ratio, torque, shift = -2.5, 7.0, (1.0, 0.3, -0.2)
    motor = mca.Freedom(motor=mca.Amplitude(times=(0.0,), values=(torque,)))
    geared = mca.Freedom(axis=(0.0, 1.0, 0.0), armature=armature, follows=mca.Coupler(joint="A", ratio=ratio))
    scene = mca.Scene(
        name="gears",
        bodies=(wheel("a", I_1), wheel("b", I_2, position=shift)),
        joints=(
            mca.Articulation(name="A", body="a", freedoms=(motor,)),
            mca.Articulation(name="B", body="b", freedoms=(geared,)),
        ),
        impact=IMPACT,
    )
    result = mca.run(scene, precision="float64", figures="none")
    angle, rate = end(result, "A")
    felt = I_1 + ratio**2 * (I_2 + armature)
    assert angle == pytest.approx(0.5 * torque * IMPACT.duration**2 / felt, rel=1e-6)
    assert rate == pytest.approx(torque * IMPACT.duration / felt, rel=2e-2)  # half a step before the end
    assert end(result, "B") == pytest.approx((ratio * angle, ratio * rate), rel=1e-9)
    assert result.summary["energy_error"] < 1e-9
    assert result.history["joint_B_My_Nm"][1:-1] == pytest.approx(ratio * I_2 * torque / felt, rel=1e-6)


def test_a_rack_carries_its_pinion_on_a_moving_link():
    """A pinion on a carriage rolls on the ground: speed v, spin v / R, and a hit by F gives F / (2 m + I / R^2)."""
    radius, force = 0.1, 40.0
    slide = mca.Freedom(kind="slide", axis=(1.0, 0.0, 0.0), motor=mca.Amplitude(times=(0.0,), values=(force,)))
    roll = mca.Freedom(axis=(0.0, 1.0, 0.0), follows=mca.Coupler(joint="rail", ratio=1.0 / radius))
    bodies = (
        wheel("carriage", I_1, velocity=(0.5, 0.0, 0.0)),
        wheel("pinion", I_2, velocity=(0.5, 0.0, 0.0), angular_velocity=(0.0, 5.0, 0.0)),
    )
    scene = mca.Scene(
        name="rack",
        bodies=bodies,
        joints=(
            mca.Articulation(name="rail", body="carriage", freedoms=(slide,)),
            mca.Articulation(name="axle", body="pinion", other="carriage", freedoms=(roll,)),
        ),
        impact=IMPACT,
    )
    result = mca.run(scene, precision="float64", figures="none")
    t, felt = IMPACT.duration, 2.0 * MASS + I_2 / radius**2
    way = 0.5 * t + 0.5 * force * t**2 / felt
    assert end(result, "rail")[0] == pytest.approx(way, rel=1e-8)
    assert end(result, "axle")[0] == pytest.approx(way / radius, rel=1e-8)
    assert result.summary["energy_error"] < 1e-9


def test_couplers_that_cannot_be_are_refused():
    def scene(coupler, **motion):
        freedoms = (mca.Freedom(axis=(0.0, 0.0, 1.0), follows=coupler),)
        joints = (
            mca.Articulation(name="A", body="a", freedoms=(mca.Freedom(),)),
            mca.Articulation(name="B", body="b", freedoms=freedoms),
        )
        bodies = (wheel("a", I_1, **motion), wheel("b", I_2, position=(1.0, 0.0, 0.0)))
        return mca.Scene(name="s", bodies=bodies, joints=joints, impact=IMPACT)

    for coupler, said in (
        (mca.Coupler(joint="C"), r"Coupler\.joint = 'C': joints between whole bodies are A, B"),
        (mca.Coupler(joint="A", freedom=2), r"Coupler\.freedom = 2: hinges and slides of A have the numbers 1"),
        (mca.Coupler(joint="B"), "a freedom cannot follow itself"),
    ):
        with pytest.raises(mca.RequestError, match=said):
            mca.mesh(scene(coupler))
    with pytest.raises(mca.RequestError, match="freedom 1 of joint B starts at 0 and the other one at 1 per s"):
        mca.run(scene(mca.Coupler(joint="A"), angular_velocity=(0.0, 0.0, 1.0)), figures="none")
    with pytest.raises(mca.RequestError, match=r"Freedom ball\.follows"):
        mca.Freedom(kind="ball", follows=mca.Coupler(joint="A"))


def test_a_batch_and_a_model_file_keep_couplers(tmp_path):
    from warp_mca.scene import model_file

    def scene(ratio):
        hinge = mca.Freedom(motor=mca.Amplitude(times=(0.0,), values=(1.0,)))
        geared = mca.Freedom(follows=mca.Coupler(joint="A", ratio=ratio))
        joints = (
            mca.Articulation(name="A", body="a", freedoms=(hinge,)),
            mca.Articulation(name="B", body="b", freedoms=(geared,)),
        )
        return mca.Scene(name=f"s{ratio}", bodies=(wheel("a", I_1), wheel("b", I_2)), joints=joints, impact=IMPACT)

    scenes = [scene(1.0), scene(3.0)]
    model_file.save(tmp_path / "a.mca", scenes[0], mca.mesh(scenes[0]))
    assert model_file.load(tmp_path / "a.mca").scene == scenes[0]
    results = mca.run_batch(scenes, precision="float64")
    angles = np.array([end(result, "A")[0] for result in results])
    assert angles == pytest.approx(0.5 * IMPACT.duration**2 / (I_1 + np.array([1.0, 9.0]) * I_2), rel=1e-6)
