"""Gravity settled before the impact: bodies rest on what bears them, their loss is booked, and the impact follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.phases import carry_out
from warp_mca.phases.checkpoint import FILE, Checkpoint
from warp_mca.scene import model_file

pytestmark = pytest.mark.usefixtures("no_figures")

SOFT = mca.Elastic(E=1e9, nu=0.3, rho=1e3)
SIDE, GAP, SPEED, G = 0.02, 5e-4, 1.0, 9.81
WEIGHT = SIDE**3 * 1e3 * G


def block(**changes: Any) -> mca.Body:
    """A cube that rests on the plane y = 0."""
    return mca.Body(name="block", geometry=mca.Box(size=3 * (SIDE,), divisions=(4, 4, 4)), material=SOFT, **changes)


def on_plane(body: str) -> mca.Contact:
    return mca.Contact(slave=mca.Surface(body=body, nodes="ymin"), master=mca.RigidPlane(), mu=0.3, penalty=0.1)


def scene(**changes: Any) -> mca.Scene:
    """A small cube flies at one that is pressed on a plane by gravity."""
    small = mca.Body(
        name="small",
        geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2)),
        material=SOFT,
        position=(0.005, SIDE + GAP, 0.005),
        velocity=(0.0, -SPEED, 0.0),
    )
    struck = mca.Surface(body="block", nodes="ymax")
    hit = mca.Contact(slave=mca.Surface(body="small", nodes="ymin"), master=struck, mu=0.3, penalty=0.1)
    made = mca.Scene(
        name="settled",
        bodies=(block(), small),
        gravity=(0.0, -G, 0.0),
        contacts=(on_plane("block"), hit),
        impact=mca.ImpactPhase(duration=7e-4, time_step_scale=0.1),
        phases=(mca.Settle(),),
    )
    return replace(made, **changes)


@cache
def settled() -> mca.Result:
    return mca.run(scene(), precision="float64", threads=1)


def test_the_contact_force_is_the_weight_when_the_impact_begins():
    result = settled()
    first = int(np.argmax(result.time > -1e-12))
    assert first > 0 and result.time[first] == 0.0
    struck = int(np.argmax(result.contacts[1].pressure > 0.0))
    assert result.time[struck] == pytest.approx(GAP / SPEED, abs=2e-6)  # it waited where the scene put it
    assert result.contacts[0].pressure[first:struck] == pytest.approx(WEIGHT, rel=0.01)
    assert result.contacts[0].pressure[struck:].max() > 10.0 * WEIGHT


def test_the_ledger_closes_over_both_phases_and_books_the_damping():
    """A body that is let go on springs gains m g d, of which they keep half: the other half is damped."""
    result = settled()
    settle, impact = result.summary["phases"]
    assert (settle["kind"], settle["ended_by"], impact["kind"]) == ("settle", "rest", "impact")
    assert settle["end"] == impact["start"] and impact["end"] - impact["start"] == pytest.approx(7e-4)
    energy = result.summary["energy"]
    assert result.summary["energy_error"] < 1e-4
    assert energy["initial"] == pytest.approx(0.5 * 1e-3 * SPEED**2, rel=1e-6)
    held = settle["energy"]["elastic"] + settle["energy"]["contact"]
    assert settle["energy"]["damping"] == pytest.approx(held, rel=0.02)
    dashpots = energy["damping"] - settle["energy"]["damping"]  # of the contact at rest, which is struck
    assert 0.0 < dashpots < 1e-3 * energy["initial"]
    assert settle["energy"]["external_work"] == pytest.approx(2.0 * held, rel=0.02)
    scale = energy["initial"] + abs(energy["external_work"])
    assert np.abs(result["E_total_error"]).max() < 1e-4 * scale


def test_the_ledger_of_a_phase_is_that_of_its_end():
    """However far its rows are apart: those of a phase that may last 3 s are 6 ms apart, and it rests before."""
    phase = mca.run(scene(phases=(mca.Settle(duration=3.0),)), precision="float64", threads=1).summary["phases"][0]
    energy, exact = phase["energy"], settled().summary["phases"][0]["energy"]
    assert phase["end"] - phase["start"] < 6e-3
    for name in ("elastic", "contact", "damping", "external_work"):
        assert energy[name] == pytest.approx(exact[name], rel=1e-3)
    assert abs(energy["initial"]) < 1e-9 and energy["kinetic"] < 1e-3 * energy["damping"]


def test_bodies_at_rest_need_no_time():
    result = mca.run(scene(gravity=(0.0, 0.0, 0.0), impact=mca.ImpactPhase(duration=2e-5)), threads=1)
    assert result.summary["energy"]["damping"] == 0.0
    alone = mca.run(scene(gravity=(0.0, 0.0, 0.0), phases=(), impact=mca.ImpactPhase(duration=2e-5)), threads=1)
    assert result["E_kinetic"][result.time >= 0.0] == pytest.approx(alone["E_kinetic"], rel=1e-6)


def test_a_rigid_body_settles_on_a_flexible_one():
    top = mca.Body(
        name="top",
        geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2)),
        material=SOFT,
        position=(0.005, SIDE, 0.005),
        rigid=True,
    )
    rests = mca.Contact(slave=mca.Surface(body="top", nodes="ymin"), master=mca.Surface(body="block", nodes="ymax"))
    made = scene(bodies=(block(), top), contacts=(on_plane("block"), rests), impact=mca.ImpactPhase(duration=5e-5))
    result = mca.run(made, precision="float64", threads=1)
    last = [contact.pressure[-20:].mean() for contact in result.contacts]
    assert last == pytest.approx([WEIGHT + 1e-3 * G, 1e-3 * G], rel=0.01)
    assert result.summary["energy_error"] < 1e-3


def test_a_run_that_is_stopped_after_settling_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    class StoppedError(Exception):
        pass

    made, store = scene(impact=mca.ImpactPhase(duration=1e-4)), Checkpoint.store

    def store_and_stop(self: Checkpoint, impact: Any, place: Any, more: Any = None) -> None:
        store(self, impact, place, more)
        raise StoppedError

    whole = mca.run(made, threads=1)
    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "store", store_and_stop)
        with pytest.raises(StoppedError):
            mca.run(made, threads=1, out=tmp_path / "out", checkpoint="2e-5s")
    assert (tmp_path / "out" / FILE).exists()
    monkeypatch.setitem(carry_out.DRIVERS, mca.Settle, None)
    result = mca.run(made, threads=1, out=tmp_path / "out", checkpoint="2e-5s")  # it does not settle again
    assert all(result[name].tobytes() == whole[name].tobytes() for name in whole.history)
    assert result.summary["phases"] == whole.summary["phases"]


def test_a_model_file_keeps_the_phases(tmp_path: Path):
    made = scene()
    model_file.save(tmp_path / "a.mca", made, mca.mesh(made))
    assert model_file.load(tmp_path / "a.mca").scene == made


FINE = (block(), replace(scene().bodies[1], geometry=mca.Box(size=3 * (0.01,), divisions=(8, 8, 8))))
REFUSED: tuple[tuple[dict[str, Any], Callable[[mca.Scene], Any], type[Exception], str], ...] = (
    ({"bodies": FINE}, lambda made: mca.run(made, multi_rate=2), mca.RequestError, "multi_rate = 2: phases before"),
    ({}, lambda made: mca.run_batch([made]), mca.RequestError, "leave phases out"),
    ({"phases": (mca.Settle(duration=5e-5),)}, mca.run, mca.GuardError, "do not rest after Settle.duration = 5e-05 s"),
    ({"contacts": (), "phases": (mca.Settle(duration=1e-3),)}, mca.run, mca.GuardError, "hold what falls"),
    (
        {"phases": (mca.Settle(duration=1e-9),)},
        mca.run,
        mca.RequestError,
        "Settle.duration = 1e-09: give a time of more",
    ),
    ({"phases": (mca.Settle(duration=1e9),)}, mca.run, mca.RequestError, "Settle.duration = 1000000000.0: give a time"),
)


@pytest.mark.parametrize(("change", "run", "kind", "words"), REFUSED)
def test_what_cannot_settle_is_refused(
    change: dict[str, Any], run: Callable[[mca.Scene], Any], kind: type[Exception], words: str
):
    with pytest.raises(kind, match=words):
        run(scene(**change))


def test_multi_rate_auto_takes_one_rate():
    """Cells that grow along the bar give four groups without the phase."""
    bar = mca.Box(size=(0.01, 0.04, 0.01), divisions=(2, 40, 2)).build()
    y = bar.points[:, 1] / 0.04
    bar.points[:, 1] = 0.04 * (0.1 * y + 0.9 * y**3)
    held = mca.Fixed(body="bar", nodes="ymax")
    body = mca.Body(name="bar", geometry=bar, material=mca.Elastic(E=1e8, nu=0.3, rho=1e3))
    phase = mca.ImpactPhase(duration=1e-3, output_interval=2e-5)
    made = scene(bodies=(body,), contacts=(), fixed=(held,), impact=phase)
    assert "rate_groups" not in mca.run(made, multi_rate="auto").summary
    assert len(mca.run(replace(made, phases=()), multi_rate="auto").summary["rate_groups"]) > 1


def test_a_phase_that_is_not_known_is_refused():
    with pytest.raises(mca.RequestError, match=r"Scene.phases\[0\].*give Settle"):
        scene(phases=(mca.ImpactPhase(duration=1e-3),))
    with pytest.raises(mca.RequestError, match="tolerance"):
        mca.Settle(tolerance=0.0)


@pytest.mark.parametrize("cells", [10, 20])
def test_a_hung_bar_rests_at_its_static_shape(cells: int):
    """rho g L^2 / (2 E) to 0.1 % from the start of the impact on; with looks too far apart it was 0.7 %."""
    length, bar = 0.1, mca.Elastic(E=1e7, nu=0.0, rho=1e3)
    geometry = mca.Box(size=(0.02, length, 0.02), divisions=(2, cells, 2))
    hung = mca.Scene(
        name="hung",
        bodies=(mca.Body(name="bar", geometry=geometry, material=bar),),
        fixed=(mca.Fixed(body="bar", nodes="ymax"),),
        gravity=(0.0, -G, 0.0),
        probes=(mca.Probe(name="end", body="bar", nodes="ymin"),),
        phases=(mca.Settle(),),
        impact=mca.ImpactPhase(duration=0.01, output_interval=5e-4),
    )
    result = mca.run(hung, threads=1)
    sag = -result.probes[0].position[result.time >= 0.0, 1]
    np.testing.assert_allclose(sag, bar.rho * G * length**2 / (2.0 * bar.E), rtol=1e-3)
    (end,), speed = result.summary["probes"], np.linalg.norm(result.probes[0].velocity, axis=1)
    assert end["velocity_max"] == speed[result.time >= 0.0].max() < 0.01 * speed.max()
    assert end["displacement_end"][1] == pytest.approx(0.0, abs=1e-3 * sag[0])


@pytest.mark.parametrize(
    "load",
    [
        mca.Traction(body="bar", nodes="xmax", traction=(1e6, 0.0, 0.0)),
        mca.BodyForce(body="bar", acceleration=(1e5, 0.0, 0.0)),
    ],
    ids=lambda load: type(load).__name__,
)
def test_bodies_settle_under_loads_whose_work_is_counted(load: mca.Load):
    """Changes of velocity hid the way of a step from the work of loads: 4.3 and 5.9 % of it."""
    steel = mca.Elastic(E=210e9, nu=0.0, rho=7850.0)
    bar = mca.Body(name="bar", geometry=mca.Box(size=(0.05, 0.01, 0.01), divisions=(8, 2, 2)), material=steel)
    scene = mca.Scene(
        name="pulled",
        bodies=(bar,),
        fixed=(mca.Fixed(body="bar", nodes="xmin"),),
        loads=(load,),
        phases=(mca.Settle(),),
        probes=(mca.Probe(name="end", body="bar", nodes="xmax"),),
        impact=mca.ImpactPhase(duration=2e-5, output_interval=1e-6),
    )
    result = mca.run(scene)
    assert result.summary["energy_error"] < 1e-6
    stress = 1e6 if isinstance(load, mca.Traction) else 0.5 * 7850.0 * 1e5 * 0.05  # the mean of that of the bar
    assert result.probes[0].position[-1, 0] - 0.05 == pytest.approx(0.05 * stress / 210e9, rel=2e-3)


def stretched(waits: bool, rigid: bool, rho: float) -> mca.Result:
    """A held cube on a stiff spring in tension, whose other end is at a body that waits, or that is held."""
    small, at = (3, 3, 3), (0.06, 0.0, 0.0)
    cube = mca.Body(name="cube", geometry=mca.Box(size=3 * (SIDE,), divisions=small), material=SOFT)
    other = replace(cube, name="other", material=replace(SOFT, rho=rho), position=at, rigid=rigid and waits)
    other = replace(other, velocity=(0.0, -1.0 * waits, 0.0))
    ends = {"body": "cube", "nodes": "xmax", "other": "other", "other_nodes": "xmin"}
    fixed = mca.Fixed(body="cube", nodes="xmin"), *([] if waits else [mca.Fixed(body="other", nodes="boundary")])
    return mca.run(
        mca.Scene(
            name="stretched",
            bodies=(cube, other),
            fixed=fixed,
            loads=(mca.Spring(name="s", **ends, stiffness=1e6, length=0.039),),
            phases=(mca.Settle(duration=0.05),),
            impact=mca.ImpactPhase(duration=2e-5, output_interval=1e-6),
        ),
        precision="float64",
        threads=1,
    )


@pytest.mark.parametrize(("rigid", "rho"), [(False, 1e3), (False, 10.0), (True, 10.0)])
def test_a_body_settles_on_a_spring_from_one_that_waits(rigid: bool, rho: float):
    """However light that is, it stays where it is, as if it were held; then it has its velocity, and the spring's."""
    waits, held = stretched(True, rigid, rho), stretched(False, rigid, rho)
    one, other = (result.summary["phases"][0]["energy"] for result in (waits, held))
    for name in ("elastic", "spring", "damping"):
        assert one[name] == pytest.approx(other[name], rel=1e-3)
    assert waits.summary["energy_error"] < 1e-3


