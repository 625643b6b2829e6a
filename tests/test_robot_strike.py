"""Machines at their hand-off: bodies, joints and contacts have the motion, momenta and forces of the swing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.rotation import rotation_matrix
from warp_mca.cli.main import main
from warp_mca.robots.geoms import filled, geom_surface, hull
from warp_mca.scene.model_file import load, save
from warp_mca.verify.machines import ARM, STOP, robot, write_stl

mujoco = pytest.importorskip("mujoco")

STEEL = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=1e9, E_t=1e9)
IMPACT = mca.ImpactPhase(duration=2e-3, output_interval=1e-6)
TOOL = mca.Body(
    name="tool",
    geometry=mca.Rod(radius=0.008, length=0.16, section=2, ring=1, axial=8),
    material=STEEL,
    rotation=(0.0, -np.pi / 2, 0.0),  # along z of the link
)


def arm(tmp_path, text=ARM, **more):
    return robot(text, tmp_path, keyframe="strike", **more)


def motion(body):
    """Mass centre [m], its velocity [m/s], angular velocity and angular momentum about it, of a rigid body."""
    R, spin = rotation_matrix(body.rotation), np.array(body.angular_velocity)
    arm = R @ np.array(body.centre)
    inertia = R @ np.array(body.inertia) @ R.T
    return np.array(body.position) + arm, np.array(body.velocity) + np.cross(spin, arm), spin, inertia @ spin


def test_rigid_links_have_the_energy_and_the_momenta_of_the_swing(tmp_path):
    """p_j = a . (angular momentum of all links beyond the hinge j, about it) + armature q', from the bodies alone."""
    text = ARM.replace('<joint name="j2"', '<joint name="j2" armature="0.3"')
    swing = arm(tmp_path, text).swing()
    scene = arm(tmp_path, text).strike(impact=IMPACT, swing=swing)
    links = [body for body in scene.bodies if body.mass is not None]
    assert [body.name for body in links] == ["shoulder", "upper", "fore", "wrist1", "wrist2", "flange", "tool"]
    kinetic = 0.5 * 0.3 * swing.qvel[1] ** 2
    momenta = np.zeros(6)
    momenta[1] += 0.3 * swing.qvel[1]
    for k, body in enumerate(links):
        centre, velocity, spin, angular = motion(body)
        kinetic += 0.5 * body.mass * velocity @ velocity + 0.5 * spin @ angular
        for j, joint in enumerate(scene.joints[: min(k + 1, 6)]):
            (freedom,) = joint.freedoms
            carrier = scene.body(joint.body)
            R = rotation_matrix(carrier.rotation)
            point = np.array(carrier.position) + R @ np.array(freedom.at)
            momenta[j] += R @ np.array(freedom.axis) @ (angular + body.mass * np.cross(centre - point, velocity))
    assert kinetic == pytest.approx(swing.kinetic_energy, rel=1e-12)
    assert momenta == pytest.approx(swing.momentum, rel=1e-10, abs=1e-12)


def test_servos_go_on_with_the_torques_that_they_had(tmp_path):
    swing = arm(tmp_path).swing()
    scene = arm(tmp_path).strike(impact=IMPACT, swing=swing)
    for k, joint in enumerate(scene.joints[:6]):
        (freedom,) = joint.freedoms
        servo = freedom.motor
        assert freedom.position == swing.qpos[k]
        torque = np.clip(servo.kp * (servo.target - freedom.position) - servo.kv * swing.qvel[k], *servo.limits)
        assert torque == pytest.approx(swing.drives[k], rel=1e-12)
        assert freedom.damping == (0.2, 0.2, 0.1, 0.05, 0.05, 0.02)[k]


