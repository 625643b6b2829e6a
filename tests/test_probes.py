"""Probes and sections: motion and resultants against closed forms, wherever runs go, and none of it changes a run."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impacts import begun, result_of
from test_floating_frames import bar as spinning_bar
from test_floating_frames import set_spinning
from test_gpu import oblique
from test_multi_rate import free_bar, hinged
from test_run import bar

import warp_mca as mca
from warp_mca.phases.impact import Impact
from warp_mca.results.sensor_history import load_sensors
from warp_mca.scene import model_file

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
PROBES = (
    mca.Probe(name="corner", body="small", at=(-0.011, 0.0, -0.012)),
    mca.Probe(name="inside", body="small", at=(-0.004, 0.007, 0.001), cfc=1000),
    mca.Probe(name="face", body="large", nodes="ymax"),
)
SECTIONS = (
    mca.Section(name="small cut", body="small", at=(0.0, 0.0101, 0.0), normal=(0.0, 2.0, 0.0)),
    mca.Section(name="large cut", body="large", at=(0.0, -0.0101, 0.0), normal=(0.1, 1.0, 0.0)),
)


def watched(scene: mca.Scene) -> mca.Scene:
    return replace(scene, probes=PROBES, sections=SECTIONS)


def above(impact: Impact, number: int = 0) -> np.ndarray:
    """Nodes above a section that do not lie in it."""
    ready = impact.ready[0]
    cut = ready.sensors.placed(ready.model.node_start).cuts[number]
    cells = [b.conn.T[np.isin(b.conn[0], own(cut))] for b in impact.solver.model.blocks]
    high = [c[cut.height[c - cut.first].mean(axis=1) > 0.0].ravel() for c in cells]
    return np.setdiff1d(np.concatenate(high), cut.interface(cells)[1])


def own(cut) -> np.ndarray:
    return np.arange(cut.first, cut.first + len(cut.height))


def test_a_block_dropped_on_a_soft_pad():
    """Mass on a spring: x'' = g - (k / M) x with x'(0) = v, so that a_max = sqrt((k / M) v^2 + g^2), pad of E A / L.

    The block is rigid, the pad has a 4000th of its mass, so that waves in it ripple by 1.6 %.
    """
    a, E, v, g, layers = 0.02, 1e6, 1.0, 9.81, 10
    pad = mca.Elastic(E=E, nu=0.0, rho=2.0)
    scene = mca.Scene(
        name="drop",
        bodies=(
            mca.Body(name="pad", geometry=mca.Box(size=(a, a, a), divisions=(1, 1, layers)), material=pad),
            mca.Body(
                name="block",
                geometry=mca.Box(size=(a, a, a), divisions=(1, 1, 1)),
                material=mca.Elastic(E=1e9, nu=0.0, rho=8000.0),
                position=(0.0, 0.0, a),
                velocity=(0.0, 0.0, -v),
                rigid=True,
            ),
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="block", nodes="zmin"),
                master=mca.Surface(body="pad", nodes="zmax"),
                penalty=20.0,
            ),
        ),
        fixed=(mca.Fixed(body="pad", nodes="zmin"),),
        gravity=(0.0, 0.0, -g),
        impact=mca.ImpactPhase(duration=3.6e-3, output_interval=2e-5),
        probes=(mca.Probe(name="block", body="block", at=(0.01, 0.01, 0.01), cfc=1000),),
        sections=(mca.Section(name="pad", body="pad", at=(0.0, 0.0, 0.5 * a), normal=(0.0, 0.0, 1.0)),),
    )
    result = mca.run(scene, threads=1)
    mass, stiffness = 8000.0 * a**3, E * a
    exact = math.hypot(math.sqrt(stiffness / mass) * v, g)
    (probe,) = result.probes
    assert probe.acceleration[:, 2].max() == pytest.approx(exact, rel=0.02)
    assert probe.filtered()[:, 2].max() == pytest.approx(exact, rel=0.01)
    assert -result.sections[0].force[:, 2].min() == pytest.approx(mass * (exact + g), rel=0.03)
    change = probe.acceleration.sum(axis=0) * 2e-5
    assert change == pytest.approx(probe.velocity[-1] - probe.velocity[0], abs=1e-12)
    figures = result.summary["probes"][0]
    assert figures["acceleration_max"] == pytest.approx(exact, rel=0.02)
    assert figures["acceleration_cfc_max"] == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("element", ["hex8", "hex8r", "tet4", "tet10"])
@pytest.mark.parametrize(("yields", "viscosity"), [(True, None), (False, None), (True, (0.1, 1.2))])
def test_the_force_through_a_section_is_what_accelerates_the_other_side(element, yields, viscosity):
    """Between rows of one step its trapezoidal sum is the change of momentum of the nodes on the upper side."""
    metal = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=100e6, E_t=2e9)
    body = mca.Body(
        name="bar",
        geometry=mca.Box(size=(0.02, 0.01, 0.01), divisions=(6, 2, 2)),
        material=metal if yields else STEEL,
        velocity=(-20.0, 3.0, 1.0),
        element=element,
    )
    scene = replace(
        bar(),
        bodies=(body,),
        contacts=(mca.Contact(slave=mca.Surface(body="bar", nodes="xmin"), master=mca.RigidPlane(normal=(1, 0, 0))),),
        tip=None,
        sections=(mca.Section(name="cut", body="bar", at=(0.007, 0.005, 0.005), normal=(1.0, 0.3, 0.0)),),
        impact=mca.ImpactPhase(duration=6e-6, output_interval=4e-8, bulk_viscosity=viscosity),
    )
    impact = begun(scene, precision="float64")
    assert impact.steps.per_interval == 1
    impact.advance()
    section, upper = result_of(impact).sections[0], above(impact)
    mass, dt = impact.solver.model.mass[upper], impact.steps.dt
    gained = mass @ (impact.at_last_record()[1] - impact.solver.model.V)[upper]
    force = section.force
    given = -dt * (force.sum(axis=0) - 0.5 * (force[0] + force[-1]))
    assert gained == pytest.approx(given, abs=1e-9 * np.abs(given).max()) and abs(given[0]) > 0.01
    assert (result_of(impact).summary["max_plastic_strain"] > 1e-4) == yields


def test_a_wave_brings_its_force_to_a_section_and_none_of_moment():
    """Behind a plane wave in a bar F = rho c v A; seen from the middle of the section it has no moment."""
    cut = mca.Section(name="cut", body="bar", at=(0.1495, 0.0, 0.0), normal=(1.0, 0.0, 0.0))
    scene = replace(bar(penalty=3.0, duration=6e-5, output_interval=2e-7), sections=(cut,))
    result = mca.run(scene, threads=1)
    material = scene.bodies[0].material
    c = material.wave_speeds["bar"]
    behind = (result.time > 0.05 / c + 6e-6) & (result.time < 0.05 / c + 3e-5)
    exact = -material.rho * c * 1.0 * 1e-4
    assert result.sections[0].force[behind, 0].mean() == pytest.approx(exact, rel=5e-3)
    assert result.sections[0].force[result.time < 0.04 / c, 0] == pytest.approx(0.0, abs=1e-2 * -exact)
    assert np.abs(result.sections[0].moment).max() < 1e-6 * -exact


def test_a_bent_cantilever_has_the_moment_of_its_load():
    """Gravity g that acts suddenly: on average over many periods the moment at x is rho A g (L - x)^2 / 2."""
    soft = mca.Elastic(E=1e7, nu=0.0, rho=1000.0)
    beam = mca.Body(name="beam", geometry=mca.Box(size=(0.1, 0.02, 0.02), divisions=(10, 2, 2)), material=soft)
    scene = mca.Scene(
        name="beam",
        bodies=(beam,),
        fixed=(mca.Fixed(body="beam", nodes="xmin"),),
        gravity=(0.0, 0.0, -2.0),
        sections=(mca.Section(name="cut", body="beam", at=(0.031, 0.0, 0.0), normal=(1.0, 0.0, 0.0)),),
        impact=mca.ImpactPhase(duration=0.31 * 4, output_interval=1e-3),
    )
    section = mca.run(scene, threads=1).sections[0]
    moment = section.moment.mean(axis=0)
    lever = 0.1 - 0.03  # to the nodes between the cells on both sides, half of whose mass is above
    assert moment[1] == pytest.approx(0.5 * 1000.0 * 4e-4 * 2.0 * lever**2, rel=0.02)
    assert section.force[:, 2].mean() == pytest.approx(-1000.0 * 4e-4 * 2.0 * (lever - 0.005), rel=0.02)
    assert np.abs(moment[[0, 2]]).max() < 1e-6


def test_elements_in_floating_frames_give_the_forces_of_the_world(monkeypatch):
    scene = replace(
        spinning_bar(),
        sections=(mca.Section(name="cut", body="bar", at=(0.0, 0.01, 0.0), normal=(0.0, 1.0, 0.0)),),
        probes=(mca.Probe(name="end", body="bar", nodes="ymax"),),
    )
    framed = begun(scene)
    with monkeypatch.context() as patch:
        patch.setattr("warp_mca.phases.impact.with_floating_frames", lambda model, *_: model)
        plain = begun(scene, precision="float64")
    assert framed.solver.floating.count == 1 and plain.solver.floating.count == 0
    for impact in (framed, plain):
        set_spinning(impact, 1.5)
        impact.state.u.assign(1.001 * (impact.state.u.numpy() + impact.solver.model.X) - impact.solver.model.X)
        impact.advance(until=2 * impact.steps.per_interval)
    one, two = (result_of(impact) for impact in (framed, plain))
    force = two.sections[0].force
    assert np.abs(force).max() > 1e4
    assert one.sections[0].force == pytest.approx(force, abs=1e-5 * np.abs(force).max())
    assert one.probes[0].position == pytest.approx(two.probes[0].position, abs=1e-9)


def test_nothing_changes_in_a_run_that_is_watched():
    plain, seen = begun(oblique()), begun(watched(oblique()))
    for impact in (plain, seen):
        impact.advance()
    one, two = result_of(plain), result_of(seen)
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one.history)
    assert [name for name in plain.state.differences(seen.state) if "sensors" not in name] == []


def test_probes_move_as_their_nodes_do():
    """At the corner of a cell, between corners, and as the mass centre of a set."""
    scene = watched(oblique())
    nodes = mca.mesh(scene)["small"].points
    corner = nodes[np.argmin(((nodes - scene.tip.at) ** 2).sum(axis=1))]
    scene = replace(scene, probes=(mca.Probe(name="tip", body="small", at=tuple(corner)), *PROBES))
    impact = begun(scene)
    impact.advance()
    result = result_of(impact)
    tip, _, inside, face = result.probes
    for k, axis in enumerate("xyz"):
        assert tip.velocity[:, k] == pytest.approx(result[f"tip_v{axis}"], abs=1e-15)
    u, v = impact.at_last_record()
    model, start = impact.solver.model, impact.ready[0].model.node_start
    top = mca.mesh(scene)["large"].nodes("ymax") + start["large"]
    mass = model.mass[top] / model.mass[top].sum()
    assert face.position[-1] == pytest.approx(mass @ (model.X + u)[top], abs=1e-15)
    assert face.velocity[-1] == pytest.approx(mass @ v[top], abs=1e-15)
    assert inside.position[0] == pytest.approx([-0.004, 0.007, 0.001], abs=1e-15)
    assert inside.velocity[0] == pytest.approx([1.0, -3.0, 0.5], abs=1e-6)
    spot = impact.ready[0].sensors.spots[2]
    assert len(spot.node) == 8 and min(spot.weight) > 0.0
    assert inside.velocity[-1] == pytest.approx(spot.weight @ v[spot.node + start["small"]], abs=1e-15)


def equal(one: mca.Result, two: mca.Result) -> bool:
    """Whether probes and sections recorded the same bits."""
    arrays = [
        [*((p.position, p.velocity) for p in r.probes), *((s.force, s.moment) for s in r.sections)] for r in (one, two)
    ]
    return all(np.array_equal(a, b) for x, y in zip(*arrays, strict=True) for a, b in zip(x, y, strict=True))


def test_batches_threads_and_stored_states_give_the_same_bits(short_ranges, tmp_path):
    whole, first, rest = (begun(watched(oblique())) for _ in range(3))
    threads, batch = begun(watched(oblique()), threads=2), begun(oblique(), watched(oblique()))
    assert threads.solver.threads == 2
    first.advance(until=7 * first.steps.per_interval)
    first.save(tmp_path / "state")
    rest.load(tmp_path / "state")
    for impact in (whole, rest, threads, batch):
        impact.advance()
    assert equal(result_of(whole), result_of(rest)) and equal(result_of(whole), result_of(threads))
    assert equal(result_of(whole), result_of(batch, 1)) and not result_of(batch, 0).probes


def test_elements_with_steps_of_their_own_give_the_same_forces():
    cut = mca.Section(name="cut", body="low", at=(0.0, 0.011, 0.0), normal=(0.0, 1.0, 0.0))
    scene = replace(hinged(), sections=(cut,))
    one, two = begun(scene), begun(scene, multi_rate=3)
    assert two.solver.model.rates is not None
    for impact in (one, two):
        impact.advance()
    one, two = result_of(one), result_of(two)
    force = one.sections[0].force
    assert np.linalg.norm(two.sections[0].force - force) < 0.04 * np.linalg.norm(force)
    ends = [mca.Probe(name=name, body="bar", nodes=name) for name in ("ymin", "ymax")]  # of the first and last level
    flying = begun(replace(free_bar(), contacts=(), probes=tuple(ends)), multi_rate=4)
    flying.advance(until=5 * flying.steps.per_interval)
    for probe in result_of(flying).probes:
        assert probe.position[:, 1] - probe.position[0, 1] == pytest.approx(-20.0 * probe.time, abs=1e-15)


def test_a_rigid_body_carries_its_probes():
    """About its mass centre, at constant spin: r(t) = R(w t) r(0)."""
    scene = spinning_bar(rigid=True)
    spin = 300.0
    body = replace(scene.bodies[0], angular_velocity=(0.0, 0.0, spin))
    probe = mca.Probe(name="end", body="bar", at=(0.0, 0.05, 0.0))
    scene = replace(scene, bodies=(body,), probes=(probe,), impact=mca.ImpactPhase(duration=5e-3, output_interval=1e-5))
    found = mca.run(scene, threads=1).probes[0]
    angle = spin * found.time
    assert found.position[:, :2] == pytest.approx(0.05 * np.stack([-np.sin(angle), np.cos(angle)], axis=1), abs=1e-6)
    assert np.linalg.norm(found.acceleration[5:-5], axis=1) == pytest.approx(0.05 * spin**2, rel=1e-3)


@pytest.mark.usefixtures("no_figures")
def test_results_are_written_and_read_back(tmp_path: Path):
    scene = watched(oblique())
    result = mca.run(scene, out=tmp_path / "out", threads=1)
    loaded = mca.load(tmp_path / "out")
    assert equal(result, loaded) and [p.cfc for p in loaded.probes] == [None, 1000, None]
    header, *rows = (tmp_path / "out" / "probes.csv").read_text().splitlines()
    names = header.split(",")
    assert len(rows) == len(result.time) and {"time_s", "inside.ax", "inside.ax_cfc1000", "large cut.Fy"} <= set(names)
    column = np.array([float(row.split(",")[names.index("inside.ay")]) for row in rows])
    assert np.array_equal(column, loaded.probes[1].acceleration[:, 1])
    with np.load(tmp_path / "out" / "probes.npz") as arrays:
        np.savez(tmp_path / "old.npz", **{key: arrays[key] for key in arrays if not key.endswith("/begins")})
    old, _ = load_sensors(tmp_path / "old.npz")
    np.testing.assert_array_equal([probe.begins for probe in old], [probe.begins for probe in loaded.probes])
    units = result.summary["units"]
    assert set(units) == {*result.history, *names}
    assert [units[name] for name in ("F_n_N", "inside.ay", "large cut.Fy", "large cut.Mx")] == "N,m/s^2,N,N m".split(
        ","
    )
    part = result.impact()
    assert len(part.probes[0].time) == len(part.time) and len(part.sections) == 2
    model_file.save(tmp_path / "one.mca", scene, mca.mesh(scene))
    stored = model_file.load(tmp_path / "one.mca").scene
    assert (stored.probes, stored.sections) == (PROBES, SECTIONS)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"probes": (mca.Probe(name="a", body="none", at=(0, 0, 0)),)}, "Probe a.body = 'none'"),
        ({"probes": (mca.Probe(name="a", body="small", nodes="none"),)}, "node set = 'none'"),
        ({"probes": (mca.Probe(name="a", body="small", at=(0, 0.1, 0)),)}, "Probe a.at .* 0.08 m outside the body"),
        (
            {"sections": (mca.Section(name="a", body="small", at=(0, 1, 0), normal=(0, 1, 0)),)},
            "Section a.at .* one side",
        ),
        ({"probes": PROBES, "sections": (replace(SECTIONS[0], name="face"),)}, "a name of its own"),
        ({"probes": (replace(PROBES[0], name="meet"),), "contacts": "meet"}, "contacts have these names too"),
        ({"probes": (replace(PROBES[0], cfc=2e5),)}, "Probe corner.cfc = 200000.0: rows every 1e-06 s"),
        ({"sections": SECTIONS, "bodies": "rigid"}, "Section small cut.body = 'small': it is rigid"),
    ],
)
def test_what_cannot_be_recorded_is_refused(change: dict, words: str):
    if change.get("bodies") == "rigid":
        change = {**change, "bodies": tuple(replace(body, rigid=True) for body in oblique().bodies)}
    if name := change.get("contacts"):
        change = {**change, "contacts": (replace(oblique().contacts[0], name=name),)}
    with pytest.raises(mca.RequestError, match=words):
        begun(replace(oblique(), **change))


def test_a_run_that_a_guard_stops_at_once_has_no_rows_of_probes():
    impact = begun(watched(oblique()))
    impact.state.u.fill_(np.nan)
    impact.advance()
    result = result_of(impact)
    assert impact.stopped[0] is not None and result.probes[1].filtered().shape == (0, 3)
    assert result.summary["probes"][1]["acceleration_cfc_max"] == 0.0 and result.sections[0].force.shape == (0, 3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: mca.Probe(name="a", body="b"), "either a point"),
        (lambda: mca.Probe(name="a", body="b", at=(0, 0, 0), nodes="c"), "either a point"),
        (lambda: mca.Probe(name="a", body="b", at=(0, 0, 0), cfc=-1), "Probe a.cfc = -1"),
        (lambda: mca.Section(name="a", body="b", at=(0, 0, 0), normal=(0, 0, 0)), "Section a.normal"),
    ],
)
def test_probes_and_sections_check_their_values(make, words):
    with pytest.raises(mca.RequestError, match=words):
        make()
