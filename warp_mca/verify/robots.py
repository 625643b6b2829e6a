"""Owns the cases of machines from robot files: swing, loops, limits and touch."""

from __future__ import annotations

import math
from dataclasses import replace
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.verify.case import Row, Setup, case
from warp_mca.verify.machines import ARM, DISC, FOUR_BAR, STOP, robot, swung

RATE = 3.0  # of the wheel and the crank at the start [rad/s]
TOLERANCE = "error control of the swing, or the step of the other code"


def _struck(step: float) -> tuple[float, NDArray[np.float64], NDArray[np.float64], float, float]:
    """The arm by MuJoCo alone, steps of RK4: time of the touch [s], velocity there [m/s], momenta, mass, energy."""
    import mujoco

    library: Any = mujoco
    model = library.MjModel.from_xml_string(ARM)
    model.opt.timestep = step
    model.opt.disableflags |= int(library.mjtDisableBit.mjDSBL_CONTACT)
    data = library.MjData(model)
    library.mj_resetDataKeyframe(model, data, 0)
    table, tool = model.geom("table").id, model.geom("tool").id
    ends = np.zeros(6)

    def gap() -> float:
        library.mj_kinematics(model, data)
        return library.mj_geomDistance(model, data, table, tool, 1.0, ends)

    before = data.qpos.copy(), data.qvel.copy(), 0.0
    while gap() > 0.0:
        before = data.qpos.copy(), data.qvel.copy(), data.time
        library.mj_step(model, data)
    low, high = 0.0, step
    for _ in range(60):  # halve the last step
        data.qpos[:], data.qvel[:], data.time = before
        model.opt.timestep = 0.5 * (low + high)
        library.mj_step(model, data)
        low, high = (model.opt.timestep, high) if gap() > 0.0 else (low, model.opt.timestep)
    library.mj_forward(model, data)
    J, M = np.zeros((3, model.nv)), np.zeros((model.nv, model.nv))
    library.mj_jac(model, data, J, None, ends[:3], model.body("tool").id)
    library.mj_fullM(model, data, M)
    mobility = J @ np.linalg.solve(M, J.T)
    return data.time, J @ data.qvel, M @ data.qvel, 1.0 / mobility[2, 2], 0.5 * data.qvel @ M @ data.qvel


@case(
    group="rigid",
    title="A six-axis arm with servos swings and touches a table when MuJoCo's own steps say so",
    reference="MuJoCo's RK4 with steps of 1e-4 s, the last one halved until the gap of tool and table closes.",
    needs="mujoco",
    elements=(),
)
def arm_touch(setup: Setup) -> list[Row]:
    """The arm of `machines.py` from its keyframe: touch, velocity there, kinetic energy, effective mass, momenta."""
    found = swung(ARM, keyframe="strike")
    (step,) = setup.choose((1e-4,), (1e-5,))
    t, velocity, momentum, mass, kinetic = _struck(step)
    touch = found.touch
    away = float(np.linalg.norm(touch.velocity - velocity))
    momenta = float(np.abs(found.momentum - momentum).max())
    return [
        Row("time of the touch", t, (found.t_end,), "s", 1e-6 / t, TOLERANCE),
        Row("error of the velocity there", 0.0, (away,), "m/s", 1e-5, TOLERANCE, scale=float(np.linalg.norm(velocity))),
        Row("effective mass along the normal", mass, (touch.effective_mass,), "kg", 1e-5, TOLERANCE),
        Row("kinetic energy", kinetic, (found.kinetic_energy,), "J", 1e-5, TOLERANCE),
        Row("error of the momenta", 0.0, (momenta,), "kg m^2/s", 1e-5, TOLERANCE, scale=float(np.abs(momentum).max())),
        Row("drift of the energy", 0.0, (found.energy_drift,), "-", 1e-8, "error control", scale=1.0),
    ]


def _four_bar(angle: float) -> tuple[float, float]:
    """Inertia of the four-bar on its crank [kg m^2] and its potential energy [J], over the crank's angle [rad]."""

    def pose(a: float) -> NDArray[np.float64]:
        """Middles of coupler and rocker, and their angles: the loop is closed where two circles meet."""
        pivot, ground = 0.1 * np.array([math.cos(a), math.sin(a)]), np.array([0.3, -0.2])
        way = ground - pivot
        d = float(np.hypot(*way))
        along = (0.35**2 - 0.25**2 + d**2) / (2.0 * d)
        across = math.sqrt(0.35**2 - along**2)
        tip = pivot + along * way / d + across * np.array([-way[1], way[0]]) / d
        bar, rocker = tip - pivot, tip - ground
        angles = [math.atan2(bar[1], bar[0]), math.atan2(rocker[1], rocker[0])]
        return np.array([*(pivot + 0.5 * bar), *(ground + 0.5 * rocker), *angles])

    h = 1e-5
    rate, now = (pose(angle + h) - pose(angle - h)) / (2.0 * h), pose(angle)
    inertia = 0.3 * 0.05**2 + 0.00025 + 0.9 * (rate[0] ** 2 + rate[1] ** 2) + 0.0091875 * rate[4] ** 2
    inertia += 0.6 * (rate[2] ** 2 + rate[3] ** 2) + 0.003125 * rate[5] ** 2
    return inertia, 9.81 * (0.3 * 0.05 * math.sin(angle) + 0.9 * now[1] + 0.6 * now[3])


