"""Laws of friction of the package beyond their cases of verification: areas, sums, combinations, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from impacts import finished, prepared
from test_recording import Memory

import warp_mca as mca
from warp_mca.geometry.cell_types import is_triangle
from warp_mca.physics.contact.friction_laws import node_areas
from warp_mca.physics.contact.sides import face_geometry
from warp_mca.physics.contact.surfaces import make_faces
from warp_mca.recorders.recorder import CONTACT
from warp_mca.scene import model_file
from warp_mca.scenes import sliding_block
from warp_mca.system.contact import Faces
from warp_mca.verify.case import Setup
from warp_mca.verify.friction import sunk

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
DECAY = mca.DecayingFriction(kinetic=0.1, decay=2.0)
CAP = mca.ShearCap(tau_max=900.0)
AREA, MASS, MU, GRAVITY = 0.01, 0.2, 0.3, 300.0  # of sliding_block


def block(**contact) -> mca.Scene:
    scene = sliding_block.build(cells=1)
    return replace(scene, contacts=(replace(scene.contacts[0], **contact),))


def faces(mesh: mca.Mesh, nodes: str | None = None) -> Faces:
    """All faces of a mesh, or those that a node set covers."""
    face, element = mesh.boundary
    if nodes is not None:
        covered = np.isin(face, mesh.nodes(nodes)).all(axis=1)
        face, element = face[covered], element[covered]
    ones = np.ones(element.max() + 1)
    return make_faces(mesh.points, face, element, ones, ones, ones)


def test_areas_of_nodes_sum_to_the_area_of_a_side():
    mesh = mca.Box(size=(0.3, 0.2, 0.1), divisions=(3, 2, 2)).build()
    area = node_areas(faces(mesh, "ymin"))
    assert area.sum() == pytest.approx(0.03, rel=1e-12)
    assert np.unique(area.round(9)).tolist() == [0.00125, 0.0025, 0.005]


def test_edges_of_a_body_have_the_area_of_one_side():
    mesh = mca.Box(size=(2.0, 2.0, 2.0), divisions=(2, 2, 2)).build()
    surface = faces(mesh)
    place = np.abs(mesh.points[surface.nodes] - 1.0).sum(axis=1)  # 1, 2 or 3: inside a side, on an edge, at a corner
    np.testing.assert_allclose(node_areas(surface), 2.0 ** (1.0 - place), rtol=1e-12)


def test_triangles_give_a_third_to_each_corner():
    mesh = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build()
    square = faces(mesh, "ymin")
    a, b, c, d = square.node[0]
    face = np.array([[a, b, c, c], [a, c, d, d]], dtype=np.int32)
    area, normal = face_geometry(mesh.points, face)
    halves = replace(square, node=face, area=area, normal=normal)
    assert is_triangle(face).all()
    shares = dict(zip(halves.nodes.tolist(), node_areas(halves), strict=True))
    assert [shares[k] for k in (a, b, c, d)] == pytest.approx([1.0 / 3.0, 1.0 / 6.0, 1.0 / 3.0, 1.0 / 6.0])


@pytest.mark.parametrize("device", DEVICES)
def test_laws_change_the_limit_in_turn(device: str):
    """On each node min(mu(v) F_n, tau_max A): the cap holds on the edges, the decay inside."""
    scene = block(friction=(DECAY, CAP))
    impact = finished(replace(scene, impact=replace(scene.impact, duration=1e-3)), device=device)
    spring, slave = impact.state.contacts[0].spring, impact.solver.contacts[0].slave.numpy()
    force, tangential, limit = (getattr(spring, name).numpy() for name in ("force", "tangential", "limit"))
    speed = impact.state.v.numpy()[slave, 0]
    inner = np.tile(np.where(np.isin(np.arange(6), (0, 5)), 0.5, 1.0), (6, 1))
    cap = CAP.tau_max * (inner * inner.T).ravel() * AREA / 25.0
    decaying = (DECAY.kinetic + (MU - DECAY.kinetic) * np.exp(-DECAY.decay * speed)) * (force - tangential)[:, 1]
    np.testing.assert_allclose(limit, np.minimum(decaying, cap), rtol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(tangential, axis=1), limit, rtol=1e-12)
    assert np.count_nonzero(np.isclose(limit, cap, rtol=1e-12)) == 20


def test_a_law_that_changes_nothing_gives_the_bits_of_coulomb():
    plain, same = (mca.run(block(friction=law), duration=3e-3) for law in ((), mca.ShearCap(tau_max=1e12)))
    for name, column in plain.history.items():
        np.testing.assert_array_equal(same.history[name], column)


def test_steps_of_several_rates_give_the_same_friction():
    scene = sunk(Setup(), replace(block(friction=(DECAY, CAP)), bodies=(_two_sizes(),)), MASS * GRAVITY)
    one, many = (mca.run(scene, multi_rate=rates, duration=3e-3) for rates in (1, 2))
    assert many.summary["multi_rate"] == 2 and one.F_t.sum() < -300.0
    assert many.F_t.sum() == pytest.approx(one.F_t.sum(), rel=1e-3)
    assert many.summary["energy_error"] < 1e-4


def _two_sizes() -> mca.Body:
    """The block with cells below of a quarter of the height of those above."""
    body = sliding_block.build(cells=1).bodies[0]
    mesh = mca.Box(size=(0.1, 0.02, 0.1), divisions=(5, 4, 5)).build()
    y = np.interp(mesh.points[:, 1], (0.0, 0.005, 0.01, 0.015, 0.02), (0.0, 0.001, 0.002, 0.01, 0.02))
    points = np.column_stack([mesh.points[:, 0], y, mesh.points[:, 2]])
    return replace(body, geometry=replace(mesh, points=points))


def test_points_that_slide_below_the_limit_at_rest_are_not_shown_as_sticking():
    memory = Memory(CONTACT)
    mca.run(block(friction=DECAY), duration=1e-3, recorders=[memory])
    frame = memory.frames[-1]
    assert len(frame.contact_points) > 0 and not frame.contact_stick.any()


def test_a_body_that_slides_under_a_law_is_not_said_to_creep():
    scene = block(friction=CAP)
    assert not any("creeps" in line for line in mca.run(scene, duration=0.015).summary.get("warnings", ()))


def test_a_model_file_holds_the_laws(tmp_path):
    for law in (DECAY, (DECAY, CAP)):
        scene = block(friction=law)
        model_file.save(tmp_path / "block.mca", scene, mca.mesh(scene))
        assert model_file.load(tmp_path / "block.mca").scene.contacts == scene.contacts


def test_both_passes_of_two_way_contact_bear_half_of_the_cap():
    box = mca.Box(size=(0.02, 0.02, 0.02), divisions=(2, 2, 2))
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    low = mca.Body(name="low", geometry=replace(box, divisions=(3, 3, 3)), material=steel)
    up = mca.Body(name="up", geometry=box, material=steel, position=(0.0, 0.02, 0.0), velocity=(1.0, -1.0, 0.0))
    slave, master = mca.Surface(body="up", nodes="ymin"), mca.Surface(body="low", nodes="ymax")
    contact = mca.Contact(slave=slave, master=master, mu=0.3, two_way=True, friction=CAP)
    impact = mca.ImpactPhase(duration=1e-5)
    scene = mca.Scene(name="boxes", bodies=(low, up), contacts=(contact,), impact=impact)
    for item in prepared(scene).model.passes:
        assert item.friction_parameters.sum() == pytest.approx(0.5 * 900.0 * 0.02**2, rel=1e-12)
    without = replace(contact, mu=0.0, friction=())
    result, smooth = (mca.run(replace(scene, contacts=(one,))) for one in (contact, without))
    assert result.F_t.min() == pytest.approx(-900.0 * 0.02**2, rel=1e-3)
    assert result.summary["energy_error"] == pytest.approx(smooth.summary["energy_error"], abs=1e-8)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: block(mu=0.0, friction=DECAY), r"Contact.mu = 0.0: give the coefficient at rest, above 0"),
        (lambda: block(mu=0.05, friction=DECAY), r"DecayingFriction.kinetic = 0.1: give at most .* Contact.mu = 0.05"),
        (lambda: block(friction=0.3), r"Contact.friction = 0.3: give a DecayingFriction or a ShearCap"),
        (lambda: block(friction=None), r"Contact.friction = None: give a DecayingFriction or a ShearCap"),
        (lambda: mca.DecayingFriction(kinetic=-0.1, decay=1.0), r"DecayingFriction.kinetic = -0.1: give a coefficient"),
        (lambda: mca.DecayingFriction(kinetic=0.1, decay=0.0), r"DecayingFriction.decay = 0.0: give a finite number"),
        (lambda: mca.ShearCap(tau_max=0.0), r"ShearCap.tau_max = 0.0: give a finite number above 0"),
    ],
)
def test_what_makes_no_sense_is_refused(make, words: str):
    with pytest.raises(mca.RequestError, match=f"^{words}"):
        make()
