"""Sweeps from the command line: combinations, folders, exit status, and requests that are refused."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from sweeping import SCENE

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.studies.sweep_plan import parse_grid

pytestmark = pytest.mark.usefixtures("no_figures")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0})  # one worker on a CPU, which is this process
    (tmp_path / "block.py").write_text(SCENE, encoding="utf-8")
    return tmp_path


def test_every_combination_the_last_key_fastest():
    found = parse_grid("--sweep", ["mu=0.1,0.2", "v=1,2,3"])
    assert [(item["mu"], item["v"]) for item in found] == [
        ("0.1", "1"), ("0.1", "2"), ("0.1", "3"), ("0.2", "1"), ("0.2", "2"), ("0.2", "3")
    ]  # fmt: skip


@pytest.mark.parametrize("given", [["--set", "v=3"], ["--time-step-scale", "0.3"]])
def test_what_is_swept_is_not_set_as_well(given: list[str], capsys: pytest.CaptureFixture[str]):
    key = "v" if "--set" in given else "time_step_scale"
    assert main(["run", "block.py", "--sweep", f"{key}=0.1,0.2", *given]) == 2
    assert f"{key} is set for all scenes as well" in capsys.readouterr().err


def test_each_scene_of_a_sweep_has_its_folder(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["run", "block.py", "--sweep", "v=1,2", "--sweep", "mu=0,0.3", "--out", "all"]) == 0
    printed = capsys.readouterr().out
    for k, (v, mu) in enumerate([(1.0, 0.0), (1.0, 0.3), (2.0, 0.0), (2.0, 0.3)]):
        folder = here / "all" / str(k)
        parameters = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["parameters"]
        assert (parameters["v"], parameters["mu"]) == (v, mu)
        assert f"all/{k}" in printed
        if k in (0, 2):
            continue
        assert main(["run", "block.py", "--set", f"v={v}", "--set", f"mu={mu}", "--out", f"one-{k}"]) == 0
        one, swept = mca.load(here / f"one-{k}"), mca.load(folder)
        assert one.F_n.max() > 0.0
        for name in one.history:
            assert np.array_equal(one[name], swept[name], equal_nan=True), name


def test_scenes_may_have_several_durations(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["run", "block.py", "--sweep", "duration=2e-6,4e-6", "--sweep", "v=1,2", "--out", "all"]) == 0
    found = [mca.load(here / "all" / str(k)) for k in range(4)]
    assert [(run.time[-1], run.summary["parameters"]["v"]) for run in found] == [
        (pytest.approx(2e-6), 1.0), (pytest.approx(2e-6), 2.0), (pytest.approx(4e-6), 1.0), (pytest.approx(4e-6), 2.0)
    ]  # fmt: skip
    assert found[3].F_n.max() > found[2].F_n.max() > 0.0
    assert main(["run", "block.py", "--sweep", "duration=2e-6,-1", "--out", "none"]) == 2
    assert not (here / "none").exists()


def test_a_scene_that_is_stopped_gives_exit_status_1(here: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["run", "block.py", "--sweep", "tolerance=1,1e-12"]) == 1
    captured = capsys.readouterr()
    assert captured.err == "warp-mca: error: guards stopped 1 of 2 runs\n"
    assert "energy" in captured.out and "imbalance" in captured.out
    assert [path.name for path in (here / "block-sweep").iterdir() if path.is_dir()] == ["0"]


def test_a_built_model_is_swept(here: Path):
    small = [f"--set={key}" for key in ("axial=4", "output_interval=1e-6", "duration=2e-6")]
    assert main(["build", "single_rod", *small, "-o", "rod.mca"]) == 0
    assert main(["run", "rod.mca", "--sweep", "v=0.5,1"]) == 0
    slow, fast = (mca.load(here / "rod-sweep" / name) for name in "01")
    assert fast.F_n.max() == pytest.approx(2.0 * slow.F_n.max(), rel=1e-4)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--sweep", "v"], "--sweep = 'v': write it as KEY=VALUE,VALUE"),
        (["--sweep", "v=1,,2"], "--sweep = 'v=1,,2'"),
        (["--sweep", "v=1", "--sweep", "v=2"], "list all values of v at once"),
        (["--sweep", "w=1,2"], "'w'"),
        (["--sweep", "v=1,fast"], "'fast'"),
        (["--sweep", "v=1,2", "--rrd", "a.rrd"], "recorders show single runs"),
        (["--sweep", "v=1,2", "--device", "cuda:99"], "device = 'cuda:99'"),
    ],
)
def test_bad_sweeps_are_refused(words: list[str], message: str, here: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["run", "block.py", *words]) == 2
    captured = capsys.readouterr()
    assert message in captured.err and captured.err.count("\n") == 1
    assert [path.name for path in here.iterdir() if path.is_dir() and path.name != "__pycache__"] == []
