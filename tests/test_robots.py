"""Machines from robot files: what is read, refused and swung, and when surfaces touch."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.robots.machine import Machine
from warp_mca.robots.skins import Skin, closest_points
from warp_mca.verify.machines import ARM, FOUR_BAR, STOP, robot, write_stl

mujoco = pytest.importorskip("mujoco")

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
G = 9.81
FLOOR = mca.RigidPlane(normal=(0.0, 0.0, 1.0))
HEAD = '<mujoco><compiler angle="radian" autolimits="true"/><option gravity="0 0 -9.81"/>'
BALL = """<worldbody><body name="ball" pos="0 0 0.5"><freejoint name="free"/>
  <geom name="skin" type="{kind}" size="{size}" mass="1"/></body></worldbody></mujoco>"""
HEAVY = '<inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>'
INERTIA = '<inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>'
URDF = f"""<robot name="stand">
  <link name="base"/>
  <link name="mast"><inertial><mass value="1"/>{INERTIA}</link>
  <link name="head"><inertial><mass value="2"/>{INERTIA}
    <collision><geometry><mesh filename="box.stl"/></geometry></collision></link>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="mast"/>
    <origin xyz="0 0 0.6"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
  <joint name="bolt" type="fixed"><parent link="mast"/><child link="head"/><origin xyz="0 0 0.1"/></joint>
</robot>"""


def ball(tmp_path, kind="sphere", size="0.1", **more):
    return robot(HEAD + BALL.format(kind=kind, size=size), tmp_path, **more)


@pytest.mark.parametrize(
    ("kind", "size", "low"),
    [("sphere", "0.1", 0.1), ("capsule", "0.05 0.1", 0.15), ("box", "0.1 0.1 0.2", 0.2), ("cylinder", "0.1 0.3", 0.3)],
)
def test_geom_falls_on_plane_at_the_closed_form(tmp_path, kind, size, low):
    """Planes beside the machine: skins of 48 faces around have poles, so that the lowest point is exact."""
    swing = ball(tmp_path, kind, size, against=(FLOOR,)).swing()
    height = 0.5 - low
    assert swing.t_end == pytest.approx(math.sqrt(2.0 * height / G), abs=1e-9)
    assert swing.touch.velocity == pytest.approx([0.0, 0.0, -math.sqrt(2.0 * G * height)], abs=1e-9)
    assert swing.touch.normal == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    if kind != "box" and kind != "cylinder":  # these touch with a face
        assert swing.touch.effective_mass == pytest.approx(1.0, rel=1e-9)
    assert (swing.touch.first, swing.touch.second) == ("skin", "plane 1")
    assert swing.energy_drift < 1e-12


@pytest.mark.parametrize(("kind", "size"), [("sphere", "0.1"), ("capsule", "0.1 0.2"), ("box", "0.1 0.1 0.1")])
def test_spheres_that_approach_meet_when_their_radii_do(tmp_path, kind, size):
    text = f"""{HEAD}<worldbody><geom name="post" type="{kind}" size="{size}"/>
      <body name="ball" pos="0.6 0 0"><joint type="slide" axis="1 0 0" name="x"/>
      <geom name="skin" type="sphere" size="0.1" mass="1"/></body></worldbody></mujoco>"""
    swing = robot(text, tmp_path, qvel={"x": -2.0}).swing()
    assert swing.t_end == pytest.approx(0.2, abs=1e-9)
    assert swing.touch.point == pytest.approx([0.1, 0.0, 0.0], abs=1e-9)
    assert swing.touch.effective_mass == pytest.approx(1.0, rel=1e-9)


def test_flexible_link_touches_with_its_skin(tmp_path):
    """A rod in place of the ball's geom: tilted, it meets the floor with its lowest node."""
    rod = mca.Rod(radius=0.01, length=0.2)
    body = mca.Body(name="any", geometry=rod, material=STEEL, position=(-0.1, 0.0, 0.0), rotation=(0.0, 0.4, 0.0))
    text = HEAD + BALL.format(kind="sphere", size="0.1").replace("<geom", f"{HEAVY}<geom")
    machine = robot(text, tmp_path, flexible={"ball": body}, against=(FLOOR,))
    lowest = machine.meshes["ball"].points[:, 2].min()
    swing = machine.swing()
    assert swing.touch.first == "ball"
    assert swing.t_end == pytest.approx(math.sqrt(2.0 * (0.5 + lowest) / G), abs=1e-9)
    plain = robot(text, tmp_path, flexible={"ball": rod}, material=STEEL, against=(FLOOR,))
    assert plain.swing().t_end == pytest.approx(math.sqrt(2.0 * (0.5 - 0.01) / G), abs=1e-9)


