"""Drop tests: poses, floors, the speed of the fall; from a STEP file to a verdict, in Python and by a command."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import write_parts, write_phone

import warp_mca as mca
from warp_mca.base.rotation import rotation_matrix
from warp_mca.cli.main import main
from warp_mca.results.storage import load

STEEL = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=250e6, E_t=1e9)
HEAVY, LIGHT = dataclasses.replace(STEEL, rho=9000.0), dataclasses.replace(STEEL, rho=3000.0)
HEIGHT = 1.2
BRICK = mca.Box(size=(0.04, 0.02, 0.01), divisions=(4, 2, 1))


def pair() -> tuple[mca.Body, mca.Body]:
    """Two bricks beside each other, turned and moved, of different weight: 40 x 40 x 10 mm, heavier on one side."""
    turned: dict[str, Any] = {"rotation": (0.0, 0.0, 0.5 * math.pi), "position": (1.0, 2.0, 3.0)}
    heavy = mca.Body(name="heavy", geometry=BRICK, material=HEAVY, **turned)
    light = dataclasses.replace(BRICK, origin=(0.0, 0.02, 0.0))
    return heavy, mca.Body(name="light", geometry=light, material=LIGHT, **turned)


def places(scene: mca.Scene) -> dict[str, np.ndarray]:
    """Nodes of each body at the start [m]."""
    meshes = mca.mesh(scene)
    return {
        body.name: meshes[body.name].points @ rotation_matrix(np.array(body.rotation)).T + np.array(body.position)
        for body in scene.bodies
    }


@pytest.mark.parametrize("pose", mca.POSES)
def test_a_pose_brings_its_side_down_below_the_centre_of_mass(pose: str):
    scene = mca.drop_test(pair(), height=HEIGHT, pose=pose)
    found = places(scene)
    points = np.concatenate(list(found.values()))
    low = points[points[:, 2] < points[:, 2].min() + 1e-9]
    assert low[:, 2].min() == pytest.approx(1e-6, abs=1e-12)
    centre = sum(weight * found[name].mean(axis=0) for name, weight in (("heavy", 0.75), ("light", 0.25)))
    kind = len(pose.split("-"))  # 1: a face of many nodes, 2: an edge, 3: a corner
    assert np.linalg.matrix_rank(low - low[0], tol=1e-6) == 3 - kind
    if kind > 1:  # the edge or the corner lies right below the centre
        away, along = (centre - low[0])[:2], (low[np.linalg.norm(low - low[0], axis=1).argmax()] - low[0])[:2]
        if kind == 2:
            away = away - along * (away @ along) / (along @ along)
        assert np.abs(away).max() < 1e-9
    for body in scene.bodies:
        assert body.velocity == pytest.approx((0.0, 0.0, -math.sqrt(2.0 * 9.81 * HEIGHT)))
    assert np.linalg.norm(found["light"][0] - found["heavy"][-1]) == pytest.approx(
        np.linalg.norm(np.array((-0.04, 0.0, -0.01))), rel=1e-9
    )


def test_sides_are_those_of_the_parts_as_they_are_given():
    """Of the two bricks, turned by a quarter, the light one lies at least x."""
    for pose, lowest in (("xmin", "light"), ("xmax", "heavy")):
        found = places(mca.drop_test(pair(), height=HEIGHT, pose=pose))
        heights = {name: points[:, 2].mean() for name, points in found.items()}
        assert min(heights, key=heights.get) == lowest  # pyright: ignore[reportArgumentType, reportCallIssue]


def test_angles_turn_about_x_then_about_y():
    scene = mca.drop_test(mca.Body(name="a", geometry=BRICK, material=STEEL), height=HEIGHT, pose="90/30")
    turned = rotation_matrix(np.array(scene.bodies[0].rotation))
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    assert turned @ (0.0, 1.0, 0.0) == pytest.approx((s, 0.0, c))
    assert turned @ (1.0, 0.0, 0.0) == pytest.approx((c, 0.0, -s))


def test_a_real_floor_takes_the_force_of_its_impedance():
    """A plate of steel meets floors flat: until waves come back, the force is that of a rigid floor times
    Z_f / (Z + Z_f); springs of the contact make it rise to that, waves from the edges beyond."""
    steel, concrete = mca.library.STRUCTURAL_STEEL, mca.library.CONCRETE_C30
    plate = mca.Box(size=(0.1, 0.1, 0.05), divisions=(8, 8, 10))
    body = mca.Body(name="plate", geometry=plate, material=steel)
    impact = mca.ImpactPhase(duration=9e-6, output_interval=0.5e-6)
    force = {}
    for onto in ("rigid", "steel", "concrete"):
        result = mca.run(mca.drop_test(body, height=HEIGHT, onto=onto, refine=2.0, impact=impact), device="cpu")
        force[onto] = result.F_n[12:18].sum()
    Z, Z_f = (material.rho * material.wave_speeds["dilatational"] for material in (steel, concrete))
    assert force["steel"] / force["rigid"] == pytest.approx(0.5, rel=0.1)
    assert force["concrete"] / force["rigid"] == pytest.approx(Z_f / (Z + Z_f), rel=0.1)


REFUSED = [
    ({"pose": "top"}, "drop_test.pose = 'top': choose face, edge, corner, one of POSES, as xmin"),
    ({"pose": "a/b"}, "or two angles, as 30/45"),
    ({"pose": 3}, "drop_test.pose"),
    ({"onto": "sand"}, "choose rigid, steel, concrete, wood"),
    ({"height": 0.0}, "drop_test.height"),
    ({"parts": ()}, "give at least one body"),
    ({"parts": (BRICK,)}, "drop_test.parts"),
    ({"bodies": ()}, "drop_test makes it"),
]


@pytest.mark.parametrize("onto", ["rigid", "wood"])
def test_the_force_is_that_of_the_floor(onto: str):
    """It takes the momentum of parts on each other, whose contact bears a force as great; in any step, too."""
    low, high = (
        mca.Box(size=(0.02, 0.02, 0.01), divisions=(n, n, 2), origin=(0.0, 0.0, z)) for n, z in ((4, 0), (3, 0.01))
    )
    parts = [mca.Body(name=name, geometry=box, material=STEEL) for name, box in (("low", low), ("high", high))]
    impact = mca.ImpactPhase(duration=1e-5, output_interval=1e-7)
    scene = mca.drop_test(parts, height=0.5, onto=onto, contacts=(mca.ContactAll(),), impact=impact)
    result = mca.run(scene, figures="none")
    among, floor, *_ = result.contacts
    assert floor.name.startswith("low") and among.pressure.max() > 0.3 * floor.pressure.max()
    np.testing.assert_allclose(result.F_n, floor.pressure, atol=1e-4 * result.F_n.max())
    assert result.summary["extremes"]["F_n_max"] == pytest.approx(result.F_n.max(), rel=0.02)


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_what_no_drop_can_mean_is_refused(number: int):
    changes, words = REFUSED[number]
    with pytest.raises(mca.RequestError, match=words):
        mca.drop_test(**{"parts": pair(), "height": HEIGHT, **changes})


def test_from_a_step_file_to_a_verdict_over_poses(tmp_path: Path):
    """In less than 25 lines: glued, tied, screwed and loose parts, two of them instances of one."""
    phone = mca.Assembly(
        write_phone(tmp_path),
        size=8e-3,
        materials={"*": mca.library.POLYCARBONATE, "shell": mca.library.ABS},
        join={("board", "chip*"): "glue", ("shell", "glass"): "tie"},
    )
    ends: dict[str, Any] = {"at": (7.5e-3, 5e-3, 3e-3), "other_at": (7.5e-3, 5e-3, 0.0), "reach": 6e-3}
    board = "board+chip+chip_2"
    screw = mca.Bolt(name="screw", body=board, other="shell", **ends, diameter=1.6e-3, preload=50.0)
    scenes = [
        mca.drop_test(
            phone,
            height=HEIGHT,
            pose=pose,
            loads=(screw,),
            impact=mca.ImpactPhase(duration=4e-6, output_interval=0.5e-6),
            criteria=("max_von_mises(shell) < 20e6", "max_shear(screw) < 1e3"),
        )
        for pose in ("face", "corner")
    ]
    rows = mca.sweep(scenes, workers=1)
    worst = {entry["figure"]: entry for entry in mca.worst(rows)}
    assert [row["pose"] for row in rows] == ["face", "corner"]
    assert {row["status"] for row in rows} <= {"done", "criterion"}
    shell = [row["bodies.shell.max_von_mises.value"] for row in rows]
    assert [row["status"] for row in rows] == ["done" if value < 20e6 else "criterion" for value in shell]
    assert worst["shell.max_von_mises"]["value"] == max(shell)
    assert worst["shell.max_von_mises"]["parameters"] == {"pose": rows[int(np.argmax(shell))]["pose"]}
    assert worst["F_n_max"]["value"] == max(row["F_n_max"] for row in rows) > 0.0
    assert {name.split(".")[0] for name in worst} >= {"shell", board, "F_n_max"}
    assert min(row["bolts.screw.max_force.value"] for row in rows) > 49.9


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the files of a bracket, from which commands start."""
    write_parts(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


QUICK = ["--duration", "1e-6", "--set", "across=0.5", "--set", "struck=off"]


def test_a_command_runs_a_drop(folder: Path):
    words = ["--onto", "wood", "--pose", "corner", *QUICK, "--set", "penalty=2"]
    assert main(["run", "part.step", "--height", "1.2", *words]) == 0
    result = load("part-drop")
    given = {"height": 1.2, "onto": "wood", "pose": "corner"}
    assert {name: result.summary["parameters"][name] for name in given} == given
    assert sorted(result.summary["bodies"]) == ["floor", "part"]


def test_a_command_runs_all_poses_and_names_the_worst(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(mca, "POSES", ("zmin", "xmin-zmin"))
    monkeypatch.setattr("warp_mca.studies.sweep.worker_count", lambda options, workers, devices: 1)
    words = ["run", "part.step", "--pose", "all", "--duration", "2e-6", *QUICK[2:], "--threads", "1"]
    assert main([*words, "--out", "poses"]) == 0
    out = capsys.readouterr().out
    assert "worst" in out and "pose=zmin" in out
    rows = [json.loads((folder / "poses" / str(k) / "summary.json").read_text()) for k in range(2)]
    assert [row["parameters"]["pose"] for row in rows] == ["zmin", "xmin-zmin"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["part.step", "--height", "-1"], "height = -1.0: give a finite number [m], above 0"),
        (["part.step", "--onto", "sand"], "onto = 'sand': choose rigid or steel or concrete or wood"),
        (["part.step", "--pose", "top"], "drop_test.pose = 'top'"),
        (["part.step", "--height", "1", "--set", "penalty=x"], "penalty = 'x': give a finite number, above 0 or auto"),
        (["part.step", "--height", "1", "--set", "height=2"], "it is given as height=2, too"),
        (
            ["part.step", "--height", "1", "--checkpoint", "30w"],
            "print a scene with 'warp-mca run part.step > drop.py'",
        ),
        (["part.step", "--pose", "all", "--figures", "none"], "--pose = 'all': its runs draw all figures"),
        (["two_link", "--height", "1"], "it is for parts (.step, .msh, ...)"),
    ],
)
def test_commands_that_no_drop_can_follow_are_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
):
    assert main(["run", *words]) == 2
    assert told in capsys.readouterr().err
    assert not [path for path in folder.iterdir() if path.is_dir()]


