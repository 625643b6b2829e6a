"""Tests the command line: what it prints, its exit status, and that a refused request leaves nothing behind."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.cli import main as cli
from warp_mca.cli.parser import make_parser
from warp_mca.cli.request import read_request
from warp_mca.cli.warp_start import start_warp
from warp_mca.results.result import HISTORY_COLUMNS
from warp_mca.results.storage import CONTACT_FILES, FILES, load
from warp_mca.scene import catalogue

SCENE = '''"""A block lands on a rigid floor."""
from typing import Annotated
import warp_mca as mca

PRESETS = {"tiny": {}, "fine": {"cells": 4}}

def build(
    *,
    v: Annotated[float, mca.Param("speed", unit="m/s")] = 1.0,
    cells: Annotated[int, mca.Param("cells along each edge", low=1)] = 2,
    E: Annotated[float, mca.Param("Young's modulus", unit="Pa")] = 1e9,
    nu: Annotated[float, mca.Param("Poisson's ratio")] = 0.3,
    E_t: Annotated[float, mca.Param("tangent modulus", unit="Pa")] = 1e8,
    thickness: Annotated[float, mca.Param("of the block", unit="m")] = 0.01,
    fault: Annotated[str, mca.Param("what is wrong", choices=("none", "joint", "inverted"))] = "none",
):
    material = mca.J2Bilinear(E=E, nu=nu, rho=1e3, sigma_y=1e8, E_t=E_t)
    geometry = mca.Box(size=(0.01, thickness, 0.01), divisions=(cells,) * 3)
    if fault == "inverted":
        good = geometry.build()
        geometry = mca.Mesh(good.points * [-1.0, 1.0, 1.0], good.hexahedra, good.node_sets, good.cell_sets)
    bodies = [mca.Body(name="block", geometry=geometry, material=material, velocity=(0.0, -v, 0.0))]
    joints = ()
    if fault == "joint":
        bodies.append(mca.Body(name="other", geometry=geometry, material=material, position=(1.0, 0.0, 0.0)))
        joints = (mca.Revolute(name="A", body="block", at=(0.0, 0.0, 0.0), other="other"),)
    return mca.Scene(
        name="landing", bodies=tuple(bodies), joints=joints,
        contacts=(mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane()),),
        impact=mca.ImpactPhase(duration=4e-5, energy_tolerance=0.05),
    )
'''


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Each test starts in an empty folder that holds one scene file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "landing.py").write_text(SCENE)
    return tmp_path


def contents(folder: Path) -> list[str]:
    """Names in the folder, without the scene file and Python's caches."""
    return sorted(path.name for path in folder.iterdir() if path.name not in ("landing.py", "__pycache__"))