@case(
    group="rigid",
    title="A four-bar from a robot file moves as its closed loop of one coordinate does, and stays closed",
    reference="I(a) a'^2 / 2 + V(a) = const with I and V of the closed loop, found where two circles meet.",
    needs="mujoco",
    elements=(),
)
def four_bar(setup: Setup) -> list[Row]:
    """Crank, coupler and rocker under gravity for 0.5 s from rates of a closed loop."""
    del setup
    found = swung(FOUR_BAR, t_end=0.5, qvel={"crank": RATE, "coupler": -RATE * (1.0 + 0.1 / 0.35), "rocker": 0.0})
    (inertia, potential), q = _four_bar(0.0), found.qpos_t[:, 0]
    total, worst = 0.5 * inertia * RATE**2 + potential, 0.0
    for angle, rate in zip(q, found.qvel_t[:, 0], strict=True):
        inertia, potential = _four_bar(float(angle))
        worst = max(worst, abs(rate**2 - 2.0 * (total - potential) / inertia))
    fastest = float((found.qvel_t[:, 0] ** 2).max())
    unit = lambda a: np.stack([np.cos(a), np.sin(a)])  # noqa: E731
    tip = 0.1 * unit(q) + 0.35 * unit(q + found.qpos_t[:, 1])
    other = np.array([[0.3], [-0.2]]) + 0.25 * unit(found.qpos_t[:, 2] + math.atan2(0.2, 0.15))
    opened = float(np.linalg.norm(tip - other, axis=0).max())
    error = "greatest error of the crank's rate squared"
    return [
        Row(error, 0.0, (worst,), "1/s^2", 1e-7, TOLERANCE, scale=fastest),
        Row("greatest gap of the loop", 0.0, (opened,), "m", 1e-9, "stabilised constraint", scale=0.1),
    ]


@case(
    group="rigid",
    title="A limit of a robot file's hinge stops it as a spring with critical damping does",
    reference="Depth v t exp(-w t), at most v / (e w); rate v (1 - w t) exp(-w t), -3 v exp(-4) at w t = 4.",
    needs="mujoco",
    elements=(),
)
def limit_stop(setup: Setup) -> list[Row]:
    """A wheel runs into the stop of its hinge at 3 rad/s."""
    del setup
    from warp_mca.robots.machine import LIMIT_RATE

    found = swung(STOP, t_end=0.5 / RATE + 4.0 / LIMIT_RATE, qvel=(RATE,))
    depth = float(swung(STOP, t_end=0.5 / RATE + 1.0 / LIMIT_RATE, qvel=(RATE,)).qpos[0]) - 0.5
    return [
        Row("rate as it is pushed back", -3.0 * RATE * math.exp(-4.0), (found.qvel[0],), "rad/s", 1e-7, TOLERANCE),
        Row("depth of the stop", RATE / (math.e * LIMIT_RATE), (depth,), "rad", 1e-7, TOLERANCE),
    ]


@case(
    group="rigid",
    title="A disc from a robot file flies freely: it keeps its momentum and precesses steadily",
    reference="Goldstein, Classical Mechanics, chapter 5: the axis turns about the angular momentum L at L / I_1.",
    needs="mujoco",
    elements=(),
)
def free_disc(setup: Setup) -> list[Row]:
    """A disc of 2 kg spins at 10 rad/s about its axis and 4 rad/s across it for 1 s."""
    del setup
    from scipy.spatial.transform import Rotation

    found = swung(DISC, t_end=1.0, qvel=(0.5, 0.0, -0.2, 4.0, 0.0, 10.0))
    turned = Rotation.from_quat(found.qpos_t[:, 3:7], scalar_first=True)
    L = turned.apply(found.qvel_t[:, 3:6] * (0.01, 0.01, 0.018))
    size = float(np.linalg.norm(L[0]))
    e = L[0] / size
    axis = turned.apply((0.0, 0.0, 1.0))
    across = axis - np.outer(axis @ e, e)
    x = across[0] / np.linalg.norm(across[0])
    angle = np.unwrap(np.arctan2(across @ np.cross(e, x), across @ x))
    way = float(np.linalg.norm(found.qpos[:3] - (0.5, 0.0, -0.2)))
    return [
        Row("angle of the precession", size / 0.01, (angle[-1],), "rad", 1e-9, TOLERANCE),
        Row(
            "change of the angular momentum",
            0.0,
            (float(np.abs(L - L[0]).max()),),
            "kg m^2/s",
            1e-9,
            TOLERANCE,
            scale=size,
        ),
        Row("error of the place", 0.0, (way,), "m", 1e-12, "round-off", scale=0.5),
    ]