def test_what_moves_slowly_rests_as_soon_as_its_period_lets_it():
    """A weight on a soft spring beside a stiff block that has most of the energy: the damping of that would hold it."""
    weight = mca.Body(name="weight", rigid=True, mass=1e-6, inertia=(1e-12, 1e-12, 1e-12), position=(0.1, 0.0, 0.0))
    k, mass = 2.4, 1e-6
    soft = mca.Spring(name="soft", body="weight", at=(0.0, 0.0, 0.0), other_at=(0.1, 0.05, 0.0), stiffness=k)
    made = scene(bodies=(block(), weight), contacts=(on_plane("block"),), loads=(soft,))
    made = replace(made, impact=mca.ImpactPhase(duration=2e-5), phases=(mca.Settle(duration=0.04),))
    result = mca.run(made, threads=1)
    assert result["spring_soft_m"][-1] == pytest.approx(mass * G / k, rel=2e-3)


@pytest.mark.parametrize("damping", [{"loss_factor": 0.2, "band": (100.0, 1e4)}, {"stiffness": 1e-7}, {"mass": 2e4}])
def test_what_damping_takes_of_a_heated_body_is_right_though_velocities_change(damping: dict[str, Any]):
    heat = mca.ThermalStrain(body="block", expansion=1e-5, temperature=100.0)
    loads = heat, mca.Damping(body="block", **damping)
    ends = mca.Fixed(body="block", nodes="xmin"), mca.Fixed(body="block", nodes="xmax", axes="x")
    made = scene(bodies=(block(),), contacts=(), fixed=ends, gravity=(0.0, 0.0, 0.0), loads=loads)
    made = replace(
        made, impact=mca.ImpactPhase(duration=2e-5, output_interval=1e-6), phases=(mca.Settle(duration=0.1),)
    )
    result = mca.run(made, threads=1)
    assert result.failed == ()
    assert result.summary["energy_error"] < 1e-4