def refused(capsys: pytest.CaptureFixture[str], *argv: str, status: int = 2) -> str:
    """The one line on stderr of a command that must fail with `status`."""
    assert cli.main(argv) == status
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1 and captured.err.endswith("\n"), captured.err
    assert captured.err.startswith("warp-mca")
    return captured.err


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["two_lnk"], ["'two_lnk'", "two_link"]),
        (["nowhere.py"], ["'nowhere.py'", "no such file"]),
        (["notes.txt"], ["'notes.txt'", "a Python file (.py)", "parts (.step,"]),
        (["."], ["'.'", "give a Python file (.py)"]),
        ([300 * "a"], ["the scenes are"]),
        (["nowhere.mca"], ["'nowhere.mca'", "no such file"]),
        (["two_link", "--preset", "fast"], ["preset = 'fast'", "quick"]),
        (["two_link", "--set", "muu=1"], ["'muu'", "did you mean mu?"]),
        (["two_link", "--set", "mu=-1"], ["mu = -1", "0 to 10"]),
        (["two_link", "--set", "mu=nan"], ["mu = 'nan'", "finite"]),
        (["two_link", "--set", "mu"], ["'mu'", "KEY=VALUE"]),
        (["two_link", "--set", "plate_height=-0.05"], ["plate_height = -0.05", "above 0"]),
        (["two_link", "--set", "E_body=-7e10"], ["E_body = -7", "above 0"]),
        (["two_link", "--set", "E_t_plate=7e10"], ["E_t = 7", "tangent modulus"]),
        (["two_link", "--set", "nu=0.5"], ["nu = 0.5", "-1 and 0.5"]),
        (["two_link", "--set", "H=5"], ["5", "reach"]),
        (["two_link", "--set", "length=1e-9"], ["H = 0.37", "2e-09 m below O"]),  # swings a million times otherwise
        (["two_link", "--out", ""], ["--out", "name a folder"]),
        (["two_link", "--device", "cuda:99"], ["device = 'cuda:99'", "cpu"]),
        (["two_link", "--precision", "float32"], ["float32", "mixed"]),
        (["two_link", "--duration", "soon"], ["--duration", "'soon'", "give a number without a unit, as 0.002"]),
        (["two_link", "--duration", "5ms"], ["'5ms'", "without a unit"]),
        (["two_link", "--threads", "2.5"], ["--threads", "'2.5'", "give a whole number"]),
        (["two_link", "--duration", "nan"], ["duration = nan"]),
        (["two_link", "--duration=-1"], ["duration = -1"]),
        (["two_link", "--time-step-scale", "2"], ["time_step_scale = 2", "0 to 1"]),
        (["landing.py", "--time-step-scale", "0"], ["time_step_scale = 0", "(0, 1]"]),
        (["single_rod", "--duration", "1e-5", "--set", "duration=2e-5"], ["--duration = 1e-05", "leave one of"]),
        (["single_rod", "--duration", "1e-5", "--sweep", "duration=1e-5,2e-5"], ["--duration", "leave one of the two"]),
        (["single_rod", "--frames", "5"], ["--frames = 5", "no file that is asked for has frames"]),
        (["single_rod", "--magnify", "5", "--rrd", "a.rrd"], ["--magnify = 5", "no picture or film"]),
        (["single_rod", "--set", "v=1e-28"], ["speed of the bodies = 1e-28", "motion of"]),
        (["two_link", "--viewer", "paraview"], ["'paraview'", "rerun"]),
        (["two_link", "--colour"], ["--colour"]),
        (["mesh.obj"], ["'mesh.obj'", "name a built-in scene or a Python file (.py)", "parts (.step,", "meshes (.msh"]),
        (["scene.PY"], ["'scene.PY'", "Python file (.py)"]),
        (["two.link"], ["did you mean two_link?"]),
        ([], ["SCENE"]),
        (["landing.py", "--set", "E=-1"], ["E = -1", "above 0"]),
        (["landing.py", "--set", "nu=0.5"], ["nu = 0.5", "(-1, 0.5)"]),
        (["landing.py", "--set", "E_t=1e9"], ["E_t = 1", "tangent modulus"]),
        (["landing.py", "--set", "thickness=-1"], ["size = -1", "above 0"]),
        (["landing.py", "--set", "fault=joint"], ["Revolute A"]),
        (["landing.py", "--set", "fault=inverted"], ["block", "inverted"]),
    ],
)
def test_bad_request_to_run(here: Path, capsys: pytest.CaptureFixture[str], settings: list[str], words: list[str]):
    line = refused(capsys, "run", *settings)
    assert all(word in line for word in words), line
    assert contents(here) == []


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["landing.py", "-o", "model.npz"], ["'model.npz'", ".mca"]),
        (["landing.py", "-o", "nowhere/model.mca"], ["nowhere", "folder"]),
        (["landing.py"], ["-o"]),
        (["model.mca", "-o", "other.mca"], ["'model.mca'", "built model"]),
        (["landing.py", "-o", "model.mca", "--set", "fault=joint"], ["Revolute A"]),
        (["landing.py", "-o", "model.mca", "--set", "fault=inverted"], ["inverted"]),
    ],
)
def test_bad_request_to_build(here: Path, capsys: pytest.CaptureFixture[str], settings: list[str], words: list[str]):
    line = refused(capsys, "build", *settings)
    assert all(word in line for word in words), line
    assert contents(here) == []


def test_unknown_command(capsys: pytest.CaptureFixture[str]):
    assert "'walk'" in refused(capsys, "walk")


def test_without_arguments_it_says_what_it_is(capsys: pytest.CaptureFixture[str]):
    assert cli.main([]) == 0
    assert "warp-mca run two_link" in capsys.readouterr().out


def test_version(capsys: pytest.CaptureFixture[str]):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"warp-mca {mca.__version__}\n"


def test_scenes_lists_presets_and_every_parameter(capsys: pytest.CaptureFixture[str]):
    assert cli.main(["scenes"]) == 0
    out = capsys.readouterr().out
    for name in catalogue.scene_names():
        source = catalogue.load_source(name)
        assert all(word in out for word in (name, *source.presets, *source.parameters))
    assert "0 to 10" in out and "kg/m^3" in out


