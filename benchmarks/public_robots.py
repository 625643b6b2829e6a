"""Public robots, from their files to the impulse of a strike and the stress of a link.

    python -m benchmarks.public_robots FOLDER    run, write docs/measurements/public_robots.json and the page
    python -m benchmarks.public_robots --render  write the page again

FOLDER holds the robots, as a clone of google-deepmind/mujoco_menagerie does; files are found by their names.
"""

from __future__ import annotations

import argparse
import inspect
import json
import math
import textwrap
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import warp_mca as mca
from benchmarks.measurements import FOLDER, measured, note
from warp_mca.robots.reading import mujoco
from warp_mca.robots.swing import RobotSwing

FILE, TEMPLATE = FOLDER / "public_robots.json", FOLDER / "public_robots.template.md"
SPAN = 4.0  # of the impact, over half a period of the effective mass on the contact's spring


class Case(NamedTuple):
    """A robot: its name and file, the link that may touch, height of the ground [m], and its start."""

    name: str
    file: str
    touch: str
    ground: float
    start: dict[str, Any]


STIFFNESS = 1e9
CASES = (
    Case("UR5e", "ur5e.xml", "wrist_3_link", 0.2, {"ctrl": {"shoulder_lift": -1.0, "elbow": 1.7}}),
    Case("Panda", "panda.xml", "left_finger", 0.2, {"ctrl": {"actuator2": 0.6}}),
    Case("Go2", "go2.xml", "FL_calf", -0.15, {"ctrl": (0.0,) * 12}),
)


def path_of(folder: Path, name: str) -> Path:
    """Where a file lies.

    Raises:
        SystemExit: nowhere in the folder.
    """
    found = sorted(folder.rglob(name))
    if not found:
        raise SystemExit(f"{name} is not in {folder}: give a folder that holds it")
    return found[0]


def free(scene: mca.Scene) -> mca.Scene:
    """A strike without what acts in joints but rotors and limits, and without gravity."""
    off: dict[str, Any] = {"motor": None, "stiffness": 0.0, "damping": 0.0, "friction": 0.0}
    joints = [
        replace(joint, freedoms=tuple(replace(freedom, **off) for freedom in joint.freedoms))
        if isinstance(joint, mca.Articulation)
        else joint
        for joint in scene.joints
    ]
    return replace(scene, joints=tuple(joints), gravity=(0.0, 0.0, 0.0))


def effective_mass(path: Path, swing: RobotSwing, link: str) -> float:
    """1 / (n . J A J^T n) at the touch, by MuJoCo alone [kg]; A is M^-1 on the motions that equalities allow."""
    mj = mujoco("file", path)
    assert swing.touch is not None
    model = mj.MjModel.from_xml_path(str(path))
    model.opt.jacobian = mj.mjtJacobian.mjJAC_DENSE
    data = mj.MjData(model)
    data.qpos[:] = swing.qpos
    mj.mj_forward(model, data)
    J, M = np.zeros((3, model.nv)), np.zeros((model.nv, model.nv))
    mj.mj_jac(model, data, J, None, swing.touch.point, model.body(link).id)
    mj.mj_fullM(model, data, M)
    row, tied = swing.touch.normal @ J, np.array(data.efc_J).reshape(-1, model.nv)[: data.ne]
    A = np.linalg.inv(M)
    A -= A @ tied.T @ np.linalg.solve(tied @ A @ tied.T, tied @ A)
    return 1.0 / float(row @ A @ row)


def rigid(folder: Path, case: Case) -> dict[str, Any]:
    """The strike of rigid links: impulse [N s] beside 2 m v."""
    began, path = time.perf_counter(), path_of(folder, case.file)
    ground = mca.RigidPlane(point=(0.0, 0.0, case.ground), normal=(0.0, 0.0, 1.0))
    machine = mca.Robot(path, keyframe="home", against=(ground,), touch=(case.touch,), **case.start)
    swing = machine.swing()
    assert swing.touch is not None
    m, v = effective_mass(path, swing, case.touch), -float(swing.touch.velocity @ swing.touch.normal)
    duration = SPAN * math.pi * math.sqrt(m / STIFFNESS)
    phase = mca.ImpactPhase(duration=duration, output_interval=duration / 300)
    scene = free(machine.strike(impact=phase, swing=swing, stiffness=STIFFNESS))
    summary = mca.run(scene, device="cpu", precision="float64").summary
    J = sum(float(np.linalg.norm(pair["impulse"])) for pair in summary["contacts_by_pair"])
    found = {
        "t": swing.t_end,
        "v": v,
        "m": m,
        "impulse": J,
        "share": J / (2.0 * m * v),
        "error": summary["energy_error"],
    }
    return {"name": case.name, **found, "wall": round(time.perf_counter() - began, 1)}


