"""Owns the tests of helpers: processes that make the scenes of a batch ready side by side."""

import os
import pickle
import time
from dataclasses import dataclass, replace

import numpy as np
import pytest
from helper_jobs import place_of

import warp_mca as mca
from warp_mca.base import outside
from warp_mca.base.helpers import Helper, Helpers, travel
from warp_mca.phases import by_helpers, prepare
from warp_mca.phases.settings import Settings
from warp_mca.system.state import digest
from warp_mca.watch import held, looks
from warp_mca.watch.passing import DEPTH, Watch, skins_of

THREADS = 3  # the least that have helpers


@pytest.fixture
def helpers():
    made = Helpers()
    yield made
    made.end()


@pytest.fixture
def at_once(monkeypatch):
    """Helpers begin whatever they save; yields which scenes they prepared, and what they did for all that they hold."""
    prepared = []
    carry_out = by_helpers.HELPERS.carry_out

    def counted(function, jobs, data, here, count, told=None):
        if function is by_helpers.tell_one:
            prepared.append("told")
            return carry_out(function, jobs, data, no_one, count)
        return carry_out(function, jobs, data, here, count, lambda k, a: (told(k, a), a[1] and prepared.append(k)))

    class Counted(held.Question):
        def __init__(self, function, homes, *more):
            super().__init__(function, homes, *more)
            self.name = function.__name__ if homes else ""

        def answers(self):
            found = super().answers()
            prepared.append("lost" if any(item is None for item in found) else self.name)
            return found

    monkeypatch.setattr(by_helpers, "Question", Counted)
    monkeypatch.setattr(looks, "Question", Counted)
    monkeypatch.setattr(outside, "_REGISTERED", [])  # by other tests
    monkeypatch.setattr(by_helpers, "STARTING", -1.0)
    monkeypatch.setattr(by_helpers, "SENDING", -1.0)
    monkeypatch.setattr(by_helpers.HELPERS, "carry_out", counted)
    yield prepared
    by_helpers.HELPERS.end()


def carry_out(helpers: Helpers, count: int, here) -> list:
    return helpers.carry_out(place_of, count, lambda k: pickle.dumps((k,)), here, 2)


def wait_for(helpers: Helpers) -> None:
    """Both helpers have begun."""
    seen: set[int] = set()
    while len(seen) < 2:
        seen |= {process for _, process in carry_out(helpers, 3, lambda k: (k, time.sleep(0.05) or 0)) if process}


def test_answers_come_in_order_from_several_processes(helpers):
    wait_for(helpers)
    numbers, processes = zip(*carry_out(helpers, 3, place_of), strict=True)
    assert numbers == (0, 1, 2)
    assert os.getpid() not in processes and 1 <= len(set(processes)) <= 2 == helpers.count


def test_this_process_does_what_fails_and_what_killed_helpers_had(helpers):
    wait_for(helpers)
    found = carry_out(helpers, 8, lambda k: (k, os.getpid()))
    assert [k for k, _ in found] == list(range(8)) and found[3][1] == os.getpid()
    assert found[5][1] == os.getpid() and helpers.count == 0  # job 5 killed both


def test_what_this_process_raises_for_the_first_job_that_fails_is_raised(helpers):
    with pytest.raises(ValueError, match=r"^3$"):
        carry_out(helpers, 5, refused)


def refused(number: int) -> None:
    if number > 2:
        raise ValueError(number)


def test_helpers_begin_anew_where_the_environment_changed(helpers, monkeypatch):
    wait_for(helpers)
    before = {process for _, process in carry_out(helpers, 2, place_of)}
    monkeypatch.setenv("WARP_MCA_TEST", "1")
    assert helpers.count == 0
    wait_for(helpers)
    assert not before & {process for _, process in carry_out(helpers, 2, place_of)}


def test_helpers_see_no_gpu(helpers, monkeypatch):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "0")
    wait_for(helpers)
    data, here = pickle.dumps(("CUDA_VISIBLE_DEVICES",)), lambda k: "0"
    assert "" in helpers.carry_out(os.getenv, 4, lambda k: data, here, 2)


def test_helpers_change_no_bit_of_a_scene(at_once):
    """While they begin, and when they are there; what is told of stages and of models is told of theirs, too."""
    scenes = [
        mca.make_scene("single_link", theta=angle, axial=6, plate_core=2) for angle in (60.0, 61.0, 62.0, 63.0, 64.0)
    ]

    def prepared(threads: int) -> tuple[list[tuple[object, ...]], prepare.Clock]:
        begun: list[mca.Scene] = []
        told = lambda scene, model, meshes: begun.append(scene)  # noqa: E731
        request = prepare.Request(span=1e-5, settings=Settings("cpu", "mixed", threads), begun=told)
        ready = by_helpers.prepared(scenes, None, request)
        assert sorted(map(id, begun)) == sorted(map(id, scenes))
        assert all(item.scene is scene for item, scene in zip(ready, scenes, strict=True))
        parts = [(item.model, item.start, item.meshes["OA"], item.probes, item.sensors) for item in ready]
        return [(*map(digest, own), item.warnings) for own, item in zip(parts, ready, strict=True)], request.clock

    alone, _ = prepared(threads=2)
    assert not at_once
    while not at_once:
        found, clock = prepared(THREADS)
        assert found == alone
    assert clock.wall["rigid"] > 0.0 and clock.wall["mesh"] > 0.0 and time.perf_counter() - clock.last < 1.0