def test_time_steps_of_any_scene_can_be_shortened(here: Path):
    """An option for all, though only some have it among their parameters, which then tell of it."""
    dts = []
    for scale in ("0.4", "0.2"):
        assert cli.main(["run", "landing.py", "--duration", "1e-5", "--time-step-scale", scale, "--out", scale]) == 0
        dts.append(load(scale).summary["dt"])
    assert dts[0] == pytest.approx(2.0 * dts[1], rel=0.1)  # whole numbers of steps in an interval
    request = read_request(make_parser().parse_args(["run", "two_link", "--time-step-scale", "0.4"]))
    assert request.scene.impact.time_step_scale == 0.4
    assert request.origin is not None and request.origin.parameters["time_step_scale"] == 0.4


def test_scenes_lists_a_file_too(capsys: pytest.CaptureFixture[str]):
    assert cli.main(["scenes", "landing.py"]) == 0
    assert "A block lands on a rigid floor." in capsys.readouterr().out


def test_a_run_writes_its_results_and_a_second_one_needs_force(here: Path, capsys: pytest.CaptureFixture[str]):
    assert cli.main(["run", "landing.py", "--duration", "2e-5"]) == 0
    out = capsys.readouterr().out
    assert contents(here) == ["landing-tiny"]
    assert contents(here / "landing-tiny") == sorted([*FILES, *CONTACT_FILES])
    assert "F_n peaks" in out and str(Path("landing-tiny", "history.csv")) in out
    result = load("landing-tiny")
    assert tuple(result.history)[: len(HISTORY_COLUMNS)] == HISTORY_COLUMNS
    assert result.summary["simulated_time"] == pytest.approx(2e-5)
    assert result.summary["parameters"]["cells"] == 2
    before = (here / "landing-tiny" / "history.csv").read_bytes()
    assert "--force" in refused(capsys, "run", "landing.py")
    assert cli.main(["run", "landing.py", "--duration", "2e-5", "--force"]) == 0
    assert (here / "landing-tiny" / "history.csv").read_bytes() == before


def test_a_built_model_runs_to_the_same_history(here: Path, capsys: pytest.CaptureFixture[str]):
    setting = ["--set", "v=2"]
    assert cli.main(["build", "landing.py", "-o", "model.mca", *setting]) == 0
    out = capsys.readouterr().out
    assert "min scaled Jacobian" in out and "1.000" in out and "smallest stable step" in out
    assert cli.main(["run", "model.mca", "--out", "a"]) == 0
    assert cli.main(["run", "landing.py", "--out", "b", *setting]) == 0
    assert (here / "a" / "history.csv").read_bytes() == (here / "b" / "history.csv").read_bytes()
    capsys.readouterr()
    assert "model file" in refused(capsys, "run", "model.mca", "--preset", "tiny", "--out", "c")
    assert "built-in" in refused(capsys, "run", "model.mca", "--set", "v=3", "--out", "c")


def test_a_built_in_model_takes_new_parameters_unless_they_change_the_mesh(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    assert cli.main(["build", "single_rod", "-o", "rod.mca"]) == 0
    scenes = []
    monkeypatch.setattr(mca, "run", lambda scene, **options: scenes.append((scene, options["meshes"])) or finished())
    assert cli.main(["run", "rod.mca", "--set", "v=3"]) == 0
    scene, meshes = scenes[0]
    assert scene.parameters["v"] == 3.0
    assert scene.bodies[0].velocity[0] == 3.0
    assert len(meshes["rod"].hexahedra) > 0
    capsys.readouterr()
    assert "build the model again" in refused(capsys, "run", "rod.mca", "--set", "radius=0.01")


def finished(**figures: object) -> mca.Result:
    """A run without contact, for tests that are about something else."""
    from warp_mca.results.result import summarise

    history = {name: np.zeros(10) for name in HISTORY_COLUMNS} | {"time_s": np.arange(1, 11) * 1e-6}
    facts = dict(
        scene="none",
        n_elements=1,
        n_nodes=8,
        dt=1e-7,
        n_steps=100,
        simulated_time=1e-5,
        wall={"fe": 1.0},
        device="cpu",
        precision="mixed",
        element="hex8",
        energy_error=0.0,
        energy={},
        max_plastic_strain=0.0,
    )
    return mca.Result({**summarise(history, facts), **figures}, history, None, ("mind the gap",))


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (mca.GuardError("the energy balance\nis off by 3 %"), 1, "balance is off by 3 %"),
        (KeyboardInterrupt(), 130, "interrupted before it was done"),
        (MemoryError(), 2, "does not fit into this machine's memory"),
        (
            RuntimeError("Graph launch error: Warp CUDA error 719: failure"),
            1,
            "the GPU failed (Graph launch error: Warp",
        ),
    ],
)
def test_exit_status_of_a_run_that_stops(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, error: BaseException, status: int, words: str
):
    def stop(*args: object, **options: object) -> None:
        raise error

    monkeypatch.setattr(mca, "run", stop)
    assert words in refused(capsys, "run", "landing.py", status=status)


