"""Tests that a folder of results belongs to one run at a time, and holds the files of one run whenever that ends."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from test_results import TIME, history

import warp_mca as mca
from warp_mca.base.errors import GuardError, McaError, RequestError
from warp_mca.base.files import write_atomically
from warp_mca.base.folder import held
from warp_mca.cli import main as cli
from warp_mca.results.paths import PathHistory
from warp_mca.results.result import Result
from warp_mca.results.storage import FILES, PATH_FILES, hold, load, save

MOVES = len(FILES) + len(PATH_FILES)


@pytest.fixture(autouse=True)
def quick_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures that take no time."""
    for figure, name in (("force", "forces"), ("energy", "energies"), ("path", "path_curves"), ("path", "waves")):
        draw = lambda file, result: file.write_text(str(result.summary))  # noqa: E731
        module = f"{figure}_figures" if figure == "path" else f"{figure}_figure"
        monkeypatch.setattr(f"warp_mca.results.{module}.save_{name}", draw)


def result(number: int, *, paths: bool = True) -> Result:
    """Results whose files all tell the number of their run."""
    stress = np.full((len(TIME), 2, 6), number, dtype=np.float32)
    path = PathHistory("p", np.array([0.0, 1.0]), stress)
    return Result({"run": number}, history(F_n_N=np.full(len(TIME), float(number))), paths=(path,) if paths else ())


def numbers(folder: Path) -> set[float]:
    """Those that `mca.load` finds there; the files must be of one run, and complete."""
    loaded = load(folder)
    assert {*FILES} <= {file.name for file in folder.iterdir()}
    return {loaded.summary["run"], *loaded.F_n, *(path.stress.mean() for path in loaded.paths)}


def forked(work: Callable[[], object]) -> int:
    """Exit status of another process that does the work."""
    child = os.fork()
    if not child:
        with suppress(BaseException):
            work()
            os._exit(0)
        os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Results of run 1 beside a recording."""
    save(result(1), tmp_path / "out")
    (tmp_path / "out" / "a.usdc").write_text("recorded")
    return tmp_path / "out"


def at_move(number: int, stop: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the move of a file with that number stop the process."""
    replace, done = Path.replace, []

    def counted(self: Path, target: Path) -> Path:
        done.append(target)
        if len(done) == number:
            stop()
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", counted)


@pytest.mark.parametrize("number", range(1, 2 * MOVES))
def test_a_kill_between_two_files_leaves_no_mixture(folder: Path, monkeypatch: pytest.MonkeyPatch, number: int):
    """It left the summary of one run beside the history of another."""
    with monkeypatch.context() as patch:
        at_move(number, lambda: os.kill(os.getpid(), signal.SIGKILL), patch)
        status = forked(lambda: save(result(2), folder, force=True))
    assert status in (-signal.SIGKILL, 0)
    if (folder / "summary.json").exists():
        assert numbers(folder) == ({1.0} if number == 1 else {2.0})
    else:
        with pytest.raises(RequestError, match=r"it has no summary\.json"):
            load(folder)
    assert (folder / "a.usdc").read_text() == "recorded"
    save(result(3, paths=False), folder, force=True)
    assert numbers(folder) == {3.0}


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device")])
@pytest.mark.parametrize("number", [1, 2, MOVES, MOVES + 1, 2 * MOVES])
def test_a_save_that_stops_half_way_leaves_the_old_results(
    folder: Path, monkeypatch: pytest.MonkeyPatch, number: int, error: type[BaseException] | BaseException
):
    def stop() -> None:
        raise error

    with monkeypatch.context() as patch:
        at_move(number, stop, patch)
        with pytest.raises((KeyboardInterrupt, McaError)):
            save(result(2), folder, force=True)
    assert numbers(folder) == {1.0}
    assert sorted(file.name for file in folder.iterdir()) == sorted([*FILES, *PATH_FILES, "a.usdc"])
    assert [file.name for file in folder.parent.iterdir()] == ["out"]


