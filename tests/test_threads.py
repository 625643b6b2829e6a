"""Threads: the same figures for any number of them, bad numbers, and failures while they run."""

import os
import platform
import threading

import numpy as np
import pytest
import warp as wp

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.step import solver
from warp_mca.system import threads

pytestmark = pytest.mark.usefixtures("short_ranges")


def scene(element: str = "hex8", **impact: float | None) -> mca.Scene:
    """Two hinged bars that yield fly aslant into a rough plate; no number of elements is a multiple of a range."""
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=5e6, E_t=7e9, beta=0.3)
    flight = {"material": metal, "velocity": (1.0, -3.0, 0.5), "element": element}
    bar = mca.Box(size=(0.02, 0.06, 0.02), divisions=(9, 9, 9), origin=(-0.011, 0.0, -0.012))
    plate = mca.Box(size=(0.06, 0.03, 0.06), divisions=(9, 5, 9), origin=(-0.03, -0.03, -0.03))
    return mca.Scene(
        name="hinged",
        bodies=(
            mca.Body(name="low", geometry=bar, **flight),
            mca.Body(name="high", geometry=bar, position=(0.0, 0.06, 0.0), **flight),
            mca.Body(name="plate", geometry=plate, material=metal, element=element),
        ),
        joints=(mca.Revolute(name="A", body="low", at=(-0.011, 0.06, 0.0), other="high", other_at=(-0.011, 0.0, 0.0)),),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="low", nodes="ymin"), master=mca.Surface(body="plate", nodes="ymax"), mu=0.4
            ),
        ),
        fixed=(mca.Fixed(body="plate", nodes="ymin"),),
        gravity=(0.0, -9.8, 0.0),
        impact=mca.ImpactPhase(**{"duration": 1e-5, "output_interval": 1e-6} | impact),
        tip=mca.Point(body="low", at=(0.0, 0.0, 0.0)),
    )


@pytest.mark.parametrize(
    ("element", "interval", "viscosity"),
    [
        ("hex8", 1e-6, None),
        ("hex8r", 1e-6, None),
        ("tet4", 1e-6, None),
        ("tet10", 1e-6, None),
        ("hex8", 1e-5, None),
        ("hex8", 1e-6, 0.06),
        ("tet4", 1e-6, 0.06),
    ],
)
def test_histories_are_the_same_bit_for_bit(element, interval, viscosity):
    """Also where checks lie between two rows."""
    made = scene(element, output_interval=interval, bulk_viscosity=viscosity)
    one, *others = [mca.run(made, threads=count) for count in (1, 2, 3)]
    assert (one.summary["energy"]["damping"] > 0.0) == (viscosity is not None)
    assert one.summary["extremes"]["F_n_max"] > 100.0
    assert one.summary["max_plastic_strain"] > 1e-4
    assert one["E_friction"][-1] > 0.0
    assert one.summary["threads"] == 1
    for count, other in enumerate(others, 2):
        assert other.summary["threads"] == count
        for name in one.history:
            assert np.array_equal(one[name], other[name], equal_nan=True), name
        for name in ("max_plastic_strain", "energy", "joint_impulse", "max_penetration", "extremes"):
            assert one.summary[name] == other.summary[name], name


def test_all_cores_by_default_and_one_for_small_models(monkeypatch):
    assert threads.thread_count(None) == len(os.sched_getaffinity(0))
    monkeypatch.setattr(solver, "RANGE", 10**6)
    assert mca.run(scene(), duration=2e-6, threads=2).summary["threads"] == 1


@pytest.mark.parametrize("value", [0, -1, 1.5, True, "2"])
def test_bad_numbers_are_refused(value):
    with pytest.raises(mca.RequestError, match="threads"):
        mca.run(scene(), threads=value)


@pytest.mark.parametrize("value", ["0", "-2", "many", "1.5"])
def test_bad_numbers_on_the_command_line(value, tmp_path, capsys):
    assert main(["run", "single_rod", f"--threads={value}", "--out", str(tmp_path / "out")]) == 2
    assert "threads" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_guard_stops_a_run_with_threads():
    before = threading.active_count()
    with pytest.raises(mca.GuardError, match="energy"):
        mca.run(scene(energy_tolerance=1e-12), threads=3)
    assert threading.active_count() <= before + 2  # none but those of a solver that is not collected yet


@pytest.mark.parametrize("culprit", range(6))
def test_what_a_task_raises_reaches_the_caller_and_ends_the_threads(culprit):
    pool = threads.Pool(3)
    done: list[int] = []

    def task(k: int) -> None:
        if k == culprit:
            raise ZeroDivisionError
        done.append(k)

    pool.run([lambda k=k: done.append(k) for k in range(7)])
    assert sorted(done) == list(range(7))
    with pytest.raises(ZeroDivisionError):
        pool.run([lambda k=k: task(k) for k in range(6)])
    assert not any(worker.is_alive() for worker in pool._workers)


def test_threads_end_with_their_pool():
    pool = threads.Pool(2)
    workers = pool._workers
    del pool
    for worker in workers:
        worker.join(timeout=10.0)
        assert not worker.is_alive()


def smallest() -> float:
    """A subnormal number, made here and now."""
    return float(np.float32(1e-38) * np.float32(0.1))


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="other processors are not told")
def test_subnormal_numbers_are_zero_in_steps_and_nowhere_else():
    assert smallest() > 0.0
    flush, outer = threads.Flush(), threads.Flush()
    with flush:
        assert smallest() == 0.0
    assert smallest() > 0.0
    with outer:
        with flush:
            pass
        assert smallest() == 0.0  # as it was before
    with pytest.raises(KeyError), flush:
        raise KeyError
    assert smallest() > 0.0
    pool, found = threads.Pool(2), {}
    meet = threading.Barrier(2)

    def task() -> None:
        meet.wait(10.0)  # so that each thread takes one
        found[threading.current_thread().name] = smallest()

    pool.run([task, task])
    pool.close()
    assert sorted(value > 0.0 for value in found.values()) == [False, True]  # a worker's, and that of this thread


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="other processors are not told")
@pytest.mark.parametrize("count", [1, 2])
def test_steps_take_subnormal_numbers_for_zero(count, monkeypatch):
    """Each replay of a step's graphs does, and leaves the thread as it was."""
    seen = []
    replay = wp.capture_launch

    def watched(*args: object, **more: object) -> None:
        seen.append(smallest())
        replay(*args, **more)

    monkeypatch.setattr(wp, "capture_launch", watched)
    monkeypatch.setattr(threads, "_task", lambda graph: lambda: watched(graph))
    mca.run(scene(), threads=count)
    assert len(seen) > 10
    assert set(seen) == {0.0}
    assert smallest() > 0.0