def test_a_run_that_is_terminated_clears_away_what_is_half_written(here: Path):
    """Batch systems send SIGTERM; it left folders that a final state and results are written in at first."""
    command = """
import os, signal, sys
import meshio, warp_mca.recorders.mesh_file as mesh_file
from warp_mca.cli import main as cli
from warp_mca.cli.parser import make_parser
whole = mesh_file._write
def write(path, mesh):
    whole(path, mesh)
    if path.parent.parent.name == "there":
        os.kill(os.getpid(), signal.SIGTERM)
mesh_file._write = write
sys.exit(cli.main(["run", "landing.py", "--duration", "1e-5", "--out", "there/out", "--final", "there/a.vtu"]))
"""
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True)
    assert done.returncode == 143 and done.stderr.splitlines()[-1].endswith("terminated before it was done"), (
        done.stderr
    )
    assert contents(here) == []


def test_warnings_are_shown(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(mca, "run", lambda scene, **options: finished())
    assert cli.main(["run", "landing.py"]) == 0
    assert "warning: mind the gap" in capsys.readouterr().out


def test_as_a_program_it_says_what_runs_on_stderr_and_shows_no_progress_bar(here: Path):
    command = [sys.executable, "-m", "warp_mca", "run", "landing.py"]
    bad = subprocess.run([*command, "--device", "cuda:99"], capture_output=True, text=True)
    assert (bad.returncode, bad.stdout, bad.stderr.count("\n")) == (2, "", 1), bad.stderr
    good = subprocess.run(command, capture_output=True, text=True)
    assert good.returncode == 0
    assert re.fullmatch(r"\w+: [\d,]+ elements, [\d,]+ steps of .* s, set by .*; about .* s on cpu, .*\n", good.stderr)
    json.loads((here / "landing-tiny" / "summary.json").read_text())


@pytest.mark.parametrize(("arguments", "frozen"), [("", "True"), ("['--version']", "False")], ids=["program", "call"])
def test_only_a_program_ends_without_looking_for_garbage(arguments: str, frozen: str):
    """What is registered first runs last."""
    code = "import atexit, gc, sys; from warp_mca.cli import main as cli; sys.argv[1:] = ['--version'];"
    code += f"atexit.register(lambda: print(gc.get_freeze_count() > 0)); cli.main({arguments})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == frozen


def test_modules_are_imported_while_warp_starts(here: Path, monkeypatch: pytest.MonkeyPatch):
    import warp

    (here / "needed_next.py").touch()
    monkeypatch.syspath_prepend(here)
    found = []

    def driver() -> None:
        end = time.monotonic() + 10.0
        while "needed_next" not in sys.modules and time.monotonic() < end:
            time.sleep(0.01)
        found.append("needed_next" in sys.modules)

    monkeypatch.setattr(warp, "init", driver)
    start_warp("needed_next", "no_such_module")
    assert found == [True]


def test_every_recorder_has_its_option(here: Path, capsys: pytest.CaptureFixture[str]):
    files = ["a.rrd", "a.usdc", "a.vtkhdf", "a.vtu"]
    options = ["--rrd", "a.rrd", "--usd", "a.usdc", "--vtkhdf", "a.vtkhdf", "--final", "a.vtu", "--frames", "3"]
    assert cli.main(["run", "landing.py", "--duration", "1e-5", *options, "--snapshot", "4e-6"]) == 0
    out = capsys.readouterr().out
    assert contents(here) == sorted([*files, "landing-tiny"])
    assert all(f"wrote {file}" in out for file in (*files, Path("landing-tiny", "snapshot-4us.png")))
    assert (here / "landing-tiny" / "snapshot-4us.png").is_file()


def test_each_file_of_an_option_given_twice_is_written(here: Path, capsys: pytest.CaptureFixture[str]):
    """The last one alone was."""
    options = [word for name in ("a.vtu", "b.vtk") for word in ("--final", name)] + ["--rrd", "a.rrd", "--rrd", "b.rrd"]
    assert cli.main(["run", "landing.py", "--duration", "1e-6", *options]) == 0
    assert contents(here) == ["a.rrd", "a.vtu", "b.rrd", "b.vtk", "landing-tiny"]
    capsys.readouterr()
    line = refused(capsys, "run", "landing.py", "--out", "c", "--final", "c.vtu", "--final", "c.vtu")
    assert "two outputs write this file" in line


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--rrd", "a.txt"], ["rrd = 'a.txt'", ".rrd"]),
        (["--usd", "landing.py/a.usdc"], ["usd = ", "not a folder"]),
        (["--vtkhdf", "a.vtu"], ["vtkhdf = 'a.vtu'", ".vtkhdf"]),
        (["--final", "a.stl"], ["final = 'a.stl'"]),
        (["--frames", "1", "--rrd", "a.rrd"], ["frames = 1", "at least 2"]),
        (["--snapshot", "-1"], ["snapshot = -1", "from 0 s on"]),
        (["--snapshot", "5"], ["snapshot-5s.png = 5", "the run ends at"]),
    ],
)
def test_a_recorder_that_cannot_write_is_refused(
    here: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: list[str]
):
    line = refused(capsys, "run", "landing.py", *options)
    assert all(word in line for word in words), line
    assert contents(here) == []