@pytest.mark.parametrize("name", ["history.csv", "paths.npz"])
def test_files_of_different_runs_are_noticed(folder: Path, tmp_path: Path, name: str):
    save(result(2), tmp_path / "other")
    shutil.copy(tmp_path / "other" / name, folder / name)
    with pytest.raises(RequestError, match=rf"results = .*out': {name} was changed, or is not of the run"):
        load(folder)


@pytest.mark.parametrize("exists", [False, True])
@pytest.mark.parametrize("force", [False, True])
def test_a_folder_in_use_is_refused(tmp_path: Path, exists: bool, force: bool):
    """By this process and by another; when the run has failed, nothing is left of it."""
    out = tmp_path / "a" / "out"
    if exists:
        out.mkdir(parents=True)
    with suppress(GuardError), hold(out):
        with pytest.raises(RequestError, match=r"^out = .*: another run is writing to this folder; wait"):
            save(result(2), out, force=force)
        assert forked(lambda: save(result(2), out, force=force)) == 1
        raise GuardError
    assert out.exists() == (tmp_path / "a").exists() == exists
    assert numbers(save(result(2), out, force=force).path or out) == {2.0}


def test_the_lock_of_a_process_that_is_gone_does_not_count(tmp_path: Path):
    out = tmp_path / "out"

    def run() -> None:
        with hold(out):
            os.kill(os.getpid(), signal.SIGKILL)

    assert forked(run) == -signal.SIGKILL
    save(result(1), out)
    assert numbers(out) == {1.0}
    assert sorted(file.name for file in out.iterdir()) == sorted([*FILES, *PATH_FILES])


@pytest.mark.parametrize("name", ["paths.npz", "history.csv"])
def test_results_whose_data_are_gone_are_refused_and_figures_may_go(folder: Path, name: str):
    """Paths that were gone were none."""
    (folder / "forces.png").unlink()
    assert load(folder).summary["run"] == 1
    (folder / name).unlink()
    with pytest.raises(RequestError, match=rf"^results = .*{name}"):
        load(folder)


LEFT = (".warp_mca-abc", ".warp_mca-checkpoint.npz-12345678", ".checkpoint.npz-12345678", ".sweep.csv-12345678")


@pytest.mark.parametrize("exists", [False, True])
def test_what_a_kill_left_is_cleared_by_the_next_run_whatever_its_age(tmp_path: Path, exists: bool):
    """Unfinished files stayed for ever, and folders for an hour."""
    out = tmp_path / "out"
    if exists:
        out.mkdir()

    def die_while(write: Callable[[Path], object]) -> None:
        def run() -> None:
            with hold(out) as folder:
                if write is write_atomically:
                    write_atomically(out / "a", lambda file: os.kill(os.getpid(), signal.SIGKILL))
                with folder.staging() as staging:
                    (staging / "results").mkdir()
                    os.kill(os.getpid(), signal.SIGKILL)

        assert forked(run) == -signal.SIGKILL

    die_while(write_atomically)
    die_while(held)
    out.mkdir(exist_ok=True)
    for name in LEFT[1:]:
        (out / name).write_text("")
    (out / LEFT[0] / "results").mkdir(parents=True)
    (out / ".checkpoint.npz-kept").write_text("")  # no name of ours
    with held(out):
        assert [file.name for file in out.iterdir()] == [".checkpoint.npz-kept"]
        assert [file.name for file in tmp_path.iterdir()] == ["out"]


