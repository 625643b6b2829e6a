"""Joints between whole bodies and masses without mesh: words, what is refused, and model files."""

import pytest

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
        ({"kind": "ball", "stiffness": 1.0}, "Freedom ball.stiffness = 1.0: a ball has no axis for it"),
        ({"limits": (1.0, 0.0)}, "Freedom hinge.limits = (1.0, 0.0): give two finite numbers, the lower one first"),
        ({"motor": 3.0}, "Freedom hinge.motor = 3.0: give an Amplitude of torques, a PositionServo, or None"),
        ({"damping": -1.0}, "Freedom hinge.damping = -1.0: give a number from 0"),
    ],
)
def test_odd_freedoms_are_refused(given, said):
    with pytest.raises(mca.RequestError) as error:
        mca.Freedom(**given)
    assert said in str(error.value)


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
