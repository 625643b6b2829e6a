"""A State is all that changes: copied, stored or passed to a fresh process, it goes on to the same bits."""

from __future__ import annotations

import dataclasses
import inspect
import json
import os
import pickle
import random
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from impacts import begun, figures
from test_batch import hinged
from test_style import entries

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.kernels.contact.spring import Spring
from warp_mca.phases.impact import Impact
from warp_mca.physics.contact.contact_state import ContactState
from warp_mca.physics.elements.state import ElementState
from warp_mca.physics.joints.constraint_stage import ConstraintState
from warp_mca.physics.loads.stage import LoadState
from warp_mca.step.state_figures import max_speed
from warp_mca.system.records import SceneRecords
from warp_mca.system.state import State

pytestmark = pytest.mark.usefixtures("short_ranges")

PRECISIONS = ["mixed", "float64"]


def scene(**change: object) -> mca.Scene:
    """Hinged bars that yield, the upper one driven, rub on a plate: rows, checks and searches at different steps."""
    made = hinged(cells=3, speed=20.0, duration=1.2e-4, output_interval=4e-5)
    drive = mca.Prescribed(body="high", nodes="ymax", axis="y", times=(0.0, 1e-5), velocities=(-20.0, -22.0))
    return replace(made, **{"prescribed": (drive,)} | change)


def impact(precision: str = "mixed", threads: int = 1, device: str = "cpu") -> Impact:
    return begun(scene(), precision=precision, threads=threads, device=device)


@cache
def whole(precision: str, threads: int, device: str) -> Impact:
    """An impact phase that was never interrupted."""
    found = impact(precision, threads, device)
    found.advance()
    assert found.stopped == [None] and found.solver.threads == threads
    return found


def steps_to_pause_at(found: Impact) -> list[int]:
    """At a row, right before a search, between two records, and at random."""
    steps = found.steps
    assert steps.searches > 1 and steps.checks > 1 and steps.per_check > 1
    rng = random.Random(0)
    chosen = {steps.per_interval, steps.per_search, steps.per_interval + 1, *rng.sample(range(1, steps.count), 2)}
    return sorted(chosen)


def stored(folder: Path, precision: str, threads: int, device: str) -> None:
    """States of one impact phase at some steps, and what `impacts.go_on` needs to continue them."""
    settings = {"precision": precision, "threads": threads, "device": device}
    (folder / "scene").write_bytes(pickle.dumps(scene()))
    (folder / "settings.json").write_text(json.dumps(settings))
    paused = begun(scene(), **settings)
    for step in steps_to_pause_at(paused):
        paused.advance(until=step)
        assert paused.state.steps == step
        paused.save(folder / f"{step}.state")
    paused.advance()
    assert paused.state.differences(whole(**settings).state) == []


@pytest.fixture(scope="module")
def continued(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[tuple[str, int], Path]]:
    """Gives the folders of states of a device, which one fresh process has continued, by precision and threads."""

    @cache
    def make(device: str) -> dict[tuple[str, int], Path]:
        kinds = [(precision, n) for precision in PRECISIONS for n in ((1, 2) if device == "cpu" else (1,))]
        folders = {kind: tmp_path_factory.mktemp("states") for kind in kinds}
        for (precision, threads), folder in folders.items():
            stored(folder, precision, threads, device)
        code = "import sys, pathlib, impacts; [impacts.go_on(pathlib.Path(folder)) for folder in sys.argv[1:]]"
        paths = os.pathsep.join([str(Path(__file__).parent), *filter(None, sys.path)])
        command = [sys.executable, "-c", code, *map(str, folders.values())]
        subprocess.run(command, env=os.environ | {"PYTHONPATH": paths}, check=True)
        return folders

    return make


GPU = pytest.param(1, "cuda:0", marks=pytest.mark.gpu)


@pytest.mark.parametrize(("threads", "device"), [(1, "cpu"), (2, "cpu"), GPU])
@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_stored_state_goes_on_to_the_same_bits_in_a_fresh_process(precision, threads, device, continued):
    folder, expected = continued(device)[precision, threads], whole(precision, threads, device)
    known, found = figures(expected), impact(precision, threads, device)
    assert known["history/F_n_N"].max() > 1e3 and np.abs(known["paths/0"]).max() > 1e6
    assert known["history/E_plastic"][-1] > 0.0 < known["history/E_friction"][-1]
    steps = steps_to_pause_at(found)
    assert len(steps) > 3
    for step in steps:
        found.load(folder / f"{step}.end")
        assert found.state.differences(expected.state) == [], step
        with np.load(folder / f"{step}.npz") as arrays:
            assert [name for name in known if arrays[name].tobytes() != known[name].tobytes()] == [], step


def test_a_state_of_one_thread_goes_on_with_two(tmp_path: Path):
    one, two = impact(threads=1), impact(threads=2)
    one.advance(until=50)
    one.save(tmp_path / "state")
    two.load(tmp_path / "state")
    two.advance()
    assert two.state.differences(whole("mixed", 1, "cpu").state) == []