@pytest.mark.parametrize(
    ("drive", "control"),
    [
        ('<motor name="m" joint="hinge" gear="3" ctrllimited="true" ctrlrange="-1 1"/>', 1.7),
        ('<motor name="m" joint="hinge" gear="-3" forcerange="-1 2"/>', 1.7),
        ('<velocity name="m" joint="hinge" kv="0.5"/>', 2.0),
        ('<velocity name="m" joint="hinge" kv="0.5" gear="2" forcerange="-1 1"/>', 5.0),
        ('<position name="m" joint="hinge" kp="4" kv="0.3" gear="2" forcerange="-9 9"/>', 0.4),
        ('<position name="m" joint="hinge" kp="4"/><motor name="n" joint="hinge"/>', 0.4),
        (
            '<general name="m" joint="hinge" gaintype="affine" gainprm="1 2 3" biastype="affine" biasprm="1 -9 -8"/>',
            0.4,
        ),
    ],
)
def test_every_kind_of_drive_goes_on(tmp_path, drive, control):
    """With a zero of the joint at ref; the torque at the start of the impact is that at the end of the swing."""
    text = STOP.replace('name="hinge"', 'name="hinge" ref="0.2" springref="0.3" stiffness="2" frictionloss="0.1"')
    text = text.replace("</worldbody>", f"</worldbody><actuator>{drive}</actuator>")
    machine = robot(text, tmp_path, qpos=(0.1,), qvel=(0.6,), ctrl={"m": control})
    swing = machine.swing(t_end=0.05)
    (joint,) = machine.strike(impact=IMPACT, swing=swing).joints
    (freedom,) = joint.freedoms
    q, v = freedom.position, swing.qvel[0]
    assert q == pytest.approx(swing.qpos[0] - 0.2)
    assert (freedom.rest, freedom.limits) == (pytest.approx(0.1), (pytest.approx(-1.2), pytest.approx(0.3)))
    torque = -freedom.damping * v
    if isinstance(freedom.motor, mca.PositionServo):
        servo = freedom.motor
        torque += np.clip(servo.kp * (servo.target - q) - servo.kv * v, *(servo.limits or (-np.inf, np.inf)))
    elif freedom.motor is not None:
        torque += freedom.motor.values[0]
    assert torque == pytest.approx(swing.drives.sum(), rel=1e-8)


def test_flexible_link_takes_its_mesh_or_carries_what_the_file_has_beyond(tmp_path):
    """The tool is that of its bar to 2 %; with a motor of 0.3 kg in the link this rides on it."""
    alike = arm(tmp_path, flexible={"tool": TOOL}, mounts={"tool": "start"})
    swing = alike.swing(t_end=0.1)
    scene = alike.strike(impact=IMPACT, swing=swing)
    mesh = alike.mesh_masses["tool"]
    assert mesh.mass == pytest.approx(0.24832, rel=0.02) and mesh.mass != 0.24832
    assert scene.body("tool").geometry == TOOL.geometry and not scene.body("tool").rigid
    joint = scene.joints[-1]
    assert (joint.body, joint.nodes, joint.other, joint.freedoms) == ("tool", "start", "flange", ())
    kinetic = sum(
        0.5 * b.mass * motion(b)[1] @ motion(b)[1] + 0.5 * motion(b)[2] @ motion(b)[3] for b in scene.bodies[:6]
    )
    body = scene.body("tool")
    R, spin = rotation_matrix(body.rotation), np.array(body.angular_velocity)
    raw = rotation_matrix(TOOL.rotation).T @ mesh.centre
    velocity = np.array(body.velocity) + np.cross(spin, R @ raw)
    turned = R @ rotation_matrix(TOOL.rotation).T
    kinetic += 0.5 * mesh.mass * velocity @ velocity + 0.5 * spin @ turned @ mesh.inertia @ turned.T @ spin
    assert kinetic == pytest.approx(swing.kinetic_energy, rel=1e-12)

    text = ARM.replace(
        'pos="0 0 0.07868" mass="0.24832" diaginertia="0.0005166 0.0005166 0.000007893"',
        'pos="0 0 0.05" mass="0.55" diaginertia="0.0013 0.0013 0.00005"',
    )
    heavy = arm(tmp_path, text, flexible={"tool": TOOL}, mounts={"tool": "start"})
    scene = heavy.strike(impact=IMPACT, swing=heavy.swing(t_end=1e-3))
    rest = scene.body("tool rest")
    assert rest.mass + mesh.mass == pytest.approx(0.55)
    assert rest.mass * np.array(rest.centre) + mesh.mass * mesh.centre == pytest.approx(
        [0.0, 0.0, 0.55 * 0.05], abs=1e-9
    )
    mount, joint = scene.joints[-2:]
    assert (mount.body, mount.other, mount.other_nodes) == ("tool rest", "tool", "start")
    assert (joint.body, joint.other, joint.nodes) == ("tool rest", "flange", None)


