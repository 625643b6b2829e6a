"""Joints between whole bodies and masses without mesh: words, what is refused, and model files."""

import dataclasses

import numpy as np
import pytest
from impacts import begun

import warp_mca as mca
from warp_mca.scene import model_file

LINK = {"rigid": True, "mass": 2.0, "inertia": (0.1, 0.2, 0.25)}


def scene_of(*joints, **more):
    bodies = (mca.Body(name="a", **LINK), mca.Body(name="b", **LINK, centre=(0.1, 0.0, 0.0)))
    box = mca.Box(size=(1.0, 0.1, 0.1), divisions=(4, 1, 1))
    bodies += (mca.Body(name="soft", geometry=box, material=mca.Elastic(E=1e9, nu=0.3, rho=1e3)),)
    return mca.Scene(name="s", bodies=bodies, joints=joints, impact=mca.ImpactPhase(duration=1e-3), **more)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"mass": -1.0}, "Body a.mass = -1.0: give a number from 1e-15 to 1e+15"),
        ({"rigid": False}, "Body a.mass = 2.0: a flexible body has that of its mesh; set rigid=True"),
        ({"inertia": None}, "Body a.inertia = None: give three principal values"),
        ({"inertia": (1.0, 1.0, -1.0)}, "its least principal value is -1; give one above 0"),
        ({"inertia": (1.0, 1.0, 3.0)}, "its principal values 1, 1 and 3 break the triangle inequality"),
        ({"inertia": ((1.0, 0.5, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))}, "it is not symmetric"),
        ({"mass": None}, "Body a.inertia = (0.1, 0.2, 0.25): it belongs to a mass; give that, too"),
    ],
)
def test_a_mass_that_no_body_has_is_refused(given, said):
    with pytest.raises(mca.RequestError) as error:
        mca.Body(**({"name": "a"} | LINK | given))
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("joint", "said"),
    [
        (mca.Articulation(name="J", body="a", nodes="xmin"), "J.nodes = 'xmin': a moves as one rigid body"),
        (mca.Articulation(name="J", body="a", other="soft"), "J.other_nodes = None: name a node set of soft"),
        (
            mca.Articulation(name="J", body="soft", nodes="xmin"),
            "J.body = 'soft': a joint of whole bodies needs",
        ),
        (mca.Weld(name="J", body="soft"), "J.body = 'soft': a joint of whole bodies needs a rigid one"),
        (mca.Articulation(name="J", body="a", other="soft", other_nodes="top"), "node set = 'top'"),
    ],
)
def test_what_cannot_be_joined_is_refused(joint, said):
    with pytest.raises(mca.RequestError) as error:
        mca.mesh(scene_of(joint))
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"kind": "screw"}, "Freedom.kind = 'screw': choose hinge, slide or ball"),
        ({"kind": "ball", "friction": 1.0}, "Freedom ball.friction = 1.0: a ball has no axis for it"),
        ({"kind": "ball", "rest": 1.0}, "Freedom ball.rest = 1.0: give three finite numbers"),
        ({"limits": (1.0, 0.0)}, "Freedom hinge.limits = (1.0, 0.0): give two finite numbers, the lower one first"),
        ({"motor": 3.0}, "Freedom hinge.motor = 3.0: give an Amplitude of torques, a PositionServo"),
        ({"damping": -1.0}, "Freedom hinge.damping = -1.0: give a number from 0"),
    ],
)
def test_odd_freedoms_are_refused(given, said):
    with pytest.raises(mca.RequestError) as error:
        mca.Freedom(**given)
    assert said in str(error.value)