def test_bodies_beside_move_on_and_their_skins_are_touched(tmp_path):
    """The upper face of a block that rises at 1 m/s: 0.5 - 0.1 - g t^2 / 2 = 0.05 + t."""
    box = mca.Box(size=(0.4, 0.4, 0.1), divisions=(2, 2, 1), origin=(-0.2, -0.2, -0.05))
    block = mca.Body(name="block", geometry=box, material=STEEL, velocity=(0.0, 0.0, 1.0))
    swing = ball(tmp_path, against=(block,)).swing()
    t = (-1.0 + math.sqrt(1.0 + 2.0 * G * 0.35)) / G
    assert swing.t_end == pytest.approx(t, abs=1e-9)
    assert swing.touch.velocity[2] == pytest.approx(-G * t - 1.0, rel=1e-9)


def test_controls_are_sampled_at_their_period_and_held(tmp_path):
    """Torque cos(3 t_k) on a wheel of 0.02 kg m^2: its rate is the sum of the held impulses."""
    text = STOP.replace('range="-1 0.5"', "").replace(
        "</worldbody>", '</worldbody><actuator><motor name="drive" joint="hinge" gear="2"/></actuator>'
    )
    seen = []

    def controller(t, qpos, qvel):
        seen.append(t)
        return [math.cos(3.0 * t)]

    swing = robot(text, tmp_path, controller=controller, period=0.01).swing(t_end=0.105)
    assert seen == pytest.approx(0.01 * np.arange(11), abs=1e-15)
    spans = np.append(np.full(10, 0.01), 0.005)
    assert swing.qvel[0] == pytest.approx(2.0 * spans @ np.cos(3.0 * np.array(seen)) / 0.02, rel=1e-9)
    assert swing.drives == pytest.approx([2.0 * math.cos(0.3)])


def test_urdf_keeps_its_fixed_links_and_takes_servos_start_and_meshes_from_python(tmp_path):
    """A head of STL falls with its mast on a servo; z'' = -g - (kp z + kv z') / 3."""
    from scipy.integrate import solve_ivp

    box = mca.Box(size=(0.1, 0.1, 0.1), divisions=(1, 1, 1), origin=(-0.05, -0.05, -0.05))
    write_stl(tmp_path / "box.stl", Skin.of(box.build()).triangles)
    servo = mca.PositionServo(kp=30.0, kv=6.0, target=-0.2, limits=(-8.0, 8.0))
    machine = robot(URDF, tmp_path, "stand.urdf", servos={"lift": servo}, qvel={"lift": -0.5}, against=(FLOOR,))
    assert Machine(machine).names.bodies == ["base", "mast", "head"]

    def flow(_t, y):
        force = np.clip(30.0 * (-0.2 - y[0]) - 6.0 * y[1], -8.0, 8.0)
        return [y[1], -G + force / 3.0]

    fall = lambda _t, y: 0.7 - 0.05 + y[0]  # noqa: E731
    fall.terminal = True
    exact = solve_ivp(flow, (0.0, 2.0), [0.0, -0.5], events=fall, rtol=1e-12, atol=1e-12, max_step=1e-3)
    swing = machine.swing()
    assert swing.t_end == pytest.approx(exact.t[-1], abs=1e-8)
    assert swing.qvel[0] == pytest.approx(exact.y[1, -1], rel=1e-7)
    assert swing.drives[0] == pytest.approx(np.clip(-30.0 * (0.2 + swing.qpos[0]) - 6.0 * swing.qvel[0], -8, 8))


