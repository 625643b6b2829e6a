"""Criteria of a scene: how they read, what they hold against a run, and the exit status they give."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, filtfilt
from test_report import Page

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.cli.parser import make_parser
from warp_mca.cli.resume import _words, command_of
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
        ("acceleration_max(top, cfc=soft) < 1e6", "give 60, 180, 600 or 1000 Hz"),
        ("acceleration_max(top, cfc=1e6) < 1e6", "output_interval of 1e-07 s at most"),
        ("velocity_max(top, cfc=180) < 1.0", "cfc= filters acceleration_max only"),
        ("energy_share < 0.1", "name the energy in brackets: kinetic, elastic"),
        ("energy_share(heat) < 0.1", "choose among kinetic, elastic"),
        ("max_force < 1.0", "nothing in the scene has max_force"),
        ("failed(wall) < 1", "nothing in the scene has failed"),
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
    margin = 1.0 - peak["value"]
    assert found[0] == {"criterion": texts[0], "met": False, "of": "cube", **peak, "limit": 1.0, "margin": margin}
    assert found[1]["margin"] == pytest.approx(peak["value"] / 1e6 - 1.0)
    assert found[3]["value"] == result.summary["probes"][0]["acceleration_max"] and found[3]["time"] > 0.0
    assert found[4]["of"] == "wall" and found[4]["value"] == pytest.approx(result.F_n.max())
    assert "criteria" not in result.summary


def test_acceleration_is_filtered_by_the_class_of_the_criterion(scene, result):
    """The filter written out: two passes of a Butterworth filter of second order, before the first row at rest."""
    probe, cfc = result.probes[0], 10_000.0
    raw = np.gradient(probe.velocity[:, 0], probe.time)  # another difference: the filter leaves little of what differs
    text = "acceleration_max(top, cfc=10000) < 1"
    (found,) = with_verdict(result, (text,)).summary["criteria"]
    replace(scene, criteria=(text, "acceleration_max(cfc=10000) < 1"))
    b, a = butter(2, 2.0775 * cfc, fs=1e6)
    mirrored = np.concatenate([np.full(60, raw[0]), raw, raw[-2::-1]])
    smooth = filtfilt(b, a, mirrored, padlen=0)[60 : 60 + len(raw)]
    assert found["of"] == "top" and found["value"] == pytest.approx(np.abs(smooth).max(), rel=0.05)
    assert found["value"] < 0.7 * result.summary["probes"][0]["acceleration_max"]


def test_energy_shares_are_those_of_the_history(scene, result):
    texts = ("energy_share(kinetic) < 1", "energy_share(elastic) < 1")
    replace(scene, criteria=texts)
    kinetic, elastic = with_verdict(result, texts).summary["criteria"]
    before = 0.5 * 7800.0 * 0.01**3 * 2.0**2  # of the cube [J]
    assert kinetic["value"] == pytest.approx(result["E_kinetic"][-1] / before, rel=1e-6)
    assert elastic["value"] == pytest.approx((result["E_internal"] - result["E_plastic"])[-1] / before, rel=2e-3)


def test_a_joint_of_whole_bodies_has_its_greatest_force():
    """A rigid body on a weld under gravity: the joint carries its weight in every row."""
    body = mca.Body(name="a", rigid=True, mass=2.0, inertia=(0.1, 0.2, 0.25))
    weld = mca.Weld(name="W", body="a")
    texts = ("max_force(W) < 19", "max_moment(W) <= 1e-9")
    scene = mca.Scene(
        name="hung",
        bodies=(body,),
        joints=(weld,),
        gravity=(0.0, -9.81, 0.0),
        impact=mca.ImpactPhase(duration=1e-4, output_interval=1e-5),
        criteria=texts,
    )
    result = mca.run(scene, device="cpu")
    force, moment = result.summary["criteria"]
    rows = np.linalg.norm([result[f"joint_W_F{axis}_N"] for axis in "xyz"], axis=0)
    assert not force["met"] and force["value"] == rows.max() == pytest.approx(2.0 * 9.81, rel=1e-6)
    assert moment["met"] and force["of"] == "W" and "unit" not in force


def test_a_figure_that_the_run_lacks_meets_nothing(result):
    """The first peak of a force that has none is null."""
    none = replace(result, summary={**result.summary, "F_n_first_peak": None})
    (found,) = with_verdict(none, ("F_n_first_peak < 1e9",)).summary["criteria"]
    assert found["met"] is False and found["value"] is None


def test_the_command_exits_with_3_where_one_does_not_hold(scene_file, tmp_path, capsys):
    """Files are written all the same; a criterion that holds leaves the status 0, one that cannot be read 2."""
    out = tmp_path / "out"
    command = ["run", str(scene_file), "--out", str(out), "--force"]
    assert main([*command, "--json", "--criterion", "max_von_mises(cube) < 1e9", "--criterion", "F_n_max < 1"]) == 3
    said, told = capsys.readouterr()
    assert "F_n_max < 1: not met" in told
    assert json.loads(said) == json.loads((out / "summary.json").read_text())
    assert [item["met"] for item in json.loads(said)["criteria"]] == [True, False]
    assert main([*command, "--quiet", "--criterion", "max_von_mises(cube) < 1e9"]) == 0
    said, told = capsys.readouterr()
    assert said == "" and all(line.startswith("warning: ") for line in told.splitlines())
    assert main([*command, "--criterion", "max_von_mises(cub) < 1e9"]) == 2


def test_a_run_that_goes_on_keeps_them(scene_file):
    words = ["run", str(scene_file), "--checkpoint", "10", "--criterion", "F_n_max < 1", "--criterion", "F_max > 2"]
    stored = command_of(make_parser().parse_args(words))
    assert {"--criterion=F_n_max < 1", "--criterion=F_max > 2", "--checkpoint=10"} <= {*_words(stored, Path())}


def test_a_sweep_says_which_runs_do_not_meet_theirs(scene_file, tmp_path):
    """Rows keep their figures, with the status criterion; stopped runs would win."""
    command = ["sweep", str(scene_file), "--grid", "v=0.5,2.0", "--folders", "--out", str(tmp_path / "table")]
    assert main([*command, "--criterion", "max_von_mises < 50e6"]) == 3
    with (tmp_path / "table" / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows] == ["done", "criterion"] and all(float(row["F_n_max"]) > 0.0 for row in rows)
    stored = json.loads((tmp_path / "table" / "1" / "summary.json").read_text())["criteria"][0]
    assert float(rows[1]["criteria.0.margin"]) == stored["margin"] < 0.0 < float(rows[0]["criteria.0.margin"])
    page = Page((tmp_path / "table" / "report.html").read_text(encoding="utf-8"))
    assert "2 runs: 1 done, 1 criterion." in page.text and "1 of 2 runs" in page.text
    assert page.outside == ["1/report.html", "0/report.html", "1/report.html"]  # the worst one, then all runs
    assert all((tmp_path / "table" / link).exists() for link in page.outside)
    for _, (_, k, column), value in page.figures:
        held = rows[int(k)][str(column)]
        assert held == value if isinstance(value, str) else float(held) == value
    assert ["rows", 1, "criteria.0.value"] in [key for _, key, _ in page.figures]


def test_batches_and_model_files_keep_them(scene, tmp_path):
    texts = ("F_n_max < 1",)
    own = replace(scene, criteria=texts)
    model_file.save(tmp_path / "cube.mca", own, {"cube": own.bodies[0].geometry.build()})
    assert model_file.load(tmp_path / "cube.mca").scene.criteria == texts
    other = replace(scene, criteria=("F_n_max < 1e9",))
    found = mca.run_batch([replace(scene, criteria=texts), other], device="cpu")
    assert [item.summary["criteria"][0]["met"] for item in found] == [False, True]