def test_phases_before_the_impact_and_contact_without_surface_are_refused():
    weld = mca.Weld(name="W", body="a")
    with pytest.raises(mca.RequestError, match=r"'Settle'\]: joints between whole bodies, as Weld W"):
        scene_of(weld, phases=(mca.Settle(),))
    floor = mca.RigidPlane(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    contact = mca.Contact(slave=mca.Surface(body="a", nodes="inertia"), master=floor)
    with pytest.raises(mca.RequestError, match=r"Contact.slave.body = 'a': it is a mass without surface"):
        scene_of(contacts=(contact,))


def test_words_survive_a_model_file(tmp_path):
    servo = mca.PositionServo(kp=10.0, kv=1.0, target=mca.Amplitude(times=(0.0, 1.0), values=(0.0, 1.0)))
    freedoms = (mca.Freedom(axis=(0, 1, 0), motor=servo, limits=(-1, 1)), mca.Freedom(kind="slide", at=(0, 0, 1)))
    joints = (
        mca.Articulation(name="J", body="a", other="b", freedoms=freedoms),
        mca.Universal(name="U", body="b", axis=(1, 0, 0), second_axis=(0, 1, 0)),
        mca.Weld(name="W", body="a"),
        mca.Articulation(name="T", body="soft", nodes="xmin", other="b"),
    )
    scene = scene_of(*joints)
    model_file.save(tmp_path / "a.mca", scene, mca.mesh(scene))
    assert model_file.load(tmp_path / "a.mca").scene == scene


def arm(**more):
    """A driven link that holds a bar by its face, as `body` or as `other` of the joint."""
    swapped = more.pop("swapped", False)
    bar = mca.Box(size=(0.2, 0.02, 0.02), divisions=(10, 2, 2), origin=(0.0, -0.01, -0.01))
    servo = mca.PositionServo(kp=400.0, kv=20.0, target=0.3, limits=(-50.0, 50.0))
    lift = mca.Freedom(axis=(0.0, -1.0, 0.0), armature=0.05, damping=0.5, motor=servo)
    flange = {"body": "arm", "other": "tool", "other_nodes": "xmin", "at": (0.4, 0.0, 0.0)}
    flange = flange if swapped else {"body": "tool", "nodes": "xmin", "other": "arm"}
    return mca.Scene(
        name="arm",
        bodies=(
            mca.Body(name="arm", **(LINK | {"centre": (0.2, 0.0, 0.0)})),
            mca.Body(
                name="tool", geometry=bar, material=mca.Elastic(E=70e9, nu=0.33, rho=2700.0), position=(0.4, 0.0, 0.0)
            ),
        ),
        joints=(
            mca.Articulation(name="shoulder", body="arm", freedoms=(lift,)),
            mca.Articulation(name="flange", **flange),
        ),
        **({"gravity": (0.0, 0.0, -9.81), "impact": mca.ImpactPhase(duration=2e-4, output_interval=2e-5)} | more),
    )


def test_a_flexible_body_may_be_either_side_of_a_joint():
    one, other = (mca.run(arm(swapped=swapped), device="cpu", precision="float64") for swapped in (False, True))
    force, reaction = (np.stack([run[f"joint_flange_F{axis}_N"] for axis in "xyz"]) for run in (one, other))
    assert force == pytest.approx(-reaction, abs=1e-6 * np.abs(force).max())
    assert one["joint_shoulder_q1_rad"] == pytest.approx(other["joint_shoulder_q1_rad"], rel=1e-9)
    assert one.summary["units"]["joint_flange_Mx_Nm"] == "N m"
    report = one.summary["joints"]["shoulder"]
    assert report["max_drive"][0]["unit"] == "N m" and report["position"][0]["unit"] == "rad"
    assert report["max_force"]["value"] == pytest.approx(
        max(np.linalg.norm([one[f"joint_shoulder_F{axis}_N"] for axis in "xyz"], axis=0))
    )


def test_forces_are_means_so_that_they_sum_to_the_impulse():
    result = mca.run(arm(), device="cpu", precision="float64")
    impulse = [result[f"joint_shoulder_F{axis}_N"].sum() * 2e-5 for axis in "xyz"]
    assert impulse == pytest.approx(result.summary["joint_impulse"]["shoulder"], rel=0.03, abs=1e-9)


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_a_batch_computes_what_each_scene_computes_alone(device):
    scenes = [arm(), arm(gravity=(0.0, 0.0, 9.81))]
    together = mca.run_batch(scenes, device=device, precision="float64")
    for scene, found in zip(scenes, together, strict=True):
        alone = mca.run(scene, device=device, precision="float64")
        for name, column in alone.history.items():
            assert np.array_equal(found[name], column, equal_nan=True), name


def test_scenes_of_a_batch_have_the_same_joints():
    with pytest.raises(mca.RequestError, match=r"joints of scenes\[1\] = \['flange'\]: scenes of a batch have"):
        mca.run_batch([arm(), dataclasses.replace(arm(), joints=arm().joints[1:])], device="cpu")


def test_a_run_goes_on_from_a_checkpoint_with_the_same_bits(tmp_path):
    one = begun(arm(), precision="float64")
    one.advance(40)
    one.save(tmp_path / "state.npz")
    two = begun(arm(), precision="float64")
    two.load(tmp_path / "state.npz")
    one.advance()
    two.advance()
    assert one.state.differences(two.state) == []


@pytest.mark.gpu
def test_a_gpu_computes_what_a_cpu_computes():
    one, other = (mca.run(arm(), device=device, precision="float64") for device in ("cpu", "cuda:0"))
    for name in ("joint_shoulder_q1_rad", "joint_flange_Fz_N", "joint_shoulder_drive1_Nm"):
        assert other[name] == pytest.approx(one[name], rel=1e-6, abs=1e-6 * np.abs(one[name]).max())


def test_joints_take_part_in_runs_with_steps_of_several_rates():
    bar = mca.Box(size=(0.2, 0.02, 0.02), divisions=(10, 2, 2), origin=(0.0, -0.01, -0.01))
    stiff = mca.Elastic(E=70e9, nu=0.33, rho=2700.0)
    soft = mca.Elastic(E=2e9, nu=0.33, rho=2700.0)
    scene = arm()
    other = mca.Body(name="slow", geometry=bar, material=soft, position=(0.0, 1.0, 0.0), velocity=(1.0, 0.0, 0.0))
    tool = dataclasses.replace(scene.bodies[1], material=stiff)
    scene = dataclasses.replace(scene, bodies=(scene.bodies[0], tool, other))
    one = mca.run(scene, device="cpu", precision="float64")
    many = mca.run(scene, device="cpu", precision="float64", multi_rate=3)
    assert len(many.summary["rate_groups"]) > 1
    force = one["joint_flange_Fz_N"]
    assert many["joint_flange_Fz_N"] == pytest.approx(force, abs=0.01 * np.abs(force).max())


def test_a_mesh_with_a_mass_of_its_own_has_that_mass_and_inertia():
    box = mca.Box(size=(0.2, 0.1, 0.1), divisions=(4, 2, 2))
    inertia = ((0.05, 0.001, 0.0), (0.001, 0.06, 0.0), (0.0, 0.0, 0.03))
    w = np.array([1.0, 2.0, 3.0])
    body = mca.Body(
        name="b",
        rigid=True,
        mass=5.0,
        centre=(0.02, 0.0, 0.01),
        inertia=inertia,
        geometry=box,
        angular_velocity=(1, 2, 3),
    )
    impact = mca.ImpactPhase(duration=1e-4, output_interval=1e-5)
    result = mca.run(mca.Scene(name="s", bodies=(body,), impact=impact), device="cpu", precision="float64")
    own = result.summary["rigid_bodies"]["b"]
    assert own["mass"] == pytest.approx(5.0, rel=1e-12)
    assert result.summary["bodies"]["b"] == {"mass": 5.0, "mass_error": None}
    assert own["momentum"] == pytest.approx(5.0 * np.cross(w, [0.02, 0.0, 0.01]), rel=1e-12)
    assert own["spin"] == pytest.approx(np.array(inertia) @ w, rel=1e-12)
    assert not result.warnings


def test_bodies_that_a_joint_does_not_let_move_so_are_refused():
    with pytest.raises(mca.RequestError, match=r"Weld W.body = 'a': it joins a and the ground, and part of their"):
        mca.run(
            mca.Scene(
                name="s",
                bodies=(mca.Body(name="a", **LINK, velocity=(1.0, 0.0, 0.0)),),
                joints=(mca.Weld(name="W", body="a"),),
                impact=mca.ImpactPhase(duration=1e-3),
            )
        )
    joint = mca.Articulation(name="J", body="b", other="a", other_at=(1.0, 0.0, 0.0), freedoms=(mca.Freedom(),))
    with pytest.raises(mca.RequestError, match=r"J.other_at = \(1.0, 0.0, 0.0\): it is 1 m from `at` of b"):
        mca.run(scene_of(joint))


def test_a_position_at_the_start_turns_axes_and_targets_with_it():
    """A double pendulum that starts bent, in place of one that has been bent before: the same motion."""
    angle = 0.7
    bent = mca.Freedom(axis=(0.0, 1.0, 0.0), position=angle, stiffness=50.0)
    straight = mca.Freedom(axis=(0.0, 1.0, 0.0), stiffness=50.0, rest=-angle)
    found = []
    for freedom in (bent, straight):
        body = mca.Body(name="b", **(LINK | {"centre": (0.5, 0.0, 0.0)}), rotation=(0.0, angle, 0.0))
        joint = mca.Articulation(name="J", body="b", freedoms=(freedom,))
        impact = mca.ImpactPhase(duration=0.1, output_interval=1e-2, time_step_scale=0.1)
        scene = mca.Scene(name="s", bodies=(body,), joints=(joint,), gravity=(0.0, 0.0, -9.81), impact=impact)
        found.append(mca.run(scene, device="cpu")["joint_J_q1_rad"])
    assert found[0] - angle == pytest.approx(found[1], abs=1e-12)
    assert np.ptp(found[0]) > 0.1


def controlled(function, period=1e-3):
    """Two rotors that one function drives."""
    motor = mca.Controller(function=function, period=period)
    bodies = tuple(mca.Body(name=name, **LINK, position=(x, 0.0, 0.0)) for name, x in (("a", 0.0), ("b", 2.0)))
    joints = tuple(
        mca.Articulation(name=f"J{name}", body=name, freedoms=(mca.Freedom(motor=motor, damping=0.1),)) for name in "ab"
    )
    impact = mca.ImpactPhase(duration=0.05, output_interval=5e-4)
    return mca.Scene(name="s", bodies=bodies, joints=joints, impact=impact)


def test_a_function_drives_joints_and_is_held_between_its_calls():
    seen = []

    def spring(t, q, rate):
        torque = -20.0 * (q - np.array([0.3, 0.6])) - rate
        seen.append((t, q[0], torque[0]))
        return torque

    result = mca.run(controlled(spring), device="cpu")
    assert [t for t, _, _ in seen] == pytest.approx(np.arange(50) * 1e-3)
    asked = result["joint_Ja_q1_rad"][:-1:2]
    assert asked == pytest.approx([q for _, q, _ in seen], abs=1e-15)
    drive = result["joint_Ja_drive1_Nm"][1::2]  # means over the first halves of the time between two calls
    assert drive == pytest.approx([torque for _, _, torque in seen], rel=1e-9)
    assert result["joint_Jb_q1_rad"] == pytest.approx(2.0 * result["joint_Ja_q1_rad"], rel=1e-6)
    assert np.abs(result["E_total_error"]).max() < 1e-6 * result["E_kinetic"].max()


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        (
            lambda: controlled(np.negative, 7e-4),
            "Controller.period = 0.0007: give a multiple of ImpactPhase.output_int",
        ),
        (lambda: controlled(3.0), "Controller.function = 3.0: give a function of t, q and rate"),
        (lambda: controlled(lambda t, q, rate: "x"), "at 0 s it gives x; return 2 finite numbers"),
        (lambda: controlled(lambda t, q: q), "Controller.function = '<lambda>': it failed with TypeError"),
    ],
)
def test_functions_that_cannot_drive_are_refused(scene, said):
    with pytest.raises(mca.RequestError) as error:
        mca.run(scene(), device="cpu")
    assert said in str(error.value)