def test_what_a_loss_factor_damps_rests_with_its_moduli_of_slow_loads():
    """The branches of a low band crept on after the phase: the column bore 0.7 of its weight, and was 0.3 too long."""
    E, rho, H = 2e6, 1e3, 0.06
    made = mca.Scene(
        name="column",
        bodies=(
            mca.Body(
                name="column",
                geometry=mca.Box(size=(0.02, H, 0.02), divisions=(1, 4, 1)),
                material=mca.Elastic(E=E, nu=0.0, rho=rho),
            ),
        ),
        gravity=(0.0, -G, 0.0),
        fixed=tuple(mca.Fixed(body="column", nodes=f"{axis}min", axes=axis) for axis in "xyz"),
        loads=(mca.Damping(body="column", loss_factor=0.5, band=(0.5, 20.0)),),
        probes=(mca.Probe(name="top", body="column", nodes="ymax"),),
        impact=mca.ImpactPhase(duration=4e-3, output_interval=1e-3),
        phases=(mca.Settle(duration=1.0),),
    )
    result = mca.run(made, threads=1)
    height = result.probes[0].position[result.time >= 0.0, 1]
    assert H - height == pytest.approx(rho * G * H**2 / (2.0 * E), rel=2e-3)
    assert result.summary["energy_error"] < 1e-4


