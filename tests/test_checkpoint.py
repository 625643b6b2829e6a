"""The state of a run stored on its way: how often, and that the same call goes on to the same bits."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_full_disk import files_up_to

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.phases.carry_out import restored
from warp_mca.phases.checkpoint import FILE, Checkpoint
from warp_mca.phases.every import Every
from warp_mca.phases.impact import Impact
from warp_mca.system.records import SceneRecords

pytestmark = pytest.mark.usefixtures("no_figures")

BLOCK = mca.Body(
    name="block",
    geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2)),
    material=mca.Elastic(E=1e9, nu=0.3, rho=1e3),
    velocity=(0.3, -1.0, 0.0),
)
LANDING = mca.Scene(
    name="landing",
    bodies=(BLOCK,),
    contacts=(mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane(), mu=0.2),),
    impact=mca.ImpactPhase(duration=4e-5),
)


class StoppedError(Exception):
    pass


@pytest.fixture
def stops(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[int]]:
    """Runs into a folder until the state has been stored so often; gives the steps at which it was."""

    def stop(out: Path, count: int, scene: mca.Scene = LANDING, **settings: Any) -> list[int]:
        steps, store = [], Checkpoint.store

        def store_and_stop(self: Checkpoint, impact: Any, place: Any, more: Any = None) -> None:
            store(self, impact, place, more)
            steps.append(impact.state.steps)
            if len(steps) == count:
                raise StoppedError

        with monkeypatch.context() as patch:
            patch.setattr(Checkpoint, "store", store_and_stop)
            with pytest.raises(StoppedError):
                mca.run(scene, out=out, threads=1, **settings)
        return steps

    return stop


def test_a_run_goes_on_from_its_last_state(tmp_path: Path, stops: Callable[..., list[int]]):
    whole = mca.run(LANDING, threads=1)
    assert whole.F_n.max() > 0.0 and whole["E_friction"][-1] > 0.0
    assert stops(tmp_path / "out", 2, checkpoint="7") == [7, 14]
    assert stops(tmp_path / "out", 1, checkpoint="7") == [21]
    result = mca.run(LANDING, out=tmp_path / "out", threads=1, checkpoint="7")
    assert all(np.array_equal(result[name], whole[name], equal_nan=True) for name in whole.history)
    assert result.summary["energy"] == whole.summary["energy"]
    assert not (tmp_path / "out" / FILE).exists()


def driven(function: Callable[..., Any], period: float = 2e-4) -> mca.Scene:
    """A rotor that a function drives."""
    motor = mca.Controller(function=function, period=period)
    rotor = mca.Body(name="rotor", rigid=True, mass=1.0, inertia=(0.1, 0.1, 0.1))
    pivot = mca.Articulation(name="J", body="rotor", freedoms=(mca.Freedom(motor=motor),))
    impact = mca.ImpactPhase(duration=2e-3, output_interval=1e-4)
    return mca.Scene(name="driven", bodies=(rotor,), joints=(pivot,), impact=impact)


def integral() -> Callable[..., float]:
    """A controller that keeps the sum of what it saw."""
    total = [0.0]

    def torque(t: float, q: Any, rate: Any) -> float:
        total[0] += 1.0 + 0.1 * float(q[0])
        return total[0]

    return torque


def test_a_controller_has_its_own_state_again(tmp_path: Path, stops: Callable[..., list[int]]):
    whole = mca.run(driven(integral()), threads=1)
    assert whole["joint_J_drive1_Nm"][-1] == pytest.approx(10.0, rel=1e-3)  # of ten calls
    stops(tmp_path, 2, driven(integral()), checkpoint="5e-4s")
    with pytest.raises(mca.RequestError, match="'<lambda>': at 0 s it gives other numbers than before"):
        mca.run(driven(lambda t, q, rate: 2.0), out=tmp_path, threads=1, checkpoint="5e-4s")
    with pytest.raises(mca.RequestError, match=r"of another request \(controllers\)"):
        mca.run(driven(integral(), 1e-4), out=tmp_path, threads=1, checkpoint="5e-4s")
    result = mca.run(driven(integral()), out=tmp_path, threads=1, checkpoint="5e-4s")
    assert all(np.array_equal(result[name], whole[name], equal_nan=True) for name in whole.history)


@pytest.mark.parametrize(("every", "steps"), [("7e-6s", [7, 14]), ("1e-9w", [1, 2]), ("1000w", [])])
def test_the_state_is_stored_as_often_as_asked(
    every: str, steps: list[int], tmp_path: Path, stops: Callable[..., list[int]], monkeypatch: pytest.MonkeyPatch
):
    assert mca.run(LANDING, threads=1).summary["n_steps"] == 40  # a step a row
    if steps:
        assert stops(tmp_path, 2, checkpoint=every) == steps
    else:
        monkeypatch.setattr(Checkpoint, "store", None)
        assert mca.run(LANDING, threads=1, out=tmp_path, checkpoint=every).summary["n_steps"] == 40


def test_another_request_is_refused_and_force_begins_anew(tmp_path: Path, stops: Callable[..., list[int]]):
    stops(tmp_path, 2, checkpoint="7")
    others: tuple[tuple[dict[str, Any], dict[str, Any], str], ...] = (
        ({"gravity": (0.0, -9.0, 0.0)}, {}, "model"),
        ({"impact": replace(LANDING.impact, energy_tolerance=0.02)}, {}, "impact"),
        ({}, {"duration": 5e-5}, "span"),
        ({}, {"precision": "float64"}, "precision"),
    )
    for change, arguments, what in others:
        with pytest.raises(mca.RequestError, match=rf"^out = .*of another request \({what}\)"):
            mca.run(replace(LANDING, **change), out=tmp_path, checkpoint="7", threads=1, **arguments)
    assert stops(tmp_path, 1, checkpoint="7", force=True) == [7]


def test_a_damaged_file_is_refused(tmp_path: Path, stops: Callable[..., list[int]]):
    stops(tmp_path, 1, checkpoint="7")
    intact = (tmp_path / FILE).read_bytes()
    for damaged in (b"", intact[: len(intact) // 2]):
        (tmp_path / FILE).write_bytes(damaged)
        with pytest.raises(mca.RequestError, match=r"checkpoint\.npz there is damaged"):
            mca.run(LANDING, out=tmp_path, checkpoint="7", threads=1)


def test_resume_needs_a_command(tmp_path: Path, stops: Callable[..., list[int]], capsys: pytest.CaptureFixture[str]):
    assert main(["resume", str(tmp_path)]) == 2
    assert f"there is no {FILE}" in capsys.readouterr().err
    stops(tmp_path, 1, checkpoint="7")
    assert main(["resume", str(tmp_path)]) == 2
    assert "call it again with this out" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "0", "1.5", "-2s", "nan", "3 weeks", "s", "infw"])
def test_what_is_no_frequency_is_refused(text: str):
    with pytest.raises(mca.RequestError, match=re.escape("100 (steps), 2e-5s")):
        Every.parse(text)


def test_a_sweep_and_a_run_without_a_folder_store_nothing(tmp_path: Path):
    with pytest.raises(mca.RequestError, match="name one by out"):
        mca.run(LANDING, checkpoint="7")
    assert main(["run", "single_link", "--sweep", "mu=0.1,0.2", "--checkpoint", "7", "--out", str(tmp_path / "a")]) == 2


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (0.05, "accuracy = 0.05: it is for runs of one impact that store nothing"),
        (mca.Accuracy(share=0.05), "accuracy = '5%': it is for runs of one impact that store nothing"),
        ({"share": 0.05}, "accuracy = {'share': 0.05}: give a share from 0.1% to 50%"),
        ([0.05], "accuracy = [0.05]: give a share from 0.1% to 50%"),
    ],
)
def test_an_accuracy_beside_a_checkpoint_is_refused_by_its_value(asked: Any, words: str, tmp_path: Path):
    with pytest.raises(mca.RequestError, match=re.escape(words)):
        mca.run(LANDING, accuracy=asked, checkpoint="7", out=tmp_path)


@pytest.mark.parametrize("why", ["full disk", "folder gone"])
def test_a_state_that_cannot_be_written_is_a_warning_and_the_run_goes_on(
    why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    """It ended the run, hours of work with it. Later states are stored as soon as there is room again."""
    save, stored = Impact.save, []
    out = tmp_path / "out"

    def save_with_trouble(self: Impact, path: Any, more: Any = None) -> None:
        if len(stored) in (1, 2) and why == "full disk":
            stored.append(False)
            with files_up_to(2000):
                save(self, path, more)
        elif len(stored) == 1:
            shutil.rmtree(out)
        stored.append(False)
        save(self, path, more)
        stored[-1] = (out / FILE).exists()
        assert [file.name for file in out.iterdir()] == [FILE]

    monkeypatch.setattr(Impact, "save", save_with_trouble)
    result = mca.run(LANDING, out=out, threads=1, checkpoint="7")
    assert stored == ([True, False, False, True, True] if why == "full disk" else [True, *4 * [False]])
    (warning,) = [record.getMessage() for record in caplog.records if "the state could" in record.getMessage()]
    reason = "File too large" if why == "full disk" else "No such file or directory"
    assert warning == f"the state could not be written to {out / FILE} ({reason}): the run goes on"
    whole = mca.run(LANDING, threads=1)
    assert all(np.array_equal(result[name], whole[name], equal_nan=True) for name in whole.history)
    assert mca.load(out).summary["n_steps"] == 40 and not (out / FILE).exists()


STEPS = {"dt": 1e-7, "per_search": 2, "searches": 5, "intervals": 10, "intervals_per_search": 1, "spare": False}
PLACES: tuple[dict[str, Any], ...] = (
    {"kind": 3, "more": 1},
    {"count": -1},
    {"count": "1"},
    {"ended": "touch"},
    {"steps": {**STEPS, "dt": 2e-7}},
    {"steps": {**STEPS, "intervals": 1.5}},
    {"steps": {**STEPS, "more": 1}},
)


@pytest.mark.parametrize("change", PLACES)
def test_the_place_of_a_run_that_a_file_holds_is_checked(change: dict[str, Any]):
    good = {"kind": "swing", "ended_by": "touch", "steps": STEPS, "count": 3, "more": {}}
    arrays = {f"0/{name}": array for name, array in SceneRecords().arrays().items()}

    def place(stretch: dict[str, Any], fe: object = 1.0) -> dict[str, Any]:
        return {"stretches": [stretch], "steps": STEPS, "wall": {"fe": fe}}

    assert restored(place(good), arrays, 1e-7)[0][0].count == 3
    with pytest.raises((TypeError, ValueError)):
        restored(place({**good, **change}), arrays, 1e-7)
    with pytest.raises((TypeError, ValueError)):
        restored(place(good, "none"), arrays, 1e-7)