@pytest.mark.parametrize(
    ("tool", "words"),
    [
        ({"mass": "0.2"}, "the file gives the link 0.2 kg"),
        ({"mass": "0.5", "diaginertia": "0.0006 0.0006 0.000001"}, "which no body has"),
    ],
)
def test_meshes_that_do_not_fit_the_file_are_refused_with_figures(tmp_path, tool, words):
    text = ARM.replace("</body>", "", 0)
    for name, value in tool.items():
        old = {"mass": 'mass="0.24832"', "diaginertia": 'diaginertia="0.0005166 0.0005166 0.000007893"'}[name]
        text = text.replace(old, f'{name}="{value}"')
    with pytest.raises(mca.RequestError, match=words):
        arm(tmp_path, text, flexible={"tool": TOOL}).swing()


def test_a_mesh_beside_its_link_is_refused_by_its_place(tmp_path):
    """Of the same mass as the link, and lighter than it."""
    for heavy in (False, True):
        text = ARM.replace('mass="0.24832"', 'mass="0.5"').replace("0.000007893", "0.00005") if heavy else ARM
        text = text.replace("0.0005166 0.0005166", "0.0013 0.0013") if heavy else text
        aside = replace(TOOL, position=(0.3, 0.0, 0.0))
        said = r"mass centre of the mesh of link tool \[m\] = '\(0\.3, .*the link at \(0, 0, 0\.07868\), in the link's"
        with pytest.raises(mca.RequestError, match=said):
            arm(tmp_path, text, flexible={"tool": aside}).swing()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('range="-2.2 2.2" damping="0.05"', 'range="-2.2 2.2" damping="-0.05"', "damping of joint j5 = -0.05"),
    ],
)
def test_what_an_impact_does_not_carry_is_refused_by_name(tmp_path, old, new, words):
    machine = arm(tmp_path, ARM.replace(old, new), qvel={"j6": 0.0})
    with pytest.raises(mca.RequestError, match=words):
        machine.strike(impact=IMPACT, swing=machine.swing(t_end=1e-3))


def test_mistakes_at_the_hand_off_are_refused(tmp_path):
    with pytest.raises(mca.RequestError, match=r"mounts\['tool'\] = None: name the node set that holds it to flange"):
        loose = arm(tmp_path, flexible={"tool": TOOL})
        loose.strike(impact=IMPACT, swing=loose.swing(t_end=1e-3))
    held = arm(tmp_path, controller=lambda t, q, v: [0.0] * 6, period=1e-3)
    with pytest.raises(mca.RequestError, match=r"Robot\.period = 0\.001: controls are held during an impact"):
        held.strike(impact=IMPACT)