@pytest.mark.parametrize("finite", [False, True])
def test_what_relaxes_slowly_rests_with_its_moduli_of_a_long_time(finite: bool):
    """A column is shorter by rho g H^2 / (2 E) of these at its top, from the start of the impact on."""
    K, G_0, H, rho = 1e6 / 3.0, 0.5e6, 0.04, 1e3
    elastic = mca.NeoHookean(C10=G_0 / 2.0, nu=1e-9, rho=rho) if finite else mca.Elastic(E=1e6, nu=0.0, rho=rho)
    column = mca.Body(
        name="column",
        geometry=mca.Box(size=(0.01, H, 0.01), divisions=(1, 4, 1)),
        material=mca.Prony(elastic=elastic, g=(0.3, 0.2), tau=(1.0, 100.0)),
        kinematics="finite" if finite else "corotational",
    )
    made = mca.Scene(
        name="column",
        bodies=(column,),
        gravity=(0.0, -G, 0.0),
        fixed=tuple(mca.Fixed(body="column", nodes=f"{axis}min", axes=axis) for axis in "xyz"),
        probes=(mca.Probe(name="top", body="column", nodes="ymax"),),
        impact=mca.ImpactPhase(duration=2e-3, output_interval=1e-3),
        phases=(mca.Settle(duration=5.0),),
    )
    result = mca.run(made, threads=1)
    late = 0.5 * G_0
    shorter = rho * G * H**2 / 2.0 * (3.0 * K + late) / (9.0 * K * late)
    height = result.probes[0].position[result.time >= 0.0, 1]
    assert H - height == pytest.approx(shorter, rel=5e-3 if finite else 1e-3)  # right to the first order of strain
    assert not result.warnings  # hardly anything is dissipated that the energy of vectors could be compared with
    assert result["E_plastic"][-1] < 1e-3 * 0.5 * rho * G * 1e-4 * H * shorter
