"""Criteria of a scene: how they read, what they hold against a run, and the exit status they give."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.results.criteria import with_verdict
from warp_mca.scene import model_file
from warp_mca.scene.criteria import read_criterion

SCENE = '''
import warp_mca as mca

STEEL = mca.J2Bilinear(E=200e9, nu=0.3, rho=7800.0, sigma_y=300e6, E_t=2e9)


def build(v: float = 2.0) -> mca.Scene:
    """A cube of steel strikes a wall."""
    cube = mca.Body(
        name="cube",
        geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2)),
        material=STEEL,
        velocity=(-v, 0.0, 0.0),
    )
    wall = mca.RigidPlane(point=(0.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0))
    return mca.Scene(
        name="cube",
        bodies=(cube,),
        contacts=(mca.Contact(name="wall", slave=mca.Surface(body="cube", nodes="xmin"), master=wall),),
        probes=(mca.Probe(name="top", body="cube", nodes="xmax"),),
        impact=mca.ImpactPhase(duration=1e-5, output_interval=1e-6),
    )
'''


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("criteria") / "cube.py"
    file.write_text(SCENE)
    return file


@pytest.fixture(scope="module")
def scene() -> mca.Scene:
    space: dict = {}
    exec(SCENE, space)
    return space["build"]()


@pytest.fixture(scope="module")
def result(scene: mca.Scene) -> mca.Result:
    return mca.run(scene, device="cpu")


def test_a_criterion_reads_as_written():
    found = read_criterion(" max_von_mises( left – right ) <= 6e7")
    assert (found.figure, found.of, found.relation, found.limit) == ("max_von_mises", "left – right", "<=", 6e7)
    assert found.met(6e7) and not found.met(6.1e7) and not found.met(None)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("max_von_mises(cube) is small", "write FIGURE"),
        ("stress(cube) < 1e6", "choose among max_von_mises"),
        ("max_von_mises(cube) < 60MPa", "SI units"),
        ("max_von_mises(cube) < nan", "SI units"),
        ("max_von_mises(ball) < 1e6", "choose among cube"),
        ("acceleration_cfc_max(top) < 1e6", "nothing in the scene has"),
        ("F_n_max(wall) < 1e6", "leave the name out"),
        (5, "write FIGURE"),
    ],
)
def test_what_no_run_could_tell_is_refused(scene, text, words):
    with pytest.raises(mca.RequestError, match=words):
        replace(scene, criteria=(text,))


def test_a_verdict_names_what_decided_and_its_place(scene, result):
    """Without a name the worst of all bodies decides; a lower limit asks for the least."""
    texts = (
        "max_von_mises < 1",
        "max_von_mises(cube) > 1e6",
        "F_n_max < 1e9",
        "acceleration_max(top) < 1",
        "F_max > 1",
    )
    replace(scene, criteria=texts)
    found = with_verdict(result, texts).summary["criteria"]
    assert [item["met"] for item in found] == [False, True, True, False, True]
    peak = result.summary["bodies"]["cube"]["max_von_mises"]
    assert found[0] == {"criterion": texts[0], "met": False, "of": "cube", **peak}
    assert found[3]["value"] == result.summary["probes"][0]["acceleration_max"] and found[3]["time"] > 0.0
    assert found[4]["of"] == "wall" and found[4]["value"] == pytest.approx(result.F_n.max())
    assert "criteria" not in result.summary


def test_a_figure_that_the_run_lacks_meets_nothing(result):
    """The first peak of a force that has none is null."""
    none = replace(result, summary={**result.summary, "F_n_first_peak": None})
    (found,) = with_verdict(none, ("F_n_first_peak < 1e9",)).summary["criteria"]
    assert found["met"] is False and found["value"] is None


def test_the_command_exits_with_3_where_one_does_not_hold(scene_file, tmp_path, capsys):
    """Files are written all the same; a criterion that holds leaves the status 0, one that cannot be read 2."""
    out = tmp_path / "out"
    command = ["run", str(scene_file), "--out", str(out), "--force"]
    assert main([*command, "--criterion", "max_von_mises(cube) < 1e9", "--criterion", "F_n_max < 1"]) == 3
    assert "F_n_max < 1: not met" in capsys.readouterr().err
    assert [item["met"] for item in json.loads((out / "summary.json").read_text())["criteria"]] == [True, False]
    assert main([*command, "--criterion", "max_von_mises(cube) < 1e9"]) == 0
    assert main([*command, "--criterion", "max_von_mises(cub) < 1e9"]) == 2


def test_a_sweep_says_which_runs_do_not_meet_theirs(scene_file, tmp_path):
    """Rows keep their figures, with the status criterion; stopped runs would win."""
    command = ["sweep", str(scene_file), "--grid", "v=0.5,2.0", "--out", str(tmp_path / "table")]
    assert main([*command, "--criterion", "max_von_mises < 50e6"]) == 3
    with (tmp_path / "table" / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows] == ["done", "criterion"] and all(float(row["F_n_max"]) > 0.0 for row in rows)


def test_batches_and_model_files_keep_them(scene, tmp_path):
    texts = ("F_n_max < 1",)
    own = replace(scene, criteria=texts)
    model_file.save(tmp_path / "cube.mca", own, {"cube": own.bodies[0].geometry.build()})
    assert model_file.load(tmp_path / "cube.mca").scene.criteria == texts
    other = replace(scene, criteria=("F_n_max < 1e9",))
    found = mca.run_batch([replace(scene, criteria=texts), other], device="cpu")
    assert [item.summary["criteria"][0]["met"] for item in found] == [False, True]
