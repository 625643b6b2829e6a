"""Whole runs: bar theory, precision, repetition, guards, and that a scene pays only for what it has."""

import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import warp as wp
from impacts import begun, finished, prepared, result_of

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.phases.division import divide
from warp_mca.phases.settings import settings_of
from warp_mca.step import device

ALUMINIUM = {"E": 70e9, "nu": 0.0, "rho": 2700.0}
C = np.sqrt(70e9 / 2700.0)


def bar(material=None, *, position=(0.0, 0.0, 0.0), penalty=1.0, divisions=(100, 1, 1), **impact):
    """A bar of 0.2 m, nu = 0, that runs into a wall at 1 m/s."""
    point = (0.2 + position[0], position[1], position[2])
    return mca.Scene(
        name="bar",
        bodies=(
            mca.Body(
                name="bar",
                geometry=mca.Box(size=(0.2, 0.01, 0.01), divisions=divisions),
                material=material or mca.Elastic(**ALUMINIUM),
                position=position,
                velocity=(1.0, 0.0, 0.0),
            ),
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="bar", nodes="xmax"),
                master=mca.RigidPlane(point=point, normal=(-1, 0, 0)),
                penalty=penalty,
            ),
        ),
        impact=mca.ImpactPhase(**{"duration": 1.2e-4, "output_interval": 1e-6} | impact),
        tip=mca.Point(body="bar", at=(0.1, 0.0, 0.0)),
    )


def test_bar_follows_wave_theory():
    """F = rho c A v for 2 L / c; the middle stops when the front passes it."""
    result = mca.run(bar())
    plateau = result.F_n[(result.time > 1e-5) & (result.time < 7e-5)]
    assert plateau.mean() == pytest.approx(2700.0 * C * 1e-4, rel=2e-3)
    assert result.summary["contact_duration"] == pytest.approx(0.4 / C, rel=0.03)
    front = np.interp(-0.5, -result["tip_vx"][:40], result.time[:40])
    assert 0.1 / front == pytest.approx(C, rel=0.03)  # the wall's springs take half a microsecond to push
    assert result.summary["energy_error"] < 1e-3
    assert (result.F_n * result.time[1]).sum() == pytest.approx(2.0 * 2700.0 * 0.2e-4, rel=0.02)  # it flies back


def test_yielding_bar_carries_the_elastic_precursor_and_a_slower_plastic_wave():
    """Uniaxial bilinear bar, Karman and Taylor: the wall sees sigma_y + rho c_t (v - v_y), c_t = sqrt(E_t / rho)."""
    sigma_y, E_t = 8e6, 17.5e9
    v_y = sigma_y / (2700.0 * C)
    result = mca.run(bar(mca.J2Bilinear(**ALUMINIUM, sigma_y=sigma_y, E_t=E_t), divisions=(200, 2, 2)))
    wall = 1e-4 * (sigma_y + 2700.0 * np.sqrt(E_t / 2700.0) * (1.0 - v_y))
    assert result.F_n[(result.time > 1e-5) & (result.time < 6e-5)].mean() == pytest.approx(
        wall, rel=0.01
    )  # it spreads sideways
    plateau = (result.time > 2.4e-5) & (result.time < 3.4e-5)  # between the two waves at the middle
    assert result["tip_vx"][plateau].mean() == pytest.approx(1.0 - v_y, rel=0.02)
    assert result.summary["max_plastic_strain"] > 0.0
    assert result.summary["energy_error"] < 3e-4  # 2.9e-4 with hex8 as well


def test_precisions_agree():
    one, two = (mca.run(bar(), precision=name).F_n for name in ("mixed", "float64"))
    assert one == pytest.approx(two, abs=1e-4 * two.max())


def test_runs_repeat_bit_for_bit():
    one, two = mca.run(bar()), mca.run(bar())
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one.history)


def test_last_row_is_the_end_whatever_the_interval():
    result = mca.run(bar(), duration=1.05e-5)
    assert result.time[-1] == pytest.approx(1.05e-5, rel=1e-12)
    assert result.summary["simulated_time"] == pytest.approx(1.05e-5, rel=1e-12)


def test_step_beyond_the_limit_blows_up_and_is_caught(monkeypatch):
    """The largest element eigenvalue bounds the bar's own closely: 10 % more than the stable step is too much."""
    mca.run(bar(time_step_scale=1.0))
    scene = bar()
    object.__setattr__(scene.impact, "time_step_scale", 1.1)
    with pytest.raises(mca.GuardError, match="energy"):
        mca.run(scene)