def landing(path: Path) -> mca.Result:
    """Go2 lands on an aluminium shin."""
    ground = mca.RigidPlane(point=(0.0, 0.0, -0.15), normal=(0.0, 0.0, 1.0))
    aluminium = mca.J2Bilinear(E=70e9, nu=0.33, rho=2700.0, sigma_y=270e6, E_t=0.7e9)
    rod = mca.Rod(radius=0.008, length=0.213, section=2, ring=1, axial=16)
    shin = mca.Body(name="FL_calf", geometry=rod, material=aluminium, rotation=(0.0, math.pi / 2.0, 0.0))
    robot = mca.Robot(
        path,
        keyframe="home",
        ctrl=(0.0,) * 12,
        flexible={"FL_calf": shin},
        mounts={"FL_calf": "start"},
        against=(ground,),
        touch=("FL_calf",),
    )
    scene = robot.strike(impact=mca.ImpactPhase(duration=2e-3, output_interval=4e-6), mu=0.3)
    result = mca.run(scene, device="cpu")
    stress = result.summary["bodies"]["FL_calf"]["max_von_mises"]
    print(f"peak force {result.F_n.max():.0f} N, stress {stress['value'] / 1e6:.0f} MPa")
    return result


def flexible(folder: Path) -> dict[str, Any]:
    """The landing: its force [N], stress [Pa] and ledger [J]."""
    began = time.perf_counter()
    result = landing(path_of(folder, "go2.xml"))
    summary, own = result.summary, result.summary["bodies"]["FL_calf"]
    found = {"force": float(result.F_n.max()), "mises": own["max_von_mises"], "strain": own["max_plastic_strain"]}
    found |= {"energy": summary["energy"], "error": summary["energy_error"]}
    return {**found, "wall": round(time.perf_counter() - began, 1)}


def render(found: dict[str, Any]) -> str:
    """The page."""
    head = "| robot | touch after | at | effective mass | impulse | over 2 m v | energy error | wall time |"
    lines = [head, "|---|---|---|---|---|---|---|---|"]
    for row in found["rigid"]:
        figures = [f"{row['t']:.4f} s", f"{row['v']:.4f} m/s", f"{row['m']:.4f} kg", f"{row['impulse']:.4f} N s"]
        figures += [f"{row['share']:.4f}", f"{row['error']:.0e}", f"{row['wall']:.0f} s"]
        lines.append(f"| {row['name']} | {' | '.join(figures)} |")
    own, energy = found["flexible"], found["flexible"]["energy"]
    ledger = [f"{name.replace('_', ' ')} {value:.3g}" for name, value in energy.items() if abs(value) >= 5e-5]
    text = TEMPLATE.read_text(encoding="utf-8")
    for key, value in {
        "measured": measured(FILE.stem),
        "versions": found["versions"],
        "rigid": "\n".join(lines),
        "snippet": textwrap.dedent(inspect.getsource(landing).split("\n", 2)[2]).rstrip().rsplit("\n", 1)[0],
        "force": f"{own['force']:.0f}",
        "mises": f"{own['mises']['value'] / 1e6:.0f}",
        "ledger": ", ".join(ledger),
        "error": f"{own['error']:.0e}",
        "wall": f"{own['wall']:.0f}",
    }.items():
        text = text.replace("{" + key + "}", value)
    return text


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.public_robots")
    parser.add_argument("folder", type=Path, nargs="?", help="that holds the robots")
    parser.add_argument("--render", action="store_true", help="only write the page from the figures kept")
    args = parser.parse_args()
    if not args.render:
        if args.folder is None:
            parser.error("give the folder that holds the robots")
        versions = ", ".join(f"{name} {version(name.lower())}" for name in ("MuJoCo", "warp-lang"))
        found = {"rigid": [rigid(args.folder, case) for case in CASES], "flexible": flexible(args.folder)}
        FILE.write_text(json.dumps({"versions": versions, **found}, indent=1) + "\n", encoding="utf-8")
        note(FILE, "cpu")
    page = render(json.loads(FILE.read_text(encoding="utf-8")))
    (FOLDER / "public_robots.md").write_text(page, encoding="utf-8")
    print(page)


if __name__ == "__main__":
    main()
