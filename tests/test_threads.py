"""Threads: the same figures for any number of them, bad numbers, and failures while they run."""

import os
import platform
import threading
from ctypes import CFUNCTYPE, c_bool, c_void_p
from pathlib import Path
from types import SimpleNamespace

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


def test_searches_of_general_contact_are_the_same_bit_for_bit():
    """Edges and corners of a tilted box slide over the edge of another."""
    metal = mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
    low = mca.Box(size=(0.03, 0.01, 0.03), divisions=(9, 3, 9), origin=(-0.015, -0.01, -0.015))
    high = mca.Box(size=(0.01, 0.01, 0.01), divisions=(7, 7, 7), origin=(-0.005, -0.005, -0.005))
    place = {"rotation": (0.0, 0.0, 0.6), "position": (0.012, 0.005 * (np.cos(0.6) + np.sin(0.6)) + 1e-5, 0.001)}
    bodies = (
        mca.Body(name="low", geometry=low, material=metal),
        mca.Body(name="high", geometry=high, material=metal, velocity=(20.0, -10.0, 3.0), **place),
    )
    impact = mca.ImpactPhase(duration=3e-5, output_interval=1e-6)
    made = mca.Scene(name="edges", bodies=bodies, contacts=(mca.ContactAll(mu=0.3),), impact=impact)
    one, *others = [mca.run(made, threads=count) for count in (1, 2, 5)]
    assert one.summary["extremes"]["F_n_max"] > 100.0
    for other in others:
        assert other.summary["threads"] > 1
        for name in one.history:
            assert np.array_equal(one[name], other[name], equal_nan=True), name


def test_all_cores_by_default_and_one_for_small_models(monkeypatch):
    monkeypatch.setattr(threads, "GROUP", Path("/nowhere"))
    assert threads.thread_count(None) == len(os.sched_getaffinity(0))
    monkeypatch.setattr(solver, "RANGE", 10**6)
    assert mca.run(scene(), duration=2e-6, threads=2).summary["threads"] == 1


@pytest.mark.parametrize(
    ("files", "most"),
    [
        ({"cpu.max": "150000 100000\n"}, 2),
        ({"cpu.max": "10000 100000\n"}, 1),
        ({"cpu.max": "max 100000\n"}, 64),
        ({"cpu/cpu.cfs_quota_us": "300000\n", "cpu/cpu.cfs_period_us": "100000\n"}, 3),
        ({"cpu/cpu.cfs_quota_us": "-1\n", "cpu/cpu.cfs_period_us": "100000\n"}, 64),
        ({}, 64),
    ],
)
def test_a_quota_of_a_container_bounds_the_cores(files, most, tmp_path, monkeypatch):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(threads, "GROUP", tmp_path)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: range(64))
    assert threads.thread_count(None) == most
    assert threads.thread_count(5) == 5


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
    assert threading.active_count() <= before


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_threads_end_with_a_run_that_an_interrupt_or_a_callback_ends(error):
    """They waited until Python looked for garbage."""

    def progress(stage: str, share: float) -> None:
        if share > 0.2:
            assert threading.active_count() == before + 2
            raise error

    before = threading.active_count()
    with pytest.raises(error) as held:  # as a notebook holds the last error
        mca.run(scene(), duration=3e-4, threads=3, progress=progress)
    assert threading.active_count() == before
    del held


@wp.kernel(enable_backward=False)
def count_turn(first: int, count_out: wp.array(dtype=wp.int32)):
    """Count the turns of an entry."""
    i = first + wp.tid()
    count_out[i] = count_out[i] + 1


@wp.kernel(enable_backward=False)
def add_up(first: int, count: wp.array(dtype=wp.int32), sum_out: wp.array(dtype=wp.float64)):
    """Add to an entry what it finds of all after the stage before."""
    i = first + wp.tid()
    for k in range(count.shape[0]):
        sum_out[i] = sum_out[i] + wp.float64(count[k])