def test_free_fall_is_a_parabola_to_the_last_digit():
    """Central differences are exact for it, if they start from the velocity of half a step before t = 0."""
    falling = mca.Scene(**{**vars(bar()), "contacts": (), "gravity": (0.0, -1e4, 0.0)})
    impact = finished(falling)
    summary = result_of(impact).summary
    t = 1.2e-4 + summary["dt"]
    assert impact.state.u.numpy() == pytest.approx(np.broadcast_to([t, -0.5e4 * t**2, 0.0], (404, 3)), rel=1e-10)
    assert summary["energy_error"] < 1e-12


@pytest.mark.filterwarnings("ignore:overflow")
def test_moduli_beyond_the_elements_precision_are_refused():
    """Stress of 1e39 Pa is beyond float32; the time step was blamed."""
    stiff = bar(mca.Elastic(E=1e39, nu=0.0, rho=2700e28))
    with pytest.raises(RequestError, match=r"modulus \[Pa\] = 3\.33.*e\+38: .*--precision float64"):
        mca.run(stiff, duration=1e-6)
    assert mca.run(stiff, duration=1e-6, precision="float64").summary["energy_error"] < 1e-3


def test_energy_tolerance_stops_the_run():
    with pytest.raises(mca.GuardError, match=r"energy imbalance .* exceeds energy_tolerance = 1e-09"):
        mca.run(bar(energy_tolerance=1e-9))


def crushed(duration: float) -> mca.Scene:
    """One end of a box is pushed through the other, which takes 10 ms."""
    return mca.Scene(
        name="crush",
        bodies=(
            mca.Body(
                name="box",
                geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 1, 1)),
                material=mca.Elastic(E=1e6, nu=0.0, rho=1000.0),
            ),
        ),
        fixed=(mca.Fixed(body="box", nodes="xmin"),),
        prescribed=(mca.Prescribed(body="box", nodes="xmax", axis="x", times=(0.0,), velocities=(-1.0,)),),
        impact=mca.ImpactPhase(duration=duration, output_interval=1e-4, energy_tolerance=1e9),
    )


def test_bar_that_sinks_into_its_wall_stops_the_run():
    with pytest.raises(mca.GuardError, match="sank deeper"):
        mca.run(bar(penalty=1e-7, duration=1e-2, output_interval=1e-4))


def test_scene_too_far_from_the_origin_is_refused():
    with pytest.raises(RequestError, match=r"Body.position.*lost.*closer to the origin"):
        mca.run(bar(position=(1e9, 0.0, 0.0)))


def test_large_strain_is_warned_of():
    soft = mca.Elastic(E=5e4, nu=0.0, rho=2700.0)
    result = mca.run(bar(soft, duration=1e-2, output_interval=1e-4, energy_tolerance=1.0))
    assert any("strain reached" in warning for warning in result.warnings)


def launched(scene, monkeypatch):
    """Names of the kernels that a run launches."""
    names, launch = set(), wp.launch

    def note(kernel, *args, **kwargs):
        names.add(kernel.key.split("__locals__")[-1].strip("_"))
        return launch(kernel, *args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(wp, "launch", note)
        mca.run(scene, duration=4e-6)
    return names


def test_scene_launches_only_what_it_has(monkeypatch):
    free = mca.Scene(**{**vars(bar()), "contacts": ()})
    base = launched(free, monkeypatch)
    assert not {"advance_bound", "touch_plane", "touch_surface", "react", "sum_springs"} & base
    assert launched(bar(), monkeypatch) - base == {"touch_plane", "sum_springs"}
    joint = mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0))
    driven = mca.Prescribed(body="bar", nodes="xmax", axis="x", times=(0.0,), velocities=(0.0,))
    for bound in ({"joints": (joint,)}, {"prescribed": (driven,)}):
        assert launched(mca.Scene(**{**vars(free), **bound}), monkeypatch) - base == {"advance_bound"}


@pytest.mark.parametrize(
    ("material", "size"),
    [(mca.Elastic(**ALUMINIUM), 0), (mca.J2Bilinear(**ALUMINIUM, sigma_y=1e8, E_t=1e9), 48 * 100)],
    ids=["elastic", "plastic"],
)
def test_elastic_scene_keeps_no_history(material, size):
    (own,) = begun(bar(material)).state.elements
    assert own.history.size == size


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"material": mca.Elastic(E=1e10, nu=0.3, rho=1e-300)},
            r"largest eigenvalue of element 0 .* check their units",
        ),
        ({"penalty": 1e300}, r"largest eigenvalue of element \d+ .* check their units"),
        ({"output_interval": 1e-14}, r"output_interval = 1e-14: .* rows, a history holds"),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow")
def test_what_no_number_or_history_holds_is_refused(changes, words):
    """They ended in LinAlgError and OverflowError, or never."""
    with pytest.raises(mca.RequestError, match=words):
        mca.run(bar(**changes))