def test_skins_that_a_helper_makes_see_what_others_see():
    scene = mca.make_scene("single_link", axial=6, plate_core=2)
    found, _ = by_helpers.prepare_one(pickle.dumps(scene), {}, 1e-5, Settings("cpu", "mixed", 1))
    ready = pickle.loads(pickle.dumps(found))
    looks = []
    for skins in (ready.skins, ()):
        watch = Watch(ready.scene, ready.meshes, ready.model, 1e-8, 1e-5, skins)
        x, pressed, passed = ready.model.X[watch.nodes], np.zeros(len(ready.model.passes)), np.zeros((0, 6))
        for down in (0.0, 2e-3, 4e-3):
            link = np.arange(len(x)) < len(skins_of(ready.scene, ready.meshes, ready.model)[0].nodes)
            moved = x - down * link[:, None] * [0.0, 1.0, 0.0]
            passed, steps = watch.look(moved, 1.0, pressed, down, passed)
            looks.append((passed.tobytes(), steps))
        assert passed[:, DEPTH].max() > 1e-3
    assert len(ready.skins) == 2 and looks[:3] == looks[3:]


def no_one(number: int) -> None:
    raise AssertionError(f"helpers do not tell of scene {number}")


@pytest.mark.parametrize("most", [0, held.MOST_CELLS], ids=["sent to any", "held by theirs"])
def test_helpers_see_and_tell_the_same(at_once, monkeypatch, most):
    """Of boxes that pass through each other and spin; so where helpers hold scenes, and where these are lost."""
    monkeypatch.setattr(by_helpers, "MOST_HELD", most)
    metal, box = mca.Elastic(E=2e9, nu=0.3, rho=1000.0), mca.Box(size=(0.01, 0.01, 0.01), divisions=(1, 1, 1))
    low = mca.Body(name="low", geometry=box, material=metal, element="hex8", angular_velocity=(0.0, 50.0, 0.0))
    high = mca.Body(
        name="high", geometry=box, material=metal, position=(0.001, 0.0102, 0.0), velocity=(0.0, -30.0, 0.0)
    )
    scene = mca.Scene(name="pair", bodies=(low, high), impact=mca.ImpactPhase(duration=1e-4, output_interval=1e-5))
    alone = mca.run(scene, threads=2)
    assert any("no contact keeps" in said for said in alone.warnings) and len(alone.warnings) > 1
    wanted = {"look_at_bending", "look_at_skins", "tell"} if most else {"told"}
    late = time.monotonic() + 60.0  # helpers may take seconds to begin
    while not wanted <= set(at_once) and time.monotonic() < late:
        results = mca.run_batch([scene] * (THREADS + 2), threads=THREADS)
        assert {result.warnings for result in results} == {alone.warnings}
    assert wanted <= set(at_once) and "lost" not in at_once
    ask = Helper.ask

    def lost(helper, *more):
        helper.process.kill()
        helper.process.wait()
        return ask(helper, *more)

    monkeypatch.setattr(Helper, "ask", lost)
    results = mca.run_batch([scene] * (THREADS + 2), threads=THREADS)
    assert {result.warnings for result in results} == {alone.warnings} and ("lost" in at_once) == bool(most)


def test_errors_of_a_batch_name_the_first_scene(at_once):
    scene = mca.make_scene("single_link")
    wrong = [replace(scene.contacts[0], slave=mca.Surface(body="OA", nodes=name)) for name in ("there", "nowhere")]
    scenes = [scene] * 3 + [replace(scene, contacts=(contact,)) for contact in wrong]
    with pytest.raises(mca.RequestError) as alone:
        mca.run_batch(scenes, duration=1e-6, threads=2)
    with pytest.raises(mca.RequestError, match=r"^scenes\[3\]: .*there") as found:
        mca.run_batch(scenes, duration=1e-6, threads=THREADS)
    assert str(found.value) == str(alone.value)


@dataclass(frozen=True)
class OwnBox:
    """A recipe of the user's own."""

    height: float

    def build(self) -> mca.Mesh:
        return mca.Box(size=(1.0, self.height, 1.0), divisions=(1, 1, 1)).build()


def test_helpers_do_not_know_what_is_not_of_the_package(at_once, monkeypatch):
    body = mca.Body(name="it", geometry=OwnBox(1.0), material=mca.Elastic(E=2e11, nu=0.3, rho=7850.0))
    scene = mca.Scene(name="one", bodies=(body,), impact=mca.ImpactPhase(duration=1e-5))
    assert not travel(pickle.dumps(scene))
    plain = replace(scene, bodies=(replace(body, geometry=OwnBox(1.0).build()),))
    assert travel(pickle.dumps(plain))
    mca.run_batch([scene] * 4, threads=THREADS)
    monkeypatch.setattr(outside, "_REGISTERED", ["voce"])  # a material of this process alone
    mca.run_batch([plain] * 4, threads=THREADS)
    assert not at_once