def program_of(number: int, size: int) -> tuple[threads.Program, wp.array, wp.array]:
    """Two stages: entries count their turns, then each adds up those of all."""
    count, total = wp.zeros(size, dtype=wp.int32, device="cpu"), wp.zeros(size, dtype=wp.float64, device="cpu")

    def body(split: threads.Split) -> None:
        def turn(part: slice) -> None:
            wp.launch(count_turn, part.stop - part.start, inputs=[part.start], outputs=[count])

        def add(part: slice) -> None:
            wp.launch(add_up, part.stop - part.start, inputs=[part.start, count], outputs=[total])

        split(size, turn, 64)
        split(size, add, 64)

    with wp.ScopedDevice("cpu"):
        return threads.Program(number, body), count, total


@pytest.mark.parametrize(("number", "stages"), [(1, [1]), (2, [8, 8]), (3, [12, 12]), (16, [16, 16])])
def test_each_stage_follows_the_one_before_it_and_leaves_out_nothing(number, stages):
    """Also with far more threads than cores, which hold each other up."""
    size, repeats, pool = 1100, 50, threads.Pool(number)
    program, count, total = program_of(number, size)
    assert [len(stage) for stage in program.stages] == stages
    for k in range(1, 4):
        pool.run(program, repeats)
        assert (count.numpy() == k * repeats).all()
        assert (total.numpy() == size * sum(range(k * repeats + 1))).all()
    other, others, _ = program_of(number, size)
    pool.run(other, 2)
    assert (others.numpy() == 2).all() and (count.numpy() == 3 * repeats).all()
    pool.close()


@pytest.mark.parametrize("number", [2, 3])
def test_no_graph_is_taken_twice_or_left(number):
    """Short graphs, so that threads often want the same one at the same time."""
    size, stages, repeats, pool = 1024, 4, 50_000, threads.Pool(number)
    count = wp.zeros(size, dtype=wp.int32, device="cpu")

    def turn(part: slice) -> None:
        wp.launch(count_turn, part.stop - part.start, inputs=[part.start], outputs=[count])

    def body(split: threads.Split) -> None:
        for _ in range(stages):
            split(size, turn, 8)

    with wp.ScopedDevice("cpu"):
        program = threads.Program(number, body)
    run = threading.Thread(target=pool.run, args=(program, repeats), daemon=True)
    run.start()
    run.join(60.0)  # a graph that is lost is waited for without end
    assert not run.is_alive()
    assert (count.numpy() == stages * repeats).all()
    pool.close()


def test_a_graph_that_cannot_be_replayed_reaches_the_caller(monkeypatch):
    program, *_ = program_of(2, 256)
    fails = CFUNCTYPE(c_bool, c_void_p)(lambda graph: False)
    monkeypatch.setattr(threads, "_core", lambda: SimpleNamespace(wp_apic_cpu_replay_state=fails))
    pool = threads.Pool(2)
    with pytest.raises(RuntimeError, match="replay"):
        pool.run(program, 3)


def test_threads_end_with_their_pool():
    before, pool = threading.active_count(), threads.Pool(3)
    pool.run(program_of(3, 256)[0], 1)
    assert threading.active_count() == before + 2
    pool.close()
    assert threading.active_count() == before
    pool.run(program_of(3, 256)[0], 1)
    assert threading.active_count() == before + 2
    del pool
    assert threading.active_count() == before


@wp.kernel(enable_backward=False)
def multiply(first: int, factor: wp.array(dtype=wp.float32), product_out: wp.array(dtype=wp.float32)):
    """Product of each entry with the one before it."""
    i = first + wp.tid()
    product_out[i] = factor[i] * factor[wp.max(i - 1, 0)]


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="other processors are not told")
@pytest.mark.parametrize("number", [1, 3])
def test_subnormal_numbers_are_zero_in_programs_and_nowhere_else(number):
    factor = wp.array(np.tile([1e-38, 0.1], 2000), dtype=wp.float32, device="cpu")
    inside, outside = wp.zeros_like(factor), wp.zeros_like(factor)

    def body(split: threads.Split) -> None:
        def part(some: slice) -> None:
            wp.launch(multiply, some.stop - some.start, inputs=[some.start, factor], outputs=[inside])

        split(len(factor), part, 64)

    with wp.ScopedDevice("cpu"):
        program, pool = threads.Program(number, body), threads.Pool(number)
    pool.run(program, 100)
    wp.launch(multiply, len(factor), inputs=[0, factor], outputs=[outside], device="cpu")
    assert (inside.numpy()[1:] == 0.0).all()
    assert (outside.numpy()[1:] > 0.0).all()