def test_batches_and_model_files_take_no_functions(tmp_path):
    scene = controlled(lambda t, q, rate: -q)
    with pytest.raises(mca.RequestError, match="motor of joint Ja = 'Controller': a batch asks no functions"):
        mca.run_batch([scene, scene], device="cpu")
    with pytest.raises(mca.RequestError, match=r"Freedom.motor = 'Controller': a model file holds no functions"):
        model_file.save(tmp_path / "a.mca", scene, mca.mesh(scene))


def test_welded_links_are_one_body():
    """Without any freedom: two welded halves turn as a whole does, through the joint's force m_b w^2 r alone."""
    w = (0.0, 0.0, 3.0)
    bodies = (
        mca.Body(name="a", **LINK, angular_velocity=w),
        mca.Body(name="b", **LINK, position=(0.5, 0.0, 0.0), velocity=(0.0, 1.5, 0.0), angular_velocity=w),
    )
    impact = mca.ImpactPhase(duration=0.1, output_interval=1e-2, time_step_scale=0.1)
    joint = mca.Weld(name="W", body="b", other="a")
    result = mca.run(mca.Scene(name="s", bodies=bodies, joints=(joint,), impact=impact), device="cpu")
    force = np.hypot(result["joint_W_Fx_N"], result["joint_W_Fy_N"])[1:]
    assert force == pytest.approx(2.0 * 3.0**2 * 0.25, rel=1e-3)
    assert result["E_kinetic"] == pytest.approx(result["E_kinetic"][0], rel=1e-12)
    spins = [result.summary["rigid_bodies"][name]["spin"][2] for name in "ab"]
    assert spins == pytest.approx([3.0 * 0.25] * 2, rel=1e-9)