def test_a_duration_that_never_ends_is_refused():
    with pytest.raises(mca.RequestError, match=r"rows, a history holds"):
        mca.run(bar(), duration=1e8)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"duration": "1e-5"}, r"duration = '1e-5': give a finite time"),
        ({"duration": True}, r"duration = True: give a finite time"),
        ({"recorders": None}, r"recorders = None: give a list of recorders"),
        ({"recorders": ["a.rrd"]}, r"recorders\[0\] = 'a.rrd': give a recorder"),
        ({"meshes": {"bar": None}}, r"meshes\['bar'\] = None: give a finished Mesh"),
        ({"meshes": {"b": None, 5: None}}, r"meshes = \['b', 5\]: give a mesh of body bar too"),
        ({"meshes": 5}, r"meshes = 5: give a Mesh for each body"),
        ({"out": 5}, r"out = 5: name a folder"),
        ({"out": ""}, r"out = '': name a folder"),
        ({"out": "x" * 300}, r"out = 'x+': .*name another"),
        ({"threads": True}, r"threads = True: give a whole number"),
        ({"threads": 1.0}, r"threads = 1.0: give a whole number"),
        ({"progress": 5}, r"progress = 5: give a function"),
    ],
)
def test_another_kind_of_argument_is_refused_by_name(settings, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RequestError, match=words):
        mca.run(bar(), **settings)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("act", [mca.run, mca.mesh], ids=["run", "mesh"])
def test_a_name_is_no_scene(act):
    with pytest.raises(RequestError, match=r"scene = 'two_link': .*mca\.make_scene"):
        act("two_link")


def test_threads_may_be_a_number_of_numpy():
    assert mca.run(bar(), duration=1e-6, threads=np.int64(1)).summary["threads"] == 1


class Recipe:
    """A user's recipe, which makes its mesh by what it is given."""

    def __init__(self, build):
        self.build = build


@pytest.mark.parametrize(
    ("geometry", "words"),
    [
        (Recipe(lambda: 1 / 0), r"'Recipe': build\(\) failed with ZeroDivisionError: .*test_run\.py, line \d+"),
        (Recipe(lambda: None), r"build\(\) = None: return a warp_mca.Mesh"),
        (Recipe(5), r"build\(\) failed with TypeError"),
    ],
)
def test_a_recipe_that_fails_is_named_with_its_body(geometry, words):
    scene = bar()
    body = replace(scene.bodies[0], geometry=geometry)
    with pytest.raises(RequestError, match=rf"Body bar\.geometry.*{words}"):
        mca.mesh(replace(scene, bodies=(body,)))


def test_runs_of_more_steps_than_anyone_waits_for_are_refused():
    for scale in (1e-320, 1e-12):  # a step of 0 s, and one in which motion is lost in rounding besides
        with pytest.raises(
            RequestError, match=r"time step \[s\] = .*1e\+10 .*element \d+ of body bar .*time_step_scale"
        ):
            mca.run(bar(time_step_scale=scale))


@pytest.mark.parametrize("speed", [1e30, 1e200])
def test_bodies_too_fast_for_the_search_of_contact_are_refused_without_warnings(speed):
    scene = bar()
    ready = prepared(scene)
    fast = replace(
        ready.model,
        V=np.full_like(ready.model.V, speed),
        passes=(replace(ready.model.passes[0], plane=None, margin=1e-3),),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(RequestError, match=r"speed of the bodies = 1e\+\d+: .*check the unit"):
            divide(scene, fast, 1e-6)


def test_runs_of_two_threads_wait_for_each_other():
    """Warp captures graphs for the whole process: the second capture failed."""
    order = []

    def tell(stage, done):
        order.append(threading.get_ident())
        time.sleep(0.01)

    def one(k):
        run = [mca.run, lambda scene, **more: mca.run_batch([scene], **more)[0]][k]
        return run(bar(), duration=2e-6, progress=tell)

    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(one, range(2))
    assert sum(a != b for a, b in pairwise(order)) == 1
    assert np.array_equal(first.F_n, second.F_n)


def test_cuda_stands_for_all_gpus_of_a_sweep_and_for_the_first_elsewhere(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(device, "all_devices", lambda: ["cpu", "cuda:0", "cuda:1"])
    assert device.devices_named("cuda") == ["cuda:0", "cuda:1"]
    assert device.devices_named("cuda:1") == ["cuda:1"]
    assert settings_of("cuda", "mixed", 1).device == "cuda:0"
    monkeypatch.setattr(device, "all_devices", lambda: ["cpu"])
    with pytest.raises(RequestError, match=r"device = 'cuda'.*choose one of this machine: cpu"):
        settings_of("cuda", "mixed", 1)


@pytest.mark.gpu
def test_a_run_takes_the_device_that_a_sweep_takes():
    one, other = (mca.run(bar(duration=2e-6), device=name).summary for name in ("cuda", "cuda:0"))
    assert one["device"] == other["device"]