@pytest.mark.gpu
@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_state_crosses_to_another_device_and_back(precision: str, tmp_path: Path):
    host, device, back = (impact(precision, device=name) for name in ("cpu", "cuda:0", "cpu"))
    host.advance(until=100)
    host.save(tmp_path / "host")
    device.load(tmp_path / "host")
    device.save(tmp_path / "device")
    back.load(tmp_path / "device")
    assert set(device.state.differences(host.state)) <= {"speed_square"}  # of all nodes on a GPU
    assert set(back.state.differences(host.state)) <= {"speed_square"}
    assert max_speed(back.solver, back.state) == max_speed(host.solver, host.state)
    device.state.assign(whole(precision, 1, "cpu").state)
    assert set(device.state.differences(whole(precision, 1, "cpu").state)) <= {"speed_square"}


def test_an_impact_that_is_over_stays_as_it_is():
    found = impact()
    found.advance()
    for until in (None, 10, found.steps.count):
        found.advance(until)
        assert found.state.differences(whole("mixed", 1, "cpu").state) == []


def test_a_state_from_before_a_guard_stopped_the_impact_goes_on(tmp_path: Path):
    short = begun(scene(impact=replace(scene().impact, energy_tolerance=1e-6)))
    short.save(tmp_path / "state")
    short.advance()
    steps, (words,) = short.state.steps, short.stopped
    assert words is not None and words.startswith("energy imbalance")
    short.advance()
    assert short.state.steps == steps
    short.load(tmp_path / "state")
    assert short.stopped == [None]
    short.advance()
    assert short.stopped == [words]


def midway() -> State:
    found = impact()
    found.advance(until=60)
    return found.state


def test_a_copy_is_the_same_and_shares_nothing_that_changes():
    state = midway()
    copy = state.copy()
    assert copy.differences(state) == []
    mine, others = state.arrays(), copy.arrays()
    assert not {array.ptr for array in mine.values() if array.size} & {array.ptr for array in others.values()}
    copy.scenes[0].sums.append(copy.scenes[0].sums[0])
    copy.scenes[0].peaks += 1.0
    assert copy.differences(state) == ["scenes/0/sums", "scenes/0/peaks"]


def test_differences_names_each_array_and_assign_takes_over_all():
    state = midway()
    copy = state.copy()
    for name, array in copy.arrays().items():
        if array.size:
            values = array.numpy()
            values.view(np.uint8).reshape(-1)[0] ^= 1
            array.assign(values)
            assert copy.differences(state) == [name]
            copy.assign(state)
            assert copy.differences(state) == []
    copy.steps += 1
    copy.scenes[0].exchanged = -copy.scenes[0].exchanged
    assert copy.differences(state) == ["steps", "scenes/0/exchanged"]
    copy.assign(state)
    assert copy.differences(state) == []


def begin(found: Impact) -> State:
    """A new state, ready for its first step."""
    state = found.solver.new_state()
    found.solver.begin(state)
    found.solver.start(state)
    return state


def advance(found: Impact, state: State, count: int) -> None:
    """So many times a search, a record and some steps."""
    for _ in range(count):
        found.solver.search(state)
        found.solver.record_and_step(state, 5)
        found.solver.step(state, 7)


@pytest.mark.parametrize("threads", [1, 2])
def test_two_states_of_a_solver_advance_independently(threads: int):
    found = impact(threads=threads)
    one, other = found.state, found.state.copy()
    start = other.copy()
    advance(found, one, 3)
    assert other.differences(start) == []
    advance(found, other, 1)
    assert "u" in other.differences(one)
    advance(found, one, 1)
    advance(found, other, 3)
    assert one.steps == other.steps == 48
    assert one.differences(other) == []


def test_the_solver_keeps_nothing_of_a_state():
    found = impact()
    state = begin(found)
    start = state.copy()
    advance(found, state, 4)
    end = state.copy()
    state.assign(start)
    assert state.differences(start) == []
    advance(found, state, 4)
    assert state.differences(end) == []
    assert begin(found).differences(start) == []


