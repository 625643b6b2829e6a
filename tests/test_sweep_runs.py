"""Sweeps: a row a run, by whom ever it is run; killed workers, interrupts, runs that fail, and how they go on."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections import Counter
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sweeping import SCENE, TIMED, Losing, figures, lose_device

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.step.device import devices_named
from warp_mca.studies.sweep import TRIES
from warp_mca.studies.sweep_job import BETWEEN, NO_FIGURES, Job, check_device_after
from warp_mca.studies.sweep_job import figures as summary_figures
from warp_mca.studies.sweep_lines import read_lines
from warp_mca.studies.sweep_plan import FULL, Plan, RunOptions, batches, differing
from warp_mca.studies.sweep_workers import Workers, early_worker
from warp_mca.studies.worker_process import DeviceLost, WorkerDied

pytestmark = pytest.mark.usefixtures("no_figures")

SPEEDS = (1.0, 1.5, 2.0, 2.5, 3.0)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0})  # one worker on a CPU, which is this process
    (tmp_path / "block.py").write_text(SCENE, encoding="utf-8")
    return tmp_path


def blocks(*speeds: float, **parameters: object) -> list[mca.Scene]:
    return [mca.make_scene("block.py", v=v, **parameters) for v in speeds]


def planned(scenes: list[mca.Scene], batch: int | None = None, **options: Any) -> list[list[int]]:
    return batches(Plan(tuple(scenes), differing(scenes), RunOptions(**options), batch=batch))


def test_a_row_holds_what_differs_and_the_figures_of_a_run_by_itself():
    scene = blocks(2.0)[0]
    rows = mca.sweep([*blocks(1.0), scene])
    summary = mca.run(scene).summary
    assert list(rows[1])[:4] == ["index", "v", "status", "reason"]
    assert [(row["index"], row["v"], row["status"]) for row in rows] == [(0, 1.0, "done"), (1, 2.0, "done")]
    expected = dict(summary_figures({key: summary[key] for key in ("F_n_max", "energy", "extremes", "dt", "touched")}))
    assert len(expected) > 15 and rows[1]["F_n_max"] > 1e4
    assert {name: rows[1][name] for name in expected} == expected
    assert "still in progress" in rows[1]["warnings"]


def test_the_same_command_goes_on_and_another_one_is_refused(here: Path, capsys: pytest.CaptureFixture[str]):
    command = ["sweep", "block.py", "--grid", "v=1,2", "--out", "all"]
    assert main(command) == 0
    assert "wrote all/sweep.parquet" in capsys.readouterr().out
    before = (here / "all/sweep.csv").read_bytes()
    assert main(command) == 0
    assert (here / "all/sweep.csv").read_bytes() == before
    assert main([*command[:3], "v=1,3", "--out", "all"]) == 2
    assert "it holds a sweep with grid = v=1.0,2.0, not v=1.0,3.0" in capsys.readouterr().err
    assert main([*command, "--set", "mu=0.5"]) == 2
    assert "scenes with other values" in capsys.readouterr().err
    assert main([*command, "--set", "mu=0.5", "--force"]) == 0
    assert (here / "all/sweep.csv").read_bytes() != before


class Listing(Executor):
    """Carries out jobs at once, and lists which runs they had."""

    def __init__(self) -> None:
        self.jobs: list[tuple[int, ...]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.jobs.append(args[0].numbers)
        future: Future[Any] = Future()
        future.set_result(fn(*args))
        return future


def test_rows_of_an_interrupted_sweep_are_those_of_a_whole_one(here: Path):
    scenes = blocks(*SPEEDS)
    whole = mca.sweep(scenes, batch=2)

    def interrupt(stage: str, done: float) -> None:
        if done > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as stop:
        mca.sweep(scenes, batch=2, out="all", progress=interrupt)
    assert stop.value.__notes__ == ["3 of 5 runs are in all: the same command goes on with the others"]
    header, *lines = (here / "all/sweep.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 3
    (here / "all/sweep.csv").write_text("\n".join([header, *lines[:2], "2,2.0,"]), encoding="utf-8")  # torn
    rest = Listing()
    assert figures(mca.sweep(scenes, batch=2, out="all", executor=rest)) == figures(whole)
    assert rest.jobs == [(1, 2), (3, 4)]  # run 1 is done, but has a part in the time step of run 2
    assert read_lines(here / "all/sweep.csv")[0][1]["wall"] == float(lines[1].split(",")[-2])
    assert figures(read_lines(here / "all/sweep.csv")[0]) == figures(whole)


def test_failed_and_stopped_runs_are_kept_with_their_reason(here: Path, capsys: pytest.CaptureFixture[str]):
    good, stopped = blocks(1.0, tolerance=1.0)[0], blocks(1.0, tolerance=1e-12)[0]
    body = replace(good.bodies[0], geometry=Broken("no such part"))
    rows = mca.sweep([good, replace(good, bodies=(body,)), stopped], batch=3, out="all", folders=True)
    assert [row["status"] for row in rows] == ["done", "failed", "stopped"]
    assert "failed with OSError: no such part" in rows[1]["reason"] and "imbalance" in rows[2]["reason"]
    assert rows[0]["F_n_max"] > 0.0 and "F_n_max" not in rows[2]
    assert sorted(path.name for path in (here / "all").iterdir() if path.is_dir()) == ["0"]
    assert mca.load(here / "all/0").F_n.max() == rows[0]["F_n_max"]


@dataclass(frozen=True)
class Broken:
    why: str

    def build(self) -> mca.Mesh:
        raise OSError(self.why)


def test_any_executor_runs_them():
    alone = mca.sweep(blocks(*SPEEDS))
    with ThreadPoolExecutor(2) as threads:
        assert figures(mca.sweep(blocks(*SPEEDS), executor=threads)) == figures(alone)


class Dying(Executor):
    """Loses the worker of run 1 each time, and that of run 2 once."""

    def __init__(self) -> None:
        self.tries: Counter[int] = Counter()

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        (number,) = args[0].numbers
        self.tries[number] += 1
        if number == 1 or (number == 2 and self.tries[2] == 1):
            future.set_exception(BrokenExecutor("killed by SIGKILL"))
        else:
            future.set_result(fn(*args))
        return future


def test_a_run_that_keeps_losing_its_worker_is_given_up_and_named():
    executor = Dying()
    rows = mca.sweep(blocks(*SPEEDS), executor=executor)
    assert [row["status"] for row in rows] == ["done", "failed", "done", "done", "done"]
    assert rows[1]["reason"] == f"its worker ended before it in each of {TRIES} tries: killed by SIGKILL"
    assert executor.tries == {0: 1, 1: TRIES, 2: 2, 3: 1, 4: 1}


def test_killed_workers_and_a_killed_sweep_lose_no_run(here: Path):
    """Run 1 kills its worker, run 2 the process that started it; each run is in the table once at the end."""
    grid = ["--grid", "v=1,2", "--grid", "kills=nothing,worker,main"]
    command = ["sweep", "block.py", *grid, "--set", "duration=2e-6", "--out", "all"]
    whole = [*command[:-1], "whole", "--workers", "1"]
    started = [sys.executable, "-m", "warp_mca", *command, "--executor", "process", "--workers", "1"]
    done = subprocess.run(started, capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert [row["kills"] for row in read_lines(here / "all/sweep.csv")[0]] == ["nothing"]
    assert (here / "worker-1").exists() and (here / "main-1").exists()
    for flag in ("worker-2", "main-2"):  # later runs kill nothing
        (here / flag).touch()
    assert main([*command, "--workers", "1"]) == 0
    assert main(whole) == 0
    rows = read_lines(here / "all/sweep.csv")[0]
    assert [row["index"] for row in rows] == list(range(6))
    assert figures(rows) == figures(read_lines(here / "whole/sweep.csv")[0])


def test_scenes_with_classes_of_their_file_travel_to_processes_that_have_not_read_it(
    here: Path, monkeypatch: pytest.MonkeyPatch
):
    """A scene file that was read for each scene gave classes that pickle took for others."""
    scenes = blocks(1.0, kills="worker") + blocks(2.0, kills="worker")
    sent = pickle.dumps(Job((0, 1), tuple(scenes), (None, None), RunOptions()))
    monkeypatch.delitem(sys.modules, type(scenes[0].bodies[0].geometry).__module__)  # as in a new process
    received = pickle.loads(sent)
    assert [vars(scene.bodies[0].geometry) for scene in received.scenes] == [
        {"whom": "worker", "flag": str(here / f"worker-{v}")} for v in (1, 2)
    ]


def test_a_scene_file_that_was_changed_is_read_again(here: Path):
    before = blocks(1.0)[0].contacts[0].mu
    (here / "block.py").write_text(SCENE.replace('Param("friction")] = 0.2', 'Param("friction")] = 0.3'))
    assert (before, blocks(1.0)[0].contacts[0].mu) == (0.2, 0.3)


def test_small_scenes_share_a_model_on_a_gpu_as_far_as_they_fill_it():
    scenes = blocks(*SPEEDS)
    assert planned(scenes, device="cpu") == [[0], [1], [2], [3], [4]]
    assert planned(scenes, device="cuda:0") == [[0, 1, 2, 3, 4]]
    assert planned(scenes, device="cuda:0", multi_rate=2) == [[0], [1], [2], [3], [4]]
    assert planned(scenes, batch=2) == [[0], [1, 2], [3, 4]]
    cells = round((FULL / 2.5) ** (1 / 3))
    large = mca.Box(size=(0.02, 0.01, 0.01), divisions=(cells, cells, cells))
    fine = [replace(scene, bodies=(replace(scene.bodies[0], geometry=large),)) for scene in scenes[:3]]
    assert planned(fine, device="cuda:0") == [[0], [1, 2]]


def test_scenes_of_nearly_equal_meshes_share_a_model():
    """Not those with other cells, other corners of a finished mesh, or lengths that differ by more than a tenth."""
    scene = blocks(1.0)[0]
    body = scene.bodies[0]

    def of(size: tuple[float, float, float], *divisions: int) -> mca.Scene:
        geometry = mca.Box(size=size, divisions=divisions or (2, 1, 1))  # type: ignore[arg-type]
        return replace(scene, bodies=(replace(body, geometry=geometry),))

    sizes = [
        (0.02, 0.01, 0.01),
        (0.0205, 0.01, 0.0095),
        (0.025, 0.01, 0.01),
        (0.0215, 0.0105, 0.01),
        (0.0265, 0.01, 0.01),
    ]
    scenes = [*map(of, sizes), of(sizes[0], 3, 1, 1)]
    meshes = [mca.Box(size=size, divisions=(2, 1, 1)).build() for size in sizes[:2]]
    scenes += [replace(scene, bodies=(replace(body, geometry=mesh),)) for mesh in meshes]
    groups = planned(scenes, device="cuda:0")
    assert groups == [[0, 1, 3], [2, 4], [5], [6], [7]]
    rows = mca.sweep(scenes[:4], batch=3)
    alone = [mca.run(item).summary for item in scenes[:4]]
    assert rows[0]["dt"] == rows[1]["dt"] == rows[3]["dt"] == min(alone[k]["dt"] for k in (0, 1, 3))
    assert rows[2]["dt"] == alone[2]["dt"] and all(row["status"] == "done" for row in rows)
    assert [row["F_n_max"] for row in rows] == pytest.approx([one["F_n_max"] for one in alone], rel=0.02)


def test_rows_of_scenes_with_paths_are_those_of_a_batch_and_only_files_need_the_stress(here: Path):
    line = mca.Line(body="block", start=(0.001, 0.005, 0.005), end=(0.019, 0.005, 0.005))
    path = mca.Path(name="axis", lines=(line,), spacing=0.002)
    scenes = [replace(scene, paths=(path,)) for scene in blocks(1.0, 2.0)]
    results = mca.run_batch(scenes)
    assert results[1].paths[0].stress.any()
    rows, kept = mca.sweep(scenes, batch=2), mca.sweep(scenes, batch=2, out="kept", folders=True)
    for row, with_files, result in zip(rows, kept, results, strict=True):
        own = {name: value for name, value in result.summary.items() if name not in NO_FIGURES}
        expected = dict(summary_figures(own)) | {"warnings": BETWEEN.join(result.warnings) or None}
        assert {name: row[name] for name in expected.keys() - TIMED} == {
            n: expected[n] for n in expected.keys() - TIMED
        }
        assert figures([row]) == figures([with_files])
    np.testing.assert_array_equal(mca.load(here / "kept/1").paths[0].stress, results[1].paths[0].stress)


@pytest.mark.gpu
def test_rows_from_a_gpu_are_those_of_a_batch():
    rows = mca.sweep(blocks(*SPEEDS), device="cuda", out="all", folders=True)
    batch = mca.run_batch(blocks(*SPEEDS), device="cuda:0")
    assert [row["F_n_max"] for row in rows] == [result.summary["F_n_max"] for result in batch]
    assert [mca.load(f"all/{k}").summary["batch"]["scenes"] for k in range(5)] == [5] * 5


def test_scenes_of_other_steps_durations_and_contacts_run_apart():
    scene = blocks(1.0)[0]
    body, contact = scene.bodies[0], scene.contacts[0]
    other = [
        replace(scene, impact=replace(scene.impact, duration=8e-6)),
        replace(scene, bodies=(replace(body, material=replace(body.material, E=1e9)),)),
        replace(scene, contacts=(replace(contact, penalty=0.1),)),
        replace(scene, refine=2.0),
        replace(scene, contacts=()),
    ]
    alike = replace(scene, contacts=(replace(contact, mu=0.9),), gravity=(0.0, -9.8, 0.0))
    assert planned([scene, *other, alike], batch=9) == [[0, 6], [1], [2], [3], [4], [5]]


def test_the_identity_of_a_sweep_sees_every_value_of_its_scenes():
    def identity(scene: mca.Scene) -> object:
        return Plan((scene,), ({},), RunOptions()).identity()

    scene = blocks(1.0)[0]
    body = scene.bodies[0]
    mesh = body.geometry.build()  # type: ignore[union-attr]
    moved = replace(mesh, points=np.nextafter(mesh.points, 1.0))
    found = [scene, *(replace(scene, bodies=(replace(body, geometry=item),)) for item in (mesh, moved, Broken("a")))]
    found += [replace(scene, bodies=(replace(body, material=replace(body.material, rho=7850.000001)),))]
    assert len({str(identity(item)) for item in found}) == len(found)
    assert identity(replace(scene)) == identity(blocks(1.0)[0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"executor": "threads"}, "executor = 'threads': give process, dask://HOST:PORT"),
        ({"workers": 0}, "workers = 0: give a whole number above 0"),
        ({"batch": 1.5}, r"batch = 1\.5: give a whole number above 0"),
        ({"device": "cuda:99"}, "device = 'cuda:99'"),
        ({"precision": "half"}, "precision = 'half'"),
        ({"threads": 0}, "threads = 0"),
        ({"duration": -1.0}, r"duration = -1\.0"),
        ({"folders": True}, "folders = True: name the folder"),
        ({"multi_rate": 99}, "multi_rate = 99"),
        ({"out": "block.py"}, "block.py is not a folder"),
    ],
)
def test_bad_sweeps_are_refused_before_anything_runs(here: Path, options: dict[str, Any], message: str):
    before = sorted(here.iterdir())
    with pytest.raises(mca.RequestError, match=message):
        mca.sweep(blocks(1.0, 2.0), **options)
    assert sorted(here.iterdir()) == before


def test_results_of_single_runs_are_not_overwritten(here: Path, capsys: pytest.CaptureFixture[str]):
    mca.run(blocks(1.0)[0], out="all/0")
    assert main(["sweep", "block.py", "--grid", "v=1,2", "--folders", "--out", "all"]) == 2
    assert "it holds results already" in capsys.readouterr().err
    assert not (here / "all/sweep.json").exists()


def test_a_worker_whose_device_takes_no_more_work_is_replaced(tmp_path: Path):
    with Workers(["cpu"]) as pool:
        job = Losing(flag=tmp_path / "lost")
        with pytest.raises(WorkerDied, match="cpu takes no more work"):
            pool.submit(lose_device, job).result()
        device, process = pool.submit(lose_device, job).result()
        assert device == "cpu"
        assert process not in (os.getpid(), int(job.flag.read_text()))


def test_a_worker_that_begins_early_names_the_devices_and_takes_the_first_job(tmp_path: Path):
    flag = tmp_path / "lost"
    flag.write_text("")
    with early_worker(RunOptions("cuda:0"), None, None, 2) as early:
        assert early and devices_named("cpu", early.devices()) == ["cpu"]
        with Workers(["cpu"], None, early) as pool:
            assert pool.submit(lose_device, Losing(flag=flag)).result() == ("cpu", early.process.pid)
    early.process.join(10.0)
    assert not early.process.is_alive()


@pytest.mark.parametrize(
    ("options", "executor", "workers"),
    [(RunOptions("cpu"), None, 2), (RunOptions("cuda"), None, 1), (RunOptions("cuda"), "dask://host:1", None)],
)
def test_no_worker_begins_early_where_others_or_this_process_carry_out_the_runs(
    options: RunOptions, executor: str | None, workers: int | None
):
    with early_worker(options, executor, workers, 2) as early:
        assert early is None


def test_a_device_that_answers_is_not_lost():
    check_device_after(ValueError("of the run"), "cpu")
    with pytest.raises(DeviceLost, match=r"cuda:99 takes no more work .* \(a fault\)"):
        check_device_after(ValueError("a fault"), "cuda:99")