def test_words_of_a_file_are_no_code_of_its_script(folder: Path, capsys: pytest.CaptureFixture[str]):
    """The command also runs the script."""
    odd = (folder / "part.key").rename(folder / 'odd"""; x = 1\n.key')
    assert main(["run", odd.name]) == 0
    out = capsys.readouterr().out
    assert out.startswith('"""odd___; x = 1_.key falls on a floor."""\n')
    compile(out, "script", "exec")


def test_the_script_of_an_assembly_lists_what_it_holds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    assert main(["run", str(write_phone(tmp_path))]) == 0
    out = capsys.readouterr().out
    assert "#   glass (0.24 cm^3)" in out and "#   shell and battery overlap by 1e-05 m at" in out
    Path("phone_drop.py").write_text(out[out.index('"""') :])
    scene = mca.make_scene("phone_drop.py", height=HEIGHT, pose="edge", material="ABS", across=0.3)
    assert len(scene.bodies) == 6 and all(body.material == mca.library.ABS for body in scene.bodies)
    assert scene.parameters["height"] == HEIGHT


MILLI = "SI_UNIT(.MILLI.,.METRE.)"
INCH = """( CONVERSION_BASED_UNIT('INCH',#9002) LENGTH_UNIT() NAMED_UNIT(#9003) );
#9001 = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );
#9002 = LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#9001);
#9003 = DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);"""