def others() -> dict[str, mca.Scene]:
    """Scenes that differ in one thing."""
    base = scene()
    low, *more = base.bodies
    (contact,), (drive,), (hinge,) = base.contacts, base.prescribed, base.joints
    return {
        "velocity": scene(bodies=(replace(low, velocity=(1.0, -20.0, 0.4)), *more)),
        "element": scene(bodies=tuple(replace(body, element="hex8r") for body in base.bodies)),
        "kinematics": scene(bodies=tuple(replace(body, kinematics="finite") for body in base.bodies)),
        "gravity": scene(gravity=(0.0, -9.7, 0.0)),
        "friction": scene(contacts=(replace(contact, mu=0.3),)),
        "drive": scene(prescribed=(replace(drive, velocities=(-20.0, -21.0)),)),
        "fixed": scene(fixed=(mca.Fixed(body="plate", nodes="ymin", axes="xy"),)),
        "joint": scene(joints=(replace(hinge, nodes="ends"),)),
        "duration": scene(impact=replace(base.impact, duration=1.21e-4)),
    }


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The state of `scene` before its first step."""
    path = tmp_path_factory.mktemp("start") / "state"
    begun(scene()).save(path)
    return path


def refuses(found: Impact, path: Path, words: str) -> None:
    """Loading is refused in one sentence, and changes nothing."""
    before = found.state.copy()
    with pytest.raises(RequestError, match=rf"^state = '{re.escape(str(path))}': [^\n]*{words}[^\n]*$"):
        found.load(path)
    assert found.state.differences(before) == []


@pytest.mark.parametrize("change", others())
def test_a_state_of_another_model_or_time_step_is_refused(change: str, start: Path):
    refuses(begun(others()[change]), start, "another model, precision or time step; use the run's own")


def test_a_state_of_another_precision_is_refused(start: Path):
    refuses(impact("float64"), start, "another model, precision or time step")


def test_missing_and_damaged_files_are_refused(start: Path, tmp_path: Path):
    found, intact = impact(), start.read_bytes()
    refuses(found, tmp_path / "state", "there is no such file")
    path = tmp_path / "damaged"
    middle = len(intact) // 2
    flipped = intact[:middle] + bytes([intact[middle] ^ 255]) + intact[middle + 1 :]
    for damaged in (b"", b"no archive", intact[:middle], flipped):
        path.write_bytes(damaged)
        refuses(found, path, "damaged")
    with np.load(start) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, array in (("u", None), ("u", arrays["u"][:-1]), ("scenes/0/peaks", None), ("header", arrays["u"])):
        with path.open("wb") as file:
            np.savez(file, **{k: a for k, a in (arrays | {name: array}).items() if a is not None})
        refuses(found, path, "damaged")


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fail(file, **arrays):
        file.write(b"PK")
        raise OSError(28, "No space left on device")

    found, path = impact(), tmp_path / "state"
    with monkeypatch.context() as patch:
        patch.setattr(np, "savez", fail)
        with pytest.raises(OSError, match="No space"):
            found.save(path)
        assert list(tmp_path.iterdir()) == []
        path.write_bytes(b"older")
        with pytest.raises(OSError, match="No space"):
            found.save(path)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"older"]
    found.save(path)
    found.load(path)


def described(kind: type) -> dict[str, str]:
    """What a class says of each of its attributes; what it says before the first holds for all."""
    doc = " ".join((kind.__doc__ or "").split())
    if "Attributes:" in doc:
        return entries(inspect.getdoc(kind) or "")
    head, *parts = re.split(r"(?<!\S)((?:\w+, )*\w+): ", doc)
    found = zip(parts[::2], parts[1::2], strict=True)
    return {name: f"{text} {head}" for names, text in found for name in names.split(", ")}


def holders() -> list:
    """Every array of a state, with the class that describes it."""
    state = whole("mixed", 1, "cpu").state
    parts = [state, *state.elements, state.contacts[0], state.contacts[0].spring, state.constraints, state.loads]
    found = []
    for part in parts:
        if part is state.contacts[0].spring:
            named = {name: getattr(part, name) for name in Spring.vars}
            kind: type = Spring.cls
        else:
            kind = type(part)
            named = {f.name: getattr(part, f.name) for f in fields(part)}
        found += [(kind, name, value) for name, value in named.items() if isinstance(value, wp.array)]
    return found


UNIT = re.compile(r"\[(-|[\w^/ -]+)\]")


def test_every_array_says_its_unit_shape_and_dtype():
    """As they are, too: the number of axes and the dtype."""
    seen = set()
    for kind, name, array in holders():
        text = described(kind)[name]
        assert UNIT.search(text), f"{kind.__name__}.{name} has no unit"
        shape = re.search(r"shape \(([^)]*)\)", text)
        assert shape, f"{kind.__name__}.{name} has no shape"
        assert len([axis for axis in shape[1].split(",") if axis.strip()]) == array.ndim, name
        if kind is not Spring.cls:  # which is declared with its dtypes
            assert re.search(rf"\b{array.dtype.__name__}\b", text), f"{kind.__name__}.{name} has no dtype"
        seen.add(kind)
    assert seen == {State, ElementState, ContactState, ConstraintState, LoadState, Spring.cls}


def test_every_record_says_its_unit_and_arrays_their_shape_and_dtype():
    said, records = described(SceneRecords), whole("mixed", 1, "cpu").state.scenes[0]
    for name, array in records.arrays().items():
        assert name in ("sums",) or UNIT.search(said[name]), name
        if isinstance(getattr(records, name), list | np.ndarray):
            assert array.dtype.name in said[name] and "shape (" in said[name], name
    assert {f.name for f in dataclasses.fields(records)} == set(said)