def test_what_others_write_beside_is_not_taken_for_a_leftover(tmp_path: Path):
    """Two runs make their folders in one that a third holds."""
    with held(tmp_path / "a") as first, first.staging() as staging:
        (staging / "results").mkdir()
        started, go_on = os.pipe(), os.pipe()
        if not (child := os.fork()):
            with suppress(BaseException):
                write_atomically(tmp_path / "b", lambda file: (os.write(started[1], b"."), os.read(go_on[0], 1)))
                os._exit(0)
            os._exit(1)
        os.read(started[0], 1)
        with held(tmp_path):
            assert (staging / "results").exists()
        os.write(go_on[1], b".")
        assert os.waitpid(child, 0)[1] == 0
    assert [file.name for file in tmp_path.iterdir()] == ["b"]


def test_runs_into_one_folder_do_not_mix(folder: Path):
    """Six processes at once, each with force: the folder holds the results of one of those that were not refused."""
    children = {}
    for number in range(2, 8):
        if not (child := os.fork()):
            try:
                save(result(number), folder, force=True)
            except BaseException as error:
                os._exit(2 if isinstance(error, RequestError) and "another run" in str(error) else 1)
            os._exit(0)
        children[child] = float(number)
    ended = {number: os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child, number in children.items()}
    assert set(ended.values()) <= {0, 2}
    assert numbers(folder) <= {number for number, status in ended.items() if status == 0}


def test_a_folder_that_vanishes_during_the_run_is_made_again(tmp_path: Path):
    from warp_mca.results.storage import write

    with hold(tmp_path / "out") as held_folder:
        (tmp_path / "out").rmdir()
        write(result(1), held_folder)
    assert numbers(tmp_path / "out") == {1.0}
    with hold(tmp_path / "new") as held_folder:
        (tmp_path / "new").rmdir()
        with hold(tmp_path / "new"), pytest.raises(RequestError, match="another run is writing"):
            write(result(1), held_folder)
    assert not (tmp_path / "new").exists()


def test_a_folder_under_the_name_of_a_result_is_refused(tmp_path: Path):
    (tmp_path / "forces.png").mkdir()
    with pytest.raises(RequestError, match=r"out = .*: forces\.png is a folder there"):
        save(result(1), tmp_path, force=True)
    (tmp_path / "link").symlink_to("nowhere")
    with pytest.raises(RequestError, match="link is a link to a folder that does not exist"):
        save(result(1), tmp_path / "link")


def bar(**impact: float) -> mca.Scene:
    """A bar that lies still."""
    box = mca.Box(size=(0.1, 0.01, 0.01), divisions=(4, 1, 1))
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    body = mca.Body(name="bar", geometry=box, material=steel, velocity=(1.0, 0.0, 0.0))
    wall = mca.RigidPlane(point=(0.1, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    meet = mca.Contact(slave=mca.Surface(body="bar", nodes="xmax"), master=wall)
    phase = mca.ImpactPhase(duration=4e-6, **impact)
    return mca.Scene(name="bar", bodies=(body,), contacts=(meet,), impact=phase)


def test_a_run_holds_its_folder_and_a_failed_one_leaves_the_old_results(tmp_path: Path):
    refused = []

    def second(stage: str, done: float) -> None:
        if stage == "impact" and not refused:
            with pytest.raises(RequestError, match="another run is writing") as error:
                save(result(2), tmp_path, force=True)
            refused.append(error)
            with pytest.raises(RequestError, match="another run is writing"):
                mca.run_batch([bar(), bar()], out=tmp_path, force=True)

    mca.run(bar(), out=tmp_path, progress=second)
    assert refused
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(GuardError, match="energy imbalance"):
        mca.run(bar(energy_tolerance=1e-15), out=tmp_path, force=True)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_sweep_holds_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.chdir(tmp_path)
    command = ["run", "single_rod", "--sweep", "v=1,2", "--duration", "2e-6", "--out", "out"]
    with held(tmp_path / "out"):
        assert cli.main(command) == 2
        assert capsys.readouterr().err.count("another run is writing to this folder") == 1
        with pytest.raises(RequestError, match="another run is writing"):
            mca.run_batch([bar(), bar()], out="out")
    assert not (tmp_path / "out").exists()