def test_turned_machine_swings_turned(tmp_path):
    turned = ARM.replace(
        '<body name="shoulder" pos="0 0 0.2">', '<body name="shoulder" pos="0 0.2 0" euler="-1.5707963267948966 0 0">'
    )
    turned = turned.replace("0 0 -9.81", "0 -9.81 0").replace(
        'pos="0.45 0 0.02" size="0.25 0.25 0.02"', 'pos="0.45 0.02 0" size="0.25 0.02 0.25"'
    )
    one, other = (robot(text, tmp_path, keyframe="strike").swing() for text in (ARM, turned))
    assert other.t_end == pytest.approx(one.t_end, abs=1e-10)
    assert other.qvel == pytest.approx(one.qvel, abs=1e-9)
    x, y, z = one.touch.point
    assert other.touch.point == pytest.approx([x, z, -y], abs=1e-9)


def test_nearest_points_of_triangles_are_those_of_a_fine_search():
    random = np.random.default_rng(5)
    triangles, points = random.normal(size=(40, 3, 3)), 2.0 * random.normal(size=(20, 3))
    a, b = np.meshgrid(np.linspace(0.0, 1.0, 201), np.linspace(0.0, 1.0, 201))
    kept = a + b <= 1.0
    shares = np.stack([1.0 - a - b, a, b])[:, kept]
    for point in points:
        found = np.linalg.norm(closest_points(point, triangles) - point, axis=1)
        exact = np.linalg.norm(np.einsum("tci,cn->tni", triangles, shares) - point, axis=2).min(axis=1)
        assert np.all(found <= exact + 1e-12) and np.all(found > exact - 0.05)


def test_skin_says_the_side_at_edges_and_corners():
    skin = Skin.of(mca.Box(size=(1.0, 1.0, 1.0), divisions=(3, 3, 3)).build())
    for point, exact in (
        ((2.0, 2.0, 2.0), math.sqrt(3.0)),
        ((0.5, 0.5, 0.9), -0.1),
        ((1.5, 0.5, 1.2), math.hypot(0.5, 0.2)),
        ((0.95, 0.9, 0.8), -0.05),
    ):
        assert skin.nearest(np.array([point]))[0] == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (
            '<tendon><fixed name="t" limited="true" range="0 1"><joint joint="hinge" coef="1"/></fixed></tendon>',
            "tendon t: it has limited",
        ),
        (
            '<worldbody><site name="a"/><site name="b" pos="1 0 0"/></worldbody>'
            '<tendon><spatial><site site="a"/><site site="b"/></spatial></tendon>',
            "spatial tendons",
        ),
        ('<actuator><muscle name="m" joint="hinge" lengthrange="0 1"/></actuator>', "activations"),
        ('<actuator><position name="m" joint="hinge" kp="1" timeconst="0.1"/></actuator>', "activations"),
    ],
)
def test_what_a_machine_does_not_carry_is_refused_by_name(tmp_path, text, what):
    with pytest.raises(RequestError, match=what):
        robot(STOP.replace("</worldbody>", f"</worldbody>{text}"), tmp_path).swing(t_end=0.1)


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ({"keyframe": "home"}, "Robot.keyframe = 'home': the file's are none"),
        ({"qpos": {"elbow": 0.0}}, "Robot.qpos = 'elbow': the file's joints are hinge"),
        ({"qvel": (1.0, 2.0)}, "Robot.qvel"),
        ({"qpos": {"hinge": 0.6}}, "start within its limits, -1 to 0.5"),
        ({"ctrl": {"drive": 1.0}}, "the file's actuators are none"),
        ({"servos": {"elbow": mca.PositionServo(kp=1.0)}}, "Robot.servos = 'elbow'"),
        (
            {"flexible": {"leg": mca.Body(name="leg", geometry=mca.Rod(radius=0.01, length=0.1), material=STEEL)}},
            "wheel",
        ),
        ({"flexible": {"wheel": mca.Rod(radius=0.01, length=0.1)}}, "Robot.material"),
        ({"controller": lambda t, q, v: [], "period": None}, "Robot.period"),
        ({"controller": lambda t, q, v: [1.0], "period": 0.01}, "0 finite numbers"),
        ({"period": 0.01}, "Robot.period"),
        ({"against": ("table",)}, "Robot.against"),
        (
            {"against": (mca.Body(name="m", rigid=True, mass=1.0, inertia=(1, 1, 1), centre=(0, 0, 0)),)},
            "Robot.against = 'm': it is a mass without surface; give it a geometry",
        ),
    ],
)
def test_mistakes_are_refused_in_a_sentence(tmp_path, more, what):
    with pytest.raises(RequestError, match=what.replace("(", r"\(")):
        robot(STOP, tmp_path, **more).swing(t_end=0.1)