def test_a_model_file_holds_what_was_handed_over(tmp_path):
    """It needs no MuJoCo to run: bodies, joints with their drives, contacts with their stiffness."""
    machine = arm(tmp_path, flexible={"tool": TOOL}, mounts={"tool": "start"})
    scene = machine.strike(impact=IMPACT, swing=machine.swing(t_end=1e-3))
    save(tmp_path / "arm.mca", scene, mca.mesh(scene))
    stored = load(tmp_path / "arm.mca").scene
    assert (stored.joints, stored.contacts, stored.gravity) == (scene.joints, scene.contacts, scene.gravity)
    rigid = arm(tmp_path).strike(impact=IMPACT)
    save(tmp_path / "rigid.mca", rigid, mca.mesh(rigid))
    stored = load(tmp_path / "rigid.mca").scene
    assert stored.contacts == rigid.contacts and stored.parameters == rigid.parameters


def test_only_surfaces_that_may_touch_within_the_impact_are_meshed(tmp_path):
    scene = arm(tmp_path).strike(impact=IMPACT)
    (contact,) = scene.contacts
    assert contact.sides == ("tool", "table") and contact.stiffness == 1e8
    assert contact.normal == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)
    assert [body.name for body in scene.bodies if type(body.geometry) is mca.Mesh] == ["tool", "table"]
    tool = scene.body("tool")
    X = np.array(tool.position) + tool.geometry.points @ rotation_matrix(tool.rotation).T
    assert X[:, 2].min() == pytest.approx(0.04, abs=1e-12)  # a node where it touches


@pytest.mark.parametrize("size", ["capsule 0.01 0.05", "sphere 0.02", "ellipsoid 0.01 0.02 0.03", "cylinder 0.02 0.01"])
def test_geoms_are_closed_surfaces_of_their_volume(size):
    kind, *sizes = size.split()
    text = f'<mujoco><worldbody><geom type="{kind}" size="{" ".join(sizes)}"/></worldbody></mujoco>'
    machine = type("M", (), {"model": mujoco.MjModel.from_xml_string(text)})
    mesh = filled("geom", geom_surface(mujoco, machine, 0, "geom", 96), "skin")  # type: ignore[arg-type]
    a, *more = map(float, sizes)
    exact = {
        "capsule": np.pi * a**2 * (4 / 3 * a + 2 * (more or [0])[0]),
        "sphere": 4 / 3 * np.pi * a**3,
        "ellipsoid": 4 / 3 * np.pi * a * np.prod(more),
        "cylinder": np.pi * a**2 * 2 * (more or [0])[0],
    }[kind]
    corners = mesh.points[mesh.tetrahedra]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / 6.0
    assert volume == pytest.approx(exact, rel=3e-3)
    assert len(mesh.boundary[0]) == len(mesh.tetrahedra)


def urdf_of_arm():
    """The arm as a URDF without drives, table and start; the surface of its tool is an STL file."""
    model = mujoco.MjModel.from_xml_string(ARM)
    tool = model.body("tool").id
    links = ['<link name="world"/>']
    for k in range(1, model.nbody):
        x, y, z = model.body_ipos[k]
        a, b, c = model.body_inertia[k]
        mesh = '<collision><geometry><mesh filename="tool.stl"/></geometry></collision>' if k == tool else ""
        links.append(
            f'<link name="{model.body(k).name}"><inertial><origin xyz="{x} {y} {z}"/>'
            f'<mass value="{model.body_mass[k]}"/>'
            f'<inertia ixx="{a}" iyy="{b}" izz="{c}" ixy="0" ixz="0" iyz="0"/></inertial>{mesh}</link>'
        )
        x, y, z = model.body_pos[k]
        parent = model.body(model.body_parentid[k]).name
        ends = f'<parent link="{parent}"/><child link="{model.body(k).name}"/><origin xyz="{x} {y} {z}"/>'
        if model.body_jntnum[k]:
            j = int(model.body_jntadr[k])
            u, v, w = model.jnt_axis[j]
            low, high = model.jnt_range[j] if model.jnt_limited[j] else (-9.0, 9.0)
            links.append(
                f'<joint name="{model.joint(j).name}" type="revolute">{ends}<axis xyz="{u} {v} {w}"/>'
                f'<limit lower="{low}" upper="{high}" effort="0" velocity="0"/>'
                f'<dynamics damping="{model.dof_damping[j]}"/></joint>'
            )
        else:
            links.append(f'<joint name="bolt" type="fixed">{ends}</joint>')
    return "<robot name='arm'>" + "".join(links) + "</robot>"