@pytest.mark.parametrize(
    ("name", "old", "new", "unit"),
    [
        ("part.step", "", "", 1e-3),
        ("part.step", MILLI, "SI_UNIT($,.METRE.)", 1.0),
        ("part.step", f"( LENGTH_UNIT() NAMED_UNIT(*) {MILLI} );", INCH, 0.0254),
        ("part.iges", "2,2HMM", "1,2HIN", 0.0254),
    ],
)
def test_a_script_says_the_size_of_a_file_that_names_its_unit(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str, old: str, new: str, unit: float
):
    text = (folder / name).read_text()
    assert old in text
    (folder / name).write_text(text.replace(old, new, 1))
    assert main(["run", name]) == 0
    out, err = capsys.readouterr()
    size = " x ".join(f"{side * unit:.3g}" for side in (40.0, 20.0, 40.0))
    assert f"  # {size} m, by the unit that the file names\n" in out and f"{name} is {size} m" in err
    Path("drop.py").write_text(out)
    (points,) = (mesh.points for mesh in mca.mesh(mca.make_scene("drop.py")).values())
    assert np.ptp(points, axis=0) == pytest.approx([40.0 * unit, 20.0 * unit, 40.0 * unit])


def test_the_unit_of_a_file_that_names_none_is_told_and_can_be_given(folder: Path, capsys: pytest.CaptureFixture[str]):
    words = ["run", "part.stl", "--height", "1", *QUICK]
    assert main([*words, "--quiet", "--out", "guess"]) == 0
    told = "part.stl is 0.04 x 0.02 x 0.04 m, taken as millimetres since the file names no unit; --set scale="
    assert told in capsys.readouterr().err
    assert main([*words, "--set", "scale=0.0254", "--quiet", "--out", "inches"]) == 0
    assert "names no unit" not in capsys.readouterr().err
    guess, inches = (load(name).summary["bodies"]["part"]["mass"] for name in ("guess", "inches"))
    assert inches == pytest.approx(25.4**3 * guess, rel=1e-6)
