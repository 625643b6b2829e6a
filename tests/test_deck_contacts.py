"""Contacts, ties, walls, gravity, speeds and rigid parts of decks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_decks import deck, read

import warp_mca as mca

CONTACT = "*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE\n2, 1, 3, 3\n0.2, 0.1, 0.001\n1\n"
RIGID = "*MAT_RIGID\n7,7.85e-9,2.1e5,0.3\n"


def scene(tmp_path: Path, contact: str = "", steel: str | None = None, more: str = "") -> mca.Scene:
    """The bars of `test_decks` with another contact."""
    text = deck("commas", more, steel)
    assert CONTACT in text
    return read(tmp_path, text.replace(CONTACT, contact))


def skin(name: str) -> mca.Surface:
    return mca.Surface(body=name, nodes="boundary")


def test_single_surfaces_are_general_contact(tmp_path: Path):
    everything = scene(tmp_path, "*CONTACT_AUTOMATIC_SINGLE_SURFACE_ID\n5,all\n0\n0.3\n")
    assert everything.contacts == (mca.ContactAll(mu=0.3),)
    some = scene(tmp_path, "*SET_PART_LIST\n4\n2\n*CONTACT_AUTOMATIC_SINGLE_SURFACE\n4,0,2\n0\n")
    assert some.general_pairs() == [("hammer", "hammer")]


def test_sides_by_segments_nodes_and_boxes(tmp_path: Path):
    """The foot of the hammer against the top of the anvil, from above."""
    sets = "*SET_SEGMENT\n8\n101,102,104,103\n*DEFINE_BOX\n6,-1,3,-1,3,3.9,4.005\n"
    found = scene(tmp_path, f"{sets}*CONTACT_AUTOMATIC_NODES_TO_SURFACE\n8,1,0,3,0,6\n0,0,0,50.\n")
    (contact,) = found.contacts
    assert isinstance(contact, mca.Contact) and isinstance(contact.master, mca.Surface)
    assert (contact.slave.body, contact.master.body, contact.two_way) == ("hammer", "anvil", False)
    for side, height, count in ((contact.slave, 4.01e-3, 4), (contact.master, 4e-3, 4)):
        mesh = found.body(side.body).geometry
        assert isinstance(mesh, mca.Mesh)
        nodes = mesh.nodes(side.nodes)
        assert len(nodes) == count
        assert mesh.points[nodes, 2] == pytest.approx(np.full(count, height))


def test_factors_of_friction_count_and_those_of_springs_are_told(tmp_path: Path):
    found = scene(tmp_path, CONTACT.replace("0.001\n1\n", "0.001,50.\n,,,,,,0.5,0.1\n2\n"))
    (contact,) = found.contacts
    assert contact.mu == pytest.approx(0.1)
    assert mca.ShearCap(tau_max=5e6) in contact.friction
    notes = mca.mesh(found)["anvil"].notes
    assert any("SOFT and SLSFAC are left out" in note for note in notes)


def test_an_end_by_the_place_of_a_node_is_refused(tmp_path: Path):
    with pytest.raises(mca.RequestError, match="TERMINATION_NODE"):
        scene(tmp_path, CONTACT, more="*TERMINATION_NODE\n109,3,0.,1.\n")


def test_a_wall_holds_the_nodes_that_it_names(tmp_path: Path):
    wall = "*RIGIDWALL_PLANAR_ID\n1,wall\n{set}\n0,0,-1,0,0,0,{friction}\n"
    found = scene(tmp_path, wall.format(set=3, friction=1.0) + wall.format(set=0, friction=0.2))
    names = [(item.slave.body, item.slave.nodes, item.mu) for item in found.contacts if isinstance(item, mca.Contact)]
    assert names == [("anvil", "wall_3", 1e6), ("anvil", "boundary", 0.2), ("hammer", "boundary", 0.2)]
    (plane,) = {item.master for item in found.contacts if isinstance(item, mca.Contact)}
    assert plane == mca.RigidPlane(point=(0.0, 0.0, -1e-3), normal=(0.0, 0.0, 1e-3))


def test_tied_surfaces_are_tied_where_they_meet(tmp_path: Path):
    text = (
        deck("commas", "*CONTACT_TIED_SURFACE_TO_SURFACE\n2,1,3,3\n0\n")
        .replace(CONTACT, "")
        .replace(", -20000\n", "\n")
    )
    found = read(tmp_path, text.replace(", &speed\n", ", 0\n"))
    (tie,) = found.ties
    mesh = found.body("hammer").geometry
    assert isinstance(mesh, mca.Mesh)
    assert mesh.points[mesh.nodes(tie.slave.nodes), 2] == pytest.approx(np.full(4, 4.01e-3))
    mca.run(found, device="cpu", duration=2e-8)


def test_gravity_points_against_the_acceleration_of_the_frame(tmp_path: Path):
    load = "*LOAD_BODY_Z\n1,1.\n*DEFINE_CURVE\n1\n0,9810.\n1.,{last}\n"
    assert scene(tmp_path, CONTACT, more=load.format(last="9810.")).gravity == pytest.approx((0.0, 0.0, -9.81))
    found = scene(tmp_path, CONTACT, more=load.format(last="0."))
    assert [item.body for item in found.loads] == ["anvil", "hammer"]
    (first, _) = found.loads
    assert isinstance(first, mca.BodyForce) and first.acceleration == (0.0, 0.0, -1.0)
    assert first.table == mca.Amplitude(times=(0.0, 1.0), values=(9.81, 0.0))


def test_a_turning_part_has_the_speed_of_its_origin(tmp_path: Path):
    """100 rad/s about the axis x = 1 mm along z, and a local system that turns x to y."""
    local = "*DEFINE_COORDINATE_VECTOR\n2,0,1,0,-1,0,0\n"
    spin = f"{local}*INITIAL_VELOCITY_GENERATION\n2,2,100.,3000.,0,0,0,2\n1.,0,0,0,0,1.\n"
    hammer = scene(tmp_path, CONTACT, more=spin).body("hammer")
    assert hammer.angular_velocity == pytest.approx((0.0, 0.0, 100.0))
    assert hammer.velocity == pytest.approx((0.0, 3.0 - 0.1, 0.0), abs=1e-12)


def test_rigid_parts_slide_where_they_are_not_held(tmp_path: Path):
    """Translation along z is free; the strike stops the hammer, and moves it nowhere else."""
    text = deck("commas", steel=f"{RIGID}1,4,7\n").replace("*BOUNDARY_SPC_SET\n3, 0, 1, 1, 1\n", "")
    steel = "*MAT_ELASTIC\n8,7.85e-9,2.1e5,0.3\n"
    found = read(
        tmp_path, text.replace("anvil\n1, 1, 7\n", "anvil\n1, 1, 8\n").replace("*DEFINE_BOX", f"{steel}*DEFINE_BOX")
    )
    assert found.rigid_names == ["hammer"]
    (joint,) = found.joints
    assert isinstance(joint, mca.Articulation)
    assert joint.at == pytest.approx((1e-3, 1e-3, 6.01e-3))
    assert joint.freedoms == (mca.Freedom(kind="slide", axis=(0.0, 0.0, 1.0)),)
    assert mca.run(found, device="cpu", duration=1e-6).F_n.max() > 0.0


def test_parts_that_share_nodes_are_one_body(tmp_path: Path):
    """A third part on top of the hammer, with a material and a section of its own."""
    soft = "*MAT_ELASTIC\n9,1e-9,3000.,0.4\n*SECTION_SOLID\n2,2\n*PART\npad\n3,2,9\n*NODE\n"
    top = "".join(f"{113 + k},{2 * (k % 2)},{2 * (k // 2)},10.01\n" for k in range(4))
    solid = "*ELEMENT_SOLID\n9,3,109,110,112,111,113,114,116,115\n"
    found = scene(tmp_path, CONTACT, more=soft + top + solid + "*INITIAL_VELOCITY\n0\n0,0,-20000.\n")
    anvil, whole = found.bodies
    assert (anvil.name, whole.name) == ("anvil", "hammer+pad")
    assert isinstance(whole.material, dict)
    assert whole.material["pad"] == mca.Elastic(E=3e9, nu=0.4, rho=1000.0)
    assert isinstance(whole.geometry, mca.Mesh)
    assert {name: len(cells) for name, cells in whole.geometry.cell_sets.items()} == {"hammer": 2, "pad": 1}
    assert found.prescribed[0].body == "anvil"  # held, though the speed is given to all nodes