def test_the_arm_from_a_urdf_with_a_mesh_strikes_alike(tmp_path):
    """Servos, start and table are given in Python; the surface of the tool has a node where the capsule touches."""
    model = mujoco.MjModel.from_xml_string(ARM)
    text = urdf_of_arm()
    machine = robot(ARM, tmp_path, keyframe="strike")
    swing = machine.swing()
    whole = machine.strike(impact=IMPACT, swing=swing).body("tool")
    points = whole.geometry.points[:-1]
    lowest = (points @ rotation_matrix(whole.rotation).T)[:, 2].argmin()
    points, faces = hull(np.vstack([points[::12], points[lowest]]))
    write_stl(tmp_path / "tool.stl", points[faces])
    servos = {}
    for k in range(6):
        kp, kv = model.actuator_gainprm[k, 0], -model.actuator_biasprm[k, 2]
        target, limits = model.key_ctrl[0][k], tuple(model.actuator_forcerange[k])
        servos[f"j{k + 1}"] = mca.PositionServo(kp=kp, kv=kv, target=target, limits=limits)
    table = mca.Box(size=(0.5, 0.5, 0.04), divisions=(1, 1, 1), origin=(0.2, -0.25, 0.0))
    top = mca.Body(name="top", geometry=table, material=STEEL, rigid=True)
    start = {"qpos": tuple(model.key_qpos[0]), "qvel": tuple(model.key_qvel[0])}
    struck = robot(text, tmp_path, "arm.urdf", servos=servos, against=(top,), touch=("tool",), **start)
    found = struck.swing()
    assert found.t_end == pytest.approx(swing.t_end, abs=1e-6)
    assert found.touch.velocity == pytest.approx(swing.touch.velocity, rel=1e-4)
    assert found.touch.effective_mass == pytest.approx(swing.touch.effective_mass, rel=1e-4)
    held = (mca.Fixed(body="top", nodes="boundary"),)
    scene = struck.strike(impact=replace(IMPACT, duration=4.2e-4), swing=found, fixed=held)
    result = mca.run(scene, precision="float64")
    assert 1e-6 * result.F_n.sum() == pytest.approx(3.39, rel=0.005)


@pytest.mark.gpu
def test_arm_strikes_alike_on_a_gpu(tmp_path):
    machine = arm(tmp_path, flexible={"tool": TOOL}, mounts={"tool": "start"})
    scene = machine.strike(impact=replace(IMPACT, duration=1e-4))
    one, other = (mca.run(scene, device=device, precision="float64") for device in ("cpu", "cuda:0"))
    assert other.F_n == pytest.approx(one.F_n, rel=1e-6, abs=1e-3)
    assert abs(other.summary["energy"]["error"]) < 3e-3


def test_command_prints_a_scene_file_that_strikes(tmp_path, capsys):
    (tmp_path / "arm.xml").write_text(ARM)
    main(["run", str(tmp_path / "arm.xml")])
    said = capsys.readouterr()
    assert "warp-mca run arm_strike.py" in said.err
    space: dict = {}
    exec(compile(said.out, "arm_strike.py", "exec"), space)
    scene = space["build"]()
    assert scene.parameters["swing"] == pytest.approx(0.104568, abs=1e-6)
    assert replace(scene, name="x").bodies == scene.bodies