TIP = ARM.replace('type="capsule" fromto="0 0 0.008 0 0 0.152"', 'type="sphere" pos="0 0 0.152"')


def _impact(duration: float) -> mca.ImpactPhase:
    return mca.ImpactPhase(duration=duration, output_interval=1e-6)


def _impulse(result: mca.Result) -> float:
    """Of the contact [N s]; forces are means over intervals of 1 µs."""
    return 1e-6 * float(result.F_n.sum())


def _bounced(stiffness: float, step: float, duration: float) -> float:
    """Impulse on the arm's tip [N s] by MuJoCo alone, whose ball a spring presses off the table, from the touch on."""
    import mujoco

    library: Any = mujoco
    found = swung(TIP, keyframe="strike")
    model = library.MjModel.from_xml_string(TIP)
    model.opt.timestep, model.opt.integrator = step, int(library.mjtIntegrator.mjINT_EULER)
    for flag in ("CONTACT", "EULERDAMP"):
        model.opt.disableflags |= int(getattr(library.mjtDisableBit, f"mjDSBL_{flag}"))
    data, tool = library.MjData(model), model.body("tool").id
    data.qpos[:], data.qvel[:], data.ctrl[:] = found.qpos, found.qvel, found.ctrl
    J, impulse = np.zeros((3, model.nv)), 0.0
    for _ in range(round(duration / step)):
        library.mj_fwdPosition(model, data)
        point = data.geom("tool").xpos - (0.0, 0.0, 0.008)
        force = stiffness * max(0.04 - point[2], 0.0)
        library.mj_jac(model, data, J, None, point, tool)
        data.qfrc_applied[:] = force * J[2]
        impulse += force * step
        library.mj_step(model, data)
    return impulse


def _flexible(setup: Setup) -> float:
    """Error of the energy of a strike with a bar of finite elements that yields, as a share of the kinetic energy."""
    steel = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=1e9, E_t=1e9)
    rod = mca.Rod(radius=0.008, length=0.16, section=2, ring=1, axial=10)
    bar = mca.Body(name="tool", geometry=rod, material=steel, rotation=(0.0, -0.5 * math.pi, 0.0))
    with TemporaryDirectory() as folder:
        arm = robot(ARM, folder, keyframe="strike", flexible={"tool": bar}, mounts={"tool": "start"})
        scene = arm.strike(impact=_impact(4e-4))
    result = mca.run(scene, device=setup.device)
    return abs(float(result.summary["energy"]["error"]))


@case(
    group="rigid",
    title="A six-axis arm of rigid links strikes a table, and its servos push on",
    reference="MuJoCo with a spring at the tip; without other forces 2 m v with the effective mass m at the touch.",
    needs="mujoco",
    elements=(),
)
def arm_strike(setup: Setup) -> list[Row]:
    """The arm with a ball as its tip, at 1e8 N/m with all forces on; the full level adds 1e9 N/m without, and a bar."""
    with TemporaryDirectory() as folder:
        arm = robot(TIP, folder, keyframe="strike")
        found = arm.swing()
        scene = arm.strike(impact=_impact(4.2e-4), swing=found, stiffness=1e8)
        bare = arm.strike(impact=_impact(1.3e-4), swing=found, stiffness=1e9)
    result = mca.run(scene, device=setup.device, precision="float64")
    exact = _bounced(1e8, 1e-7, 4.2e-4)
    first = float(result["joint_j2_drive1_Nm"][1])
    drift = abs(float(result.summary["energy"]["error"]))
    rows = [
        Row("impulse at 1e8 N/m, all forces on", exact, (_impulse(result),), "N s", 0.005, "24 faces around the tip"),
        Row("error of the energy", 0.0, (drift,), "-", 3e-3, "second order of the springs", scale=1.0),
        Row("torque of the servo of j2 at the start", found.drives[1], (first,), "N m", 1e-3, "mean of an interval"),
    ]
    if setup.level == "full":
        free = lambda item: replace(item, motor=None, damping=0.0)  # noqa: E731
        joints = tuple(replace(j, freedoms=tuple(map(free, j.freedoms))) for j in bare.joints)  # type: ignore[attr-defined]
        bare = replace(bare, joints=joints, gravity=(0.0, 0.0, 0.0))
        assert found.touch is not None
        whole = 2.0 * found.touch.effective_mass * -float(found.touch.velocity @ found.touch.normal)
        impulse = _impulse(mca.run(bare, device=setup.device, precision="float64"))
        rows.append(Row("impulse at 1e9 N/m, no other forces", whole, (impulse,), "N s", 0.005, "the spring's time"))
        rows.append(Row("error of the energy, steel bar", 0.0, (_flexible(setup),), "-", 3e-3, "mixed", scale=1.0))
    return rows