def test_the_help_of_run_has_an_example_for_each_purpose(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("COLUMNS", "400")
    assert cli.main(["run", "--help"]) == 0
    examples = [
        line.split("warp-mca ")[1].split(";")[0] for line in capsys.readouterr().out.splitlines() if "as in" in line
    ]
    assert len(examples) == 7
    for example in examples:
        assert make_parser().parse_args(example.replace("…", "two_link").split()).scene in ("two_link", "part.step")


def test_view_without_a_recording(capsys: pytest.CaptureFixture[str]):
    assert "--rrd" in refused(capsys, "view", "nowhere")


LONG = 300 * "a"


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "landing.py", "--out", LONG],
        ["run", f"{LONG}.py"],
        ["run", f"{LONG}.mca"],
        ["run", "landing.py", "--rrd", f"{LONG}.rrd"],
        ["build", "landing.py", "-o", f"{LONG}.mca"],
        ["view", LONG],
    ],
)
def test_a_name_that_is_too_long_is_refused(capsys: pytest.CaptureFixture[str], arguments: list[str]):
    assert "too long" in refused(capsys, *arguments)


def test_verify_looks_at_its_folder_first(capsys: pytest.CaptureFixture[str]):
    assert "out = 'landing.py'" in refused(capsys, "verify", "rod_on_wall", "--out", "landing.py")


def shell(command: str, **environment: str) -> tuple[int, str]:
    """Exit status and standard error of a shell command, in which `mca` is the program."""
    program = f'mca() {{ {sys.executable} -m warp_mca "$@"; }}; '
    done = subprocess.run(
        ["bash", "-c", program + command], capture_output=True, text=True, env=os.environ | environment
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("command", "status", "words"),
    [
        ("mca scenes >&-", 0, ""),
        ("mca scenes 2>&- <&-", 0, ""),
        ("mca scenes | true; exit ${PIPESTATUS[0]}", 141, ""),
        ("mca | true; exit ${PIPESTATUS[0]}", 141, ""),
        ("mca scenes > /dev/full", 2, "standard output: No space left"),
        ("PYTHONIOENCODING=ascii mca run --help", 0, ""),
        ("mkdir gone; cd gone; rmdir ../gone; mca run two_link", 2, "working directory is gone"),
        ("WARP_CACHE_PATH=/proc/x mca run landing.py", 2, "WARP_CACHE_PATH = '/proc/x'"),
    ],
)
def test_streams_and_folders_that_are_not_there(command: str, status: int, words: str):
    found, error = shell(command)
    assert (found, error.count("\n")) == (status, 1 if words else 0), error
    assert words in error


def test_a_matplotlib_backend_of_another_environment_is_left_alone(here: Path):
    found, error = shell("mca run landing.py --out there", MPLBACKEND="module://of.a.notebook")
    assert found == 0 and "backend" not in error
    assert (here / "there" / "forces.png").is_file()