BENT = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
  <body name="base"><geom name="foot" size="0.05" mass="1"/>
    <body name="upper"><joint name="shoulder" axis="0 1 0" range="-1 1"/>
      <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="1"/>
      <body name="lower" pos="0.2 0 0"><joint name="elbow" axis="0 1 0" range="0.5 1.5"/>
        <joint name="twist" range="0.2 0.4"/><geom name="tip" size="0.03" pos="0.2 0 0" mass="0.5"/>
  </body></body></body></worldbody></mujoco>"""


def test_command_bends_joints_that_start_beyond_their_ranges_and_lays_a_floor_below(tmp_path, capsys):
    """A base is nothing to strike, and links that overlap each other at the start are not looked at."""
    (tmp_path / "bent.xml").write_text(BENT)
    main(["run", str(tmp_path / "bent.xml")])
    space: dict = {}
    exec(compile(said := capsys.readouterr().out, "bent_strike.py", "exec"), space)
    assert 'qpos={"elbow": 1.0, "twist": 0.3}' in said and "touch=('lower',)" in said
    low = -0.2 * np.sin(1.0) * np.cos(0.3) - 0.03 - 0.05
    (contact,) = space["build"]().contacts
    assert contact.master.point[2] == pytest.approx(low, abs=6e-4)
    remedy = r"Robot.qpos of joint elbow = 0.0: start within its limits, 0.5 to 1.5; so must twist"
    with pytest.raises(mca.RequestError, match=remedy):
        mca.Robot(tmp_path / "bent.xml").swing()


def pair_of(shape: str, offset: float) -> str:
    """A sphere of 1 kg that flies along x at a body of 3 kg, both free."""
    return f"""<mujoco><option gravity="0 0 0"/><worldbody>
    <body name="a"><freejoint name="fa"/><geom name="ga" type="sphere" size=".05" mass="1"/></body>
    <body name="c" pos=".3 0 {offset}"><freejoint name="fc"/><geom name="gc" {shape} mass="3"/></body>
    </worldbody></mujoco>"""


@pytest.mark.parametrize("shape", ['type="sphere" size=".05"', 'type="capsule" fromto="0 -.2 0 0 .2 0" size=".05"'])
@pytest.mark.parametrize("offset", [0.0, 0.03])
def test_round_bodies_part_along_the_line_of_their_middles(tmp_path, shape, offset):
    """Without friction a sphere keeps its spin of 0, and its velocity changes by 2 m_eff / m along the normal."""
    file = tmp_path / "pair.xml"
    file.write_text(pair_of(shape, offset))
    robot = mca.Robot(file, qvel={"fa": [2, 0, 0, 0, 0, 0]})
    swing = robot.swing()
    impact = mca.ImpactPhase(duration=2.5e-3, output_interval=1e-5)
    scene = robot.strike(impact=impact, swing=swing, stiffness=1e7)
    found = robot.after(swing, scene, mca.run(scene, device="cpu", precision="float64")).robot.qvel
    sine = offset / 0.1
    normal = np.array([np.sqrt(1.0 - sine**2), 0.0, sine])
    assert found[:3] == pytest.approx([2.0, 0.0, 0.0] - 1.5 * 2.0 * normal[0] * normal, abs=0.01)
    assert found[3:6] == pytest.approx(np.zeros(3), abs=0.8)


def test_swings_of_other_machines_and_freedoms_that_are_one_are_refused(tmp_path):
    file = tmp_path / "pair.xml"
    file.write_text(pair_of('type="sphere" size=".05"', 0.0))
    other = tmp_path / "other.xml"
    other.write_text(pair_of('type="sphere" size=".05"', 0.0).replace('mass="1"', 'mass="2"'))
    swing = mca.Robot(other, qvel={"fa": [2, 0, 0, 0, 0, 0]}).swing()
    with pytest.raises(mca.RequestError, match="of another machine"):
        mca.Robot(file).strike(impact=mca.ImpactPhase(duration=1e-3), swing=swing)
    twice = '<body><joint name="j"/><joint name="k"/><geom size=".1" mass="1"/></body>'
    file.write_text(f"<mujoco><worldbody>{twice}</worldbody></mujoco>")
    with pytest.raises(mca.RequestError, match="move nothing, or the same"):
        mca.Robot(file).swing(t_end=0.1)
    rod = mca.Body(name="rod", rigid=True, mass=1.0, centre=(0.1, 0.0, 0.0), inertia=(1e-3, 1e-3, 1e-3))
    joint = mca.Articulation(name="J", body="rod", freedoms=(mca.Freedom(), mca.Freedom()))
    with pytest.raises(mca.RequestError, match="two make the same motion"):
        mca.Scene(name="s", bodies=(rod,), joints=(joint,), impact=mca.ImpactPhase(duration=1e-3))


def test_compensated_gravity_is_not_felt_in_an_impact(tmp_path):
    """Links feel (1 - gravcomp) g, a flexible body beside all of it, so that a scene with a rigid one has it all."""
    text = """<mujoco><worldbody>
      <body name="a" gravcomp="0.75"><joint name="h" axis="0 1 0"/><geom size="0.1" mass="1"/>
        <body name="b" gravcomp="0.75" pos="0.5 0 0"><geom name="head" size="0.1" mass="1"/></body>
      </body></worldbody></mujoco>"""
    beside = mca.Body(name="block", geometry=mca.Box(size=(0.1,) * 3, divisions=(1, 1, 1)), material=STEEL)
    beside = replace(beside, position=(2.0, 0.0, 0.0))
    machine = robot(text, tmp_path, against=(beside,))
    swing = machine.swing(t_end=1e-3)
    scene = machine.strike(impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-4), swing=swing)
    assert scene.gravity == pytest.approx((0.0, 0.0, -9.81 / 4))
    assert [(load.body, load.acceleration[2]) for load in scene.loads] == [("block", pytest.approx(-9.81 * 0.75))]
    alone = replace(machine, against=())
    scene = alone.strike(impact=scene.impact, swing=swing)
    back = alone.after(swing, scene, mca.run(scene, precision="float64"))
    assert back.robot.qvel == pytest.approx(alone.swing(t_end=back.robot.clock).qvel, abs=1e-8)
    rigid = robot(text, tmp_path, against=(replace(beside, rigid=True),))
    scene = rigid.strike(impact=scene.impact, swing=rigid.swing(t_end=1e-3))
    assert scene.gravity == (0.0, 0.0, -9.81)
    block = mca.run(scene, precision="float64").summary["rigid_bodies"]["block"]
    assert block["momentum"][2] == pytest.approx(-9.81e-3 * block["mass"])


@pytest.mark.parametrize(("one", "other"), [(0.0, 0.75), (1.0, 0.25)])
def test_each_link_feels_the_gravity_that_is_left_to_it(tmp_path, one, other):
    """An impact without a touch goes on as a swing does; a flexible link is borne as a whole, what rides on it, too."""
    text = f"""<mujoco><worldbody>
      <body name="a" gravcomp="{one}"><joint name="h" axis="0.1 1 0.3"/><geom size="0.1" mass="1"/>
        <body name="b" gravcomp="{other}" pos="0.5 0 0"><joint name="k" axis="0.3 1 0"/>
          <geom size="0.1" pos="0.2 0.1 0" mass="2"/></body></body>
      <body name="c" pos="3 0 0" gravcomp="{other}"><freejoint/>
        <geom type="box" size="0.05 0.05 0.05" mass="15"/></body>
      </worldbody></mujoco>"""
    cube = mca.Box(size=(0.1,) * 3, divisions=(2, 2, 2), origin=(-0.05,) * 3)
    machine = robot(text, tmp_path, flexible={"c": cube}, material=STEEL, mounts={"c": "zmin"})
    swing = machine.swing(t_end=1e-3)
    scene = machine.strike(impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-4), swing=swing)
    back = machine.after(swing, scene, mca.run(scene, precision="float64"))
    wanted = machine.swing(t_end=back.robot.clock).qvel
    assert back.robot.qvel == pytest.approx(wanted, abs=1e-6 * np.abs(wanted).max())


def test_flexible_links_on_balls_and_in_free_flight_come_back(tmp_path):
    """Their pose is the mean of their nodes; the mesh is given in a frame of its own, the motion is that of a swing."""
    text = """<mujoco><worldbody>
      <body name="a"><joint name="h" axis="0.1 1 0.3"/><geom size="0.1" mass="4"/>
        <body name="b" pos="0.5 0 0" euler="0 30 50"><joint name="k" type="ball"/>
          <geom name="hung" type="box" size="0.05 0.05 0.05" pos="0.2 0 0" mass="7.85"/></body></body>
      <body name="c" pos="3 0 0" euler="40 20 0"><freejoint name="f"/>
        <geom name="thrown" type="box" size="0.05 0.05 0.05" mass="7.85"/></body></worldbody></mujoco>"""
    cube = mca.Box(size=(0.1,) * 3, divisions=(12,) * 3, origin=(-0.05,) * 3)
    turned = mca.Body(
        name="b", geometry=cube, material=STEEL, position=(0.2, 0.0, 0.0), rotation=(0.5 * np.pi, 0.0, 0.0)
    )
    flexible = {"b": turned, "c": replace(turned, name="c", position=(0.0,) * 3, rotation=(0.0, 0.5 * np.pi, 0.0))}
    rates = {"k": (1.0, 2.0, 3.0), "f": (0.1, 0.2, 0.3, 3.0, -2.0, 1.0), "h": 2.0}
    machine = robot(text, tmp_path, flexible=flexible, mounts={"b": "xmin"}, qvel=rates)
    swing = machine.swing(t_end=1e-3)
    scene = machine.strike(impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-4), swing=swing)
    back = machine.after(swing, scene, mca.run(scene))
    on = machine.swing(t_end=back.robot.clock)
    assert back.robot.qpos == pytest.approx(on.qpos, abs=2e-6)
    assert back.robot.qvel == pytest.approx(on.qvel, abs=2e-3)


@pytest.mark.parametrize(
    ("joint", "actuators"),
    [
        ("", '<position joint="h" kp="30" forcerange="-2 2"/><velocity joint="h" kv="0.4"/>'),
        ("", '<position joint="h" kp="30" kv="1" forcerange="-9 9"/><motor joint="h" forcerange="-0.3 0.3"/>'),
        (
            'stiffness="3" springref="0.3"',
            '<position joint="h" kp="30" forcerange="-2 2"/><position joint="h" kp="9"/>',
        ),
        ("", '<position joint="h" kp="30" forcerange="-2 2"/><velocity joint="h" kv="0.4" forcerange="-0.9 0.9"/>'),
        (
            'stiffness="2"',
            '<position joint="h" kp="30" kv="1" forcerange="-9 9"/><position joint="h" kp="20" forcerange="-12 1.5"/>',
        ),
        ('actuatorfrcrange="-5 5"', '<position joint="h" kp="3"/><velocity joint="h" kv="0.4"/>'),
    ],
)
def test_actuators_that_share_a_joint_act_together(tmp_path, joint, actuators):
    """One clamp beside drives without, a clamp of each, or one of all: the impact goes on as the swing does."""
    text = f"""<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="h" {joint}/><geom size="0.1" mass="1"/>
      </body></worldbody><actuator>{actuators}</actuator></mujoco>"""
    machine = robot(text, tmp_path, qvel={"h": 2.0}, ctrl=(-0.2, -0.9))
    swing = machine.swing(t_end=1e-3)
    scene = machine.strike(impact=mca.ImpactPhase(duration=0.05, output_interval=1e-3), swing=swing)
    back = machine.after(swing, scene, mca.run(scene, precision="float64"))
    wanted = machine.swing(t_end=back.robot.clock).qvel
    assert back.robot.qvel == pytest.approx(wanted, rel=2e-4)
    assert abs(wanted[0] - 2.0) > 0.5