def test_mistakes_of_files_and_touches_are_refused(tmp_path):
    with pytest.raises(RequestError, match="there is no such file"):
        mca.Robot(tmp_path / "none.xml").swing()
    with pytest.raises(RequestError, match="this is a folder; name a file in it"):
        mca.Robot(tmp_path).swing()
    with pytest.raises(RequestError, match="give an MJCF file"):
        mca.Robot(tmp_path / "none.step").swing()
    with pytest.raises(RequestError, match="MuJoCo says"):
        robot("<mujoco><nonsense/></mujoco>", tmp_path).swing()
    with pytest.raises(RequestError, match="nothing may touch"):
        robot(STOP, tmp_path).swing()
    with pytest.raises(RequestError, match="opens the loops"):
        robot(FOUR_BAR, tmp_path, qvel={"crank": 1.0}).swing(t_end=0.1)
    with pytest.raises(RequestError, match="they overlap"):
        ball(tmp_path, size="0.6", against=(FLOOR,)).swing()
    with pytest.raises(RequestError, match=r"nothing touches by t_max = 0\.1 s"):
        ball(tmp_path, against=(FLOOR,)).swing(t_max=0.1)
    with pytest.raises(RequestError, match=r"Robot\.touch = 'hand'"):
        ball(tmp_path, against=(FLOOR,), touch=("hand",)).swing()


def test_machine_needs_the_extra_and_says_so(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(RequestError, match=r'pip install "warp_mca\[robots\]"'):
        robot(STOP, tmp_path).swing(t_end=0.1)


def test_warnings_of_mujoco_go_to_the_log_and_to_no_file(tmp_path, monkeypatch, caplog):
    """Two hinges on one axis: MuJoCo warns of a singular mass matrix before the machine is refused."""
    monkeypatch.chdir(tmp_path)
    hinges = '<joint name="a" axis="0 0 1"/><joint name="b" axis="0 0 1"/><geom size="0.1"/>'
    machine = robot(f"{HEAD}<worldbody><body>{hinges}</body></worldbody></mujoco>", tmp_path)
    with pytest.raises(RequestError, match="they move nothing, or the same"):
        machine.swing(t_end=0.1)
    assert [path.name for path in tmp_path.iterdir()] == ["machine.xml"]
    assert ["Inertia matrix is too close to singular" in line for line in caplog.messages] == [True]
    assert mujoco.MjLogConfig.get().logto_file  # as it was


def test_distance_of_skins_is_that_of_all_triangles():
    """A skin of many triangles, of which some are large, is searched by pieces: as when each is looked at."""
    random = np.random.default_rng(1)
    angle = np.linspace(0.0, 2.0 * np.pi, 301)[:-1]
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate([np.c_[ring, np.zeros(300)], np.c_[ring, np.full(300, 3.0)], [[0, 0, 0], [0, 0, 3.0]]])
    k, following = np.arange(300), np.roll(np.arange(300), -1)
    sides = [np.stack([k, following, following + 300], 1), np.stack([k, following + 300, k + 300], 1)]
    ends = [np.stack([following, k, np.full(300, 600)], 1), np.stack([k + 300, following + 300, np.full(300, 601)], 1)]
    skin = Skin(points, np.concatenate(sides + ends).astype(np.int32))
    for centre in ((2.5, 0.0, 1.0), (1.2, 1.1, 3.4), (0.0, 0.3, 4.0)):
        probes = np.array(centre) + 0.3 * random.standard_normal((40, 3))
        distance, which, foot = skin.nearest(probes)
        feet = np.array(
            [min(closest_points(p, skin.triangles), key=lambda x, p=p: ((x - p) ** 2).sum()) for p in probes]
        )
        apart = np.linalg.norm(probes - feet, axis=1)
        if distance > 0.0:
            assert (distance, which) == (pytest.approx(apart.min(), rel=1e-12), int(apart.argmin()))
            assert foot == pytest.approx(feet[which], abs=1e-12)
        else:
            assert abs(distance) == pytest.approx(apart[which], rel=1e-12)


def test_without_mujoco_a_built_in_scene_says_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(RequestError, match=r'pip install "warp_mca\[robots\]"'):
        mca.make_scene("gripper")
