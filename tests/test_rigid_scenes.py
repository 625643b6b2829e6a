"""Owns the tests of whole rigid phases of built-in scenes: hand-off, a time before contact, hand-back of every body."""

import math

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.body_motion import held_axes
from warp_mca.rigid.handback import hand_back
from warp_mca.rigid.handoff import hand_off
from warp_mca.rigid.swing import swing_until
from warp_mca.rigid.target import moving_plane, node_gap
from warp_mca.scenes import single_link, three_link, two_link


def prepared(scene: mca.Scene) -> tuple:
    meshes = mca.mesh(scene)
    return scene, meshes, nodal_masses(scene, meshes)


def test_a_single_slender_link_strikes_with_its_closed_speed():
    state = hand_off(*prepared(single_link.build(rigid_inertia="slender", axial=4, section=2, ring=1)))
    cosine = (0.15 - 0.013) / (0.21 - 0.013)
    assert state.theta[0] == pytest.approx(math.acos(cosine), rel=1e-12)
    assert state.theta_dot[0] == pytest.approx(-math.sqrt(3.0 * 9.8 * cosine / 0.21), rel=1e-10)


@pytest.mark.parametrize("build", [single_link.build, two_link.build, three_link.build])
def test_all_bodies_go_to_finite_elements_and_back(build):
    """The links' motion comes back; shaken nodes keep their generalised momenta; the plate slides along x alone."""
    scene, meshes, masses = prepared(
        build(rigid_inertia="mesh", axial_OA=4, axial_AB=4) if build is two_link.build else build(axial=4)
    )
    state = hand_off(scene, meshes, masses)
    points, held = {name: mesh.points for name, mesh in meshes.items()}, held_axes(scene, meshes)
    back = hand_back(state.chain, points, masses, state.positions, state.velocities, near=state.theta, held=held)
    np.testing.assert_allclose(back.theta, state.theta, rtol=1e-12)
    np.testing.assert_allclose(back.theta_dot, state.theta_dot, rtol=1e-12)
    rng = np.random.default_rng(0)
    V = {name: v + rng.normal(size=v.shape) * ~held[name] for name, v in state.velocities.items()}
    back = hand_back(state.chain, points, masses, state.positions, V, near=state.theta, held=held)
    np.testing.assert_allclose(back.momenta[0], back.momenta[1], rtol=1e-12, atol=1e-16)
    total = sum(0.5 * masses[name] @ (v**2).sum(axis=1) for name, v in V.items())
    assert back.kinetic_energy + back.vibration_energy == pytest.approx(total, rel=1e-12)
    assert back.momenta.shape == (2, len(state.theta) + 1)
    np.testing.assert_allclose(back.placements["plate"].velocity[1:], 0.0, atol=1e-16)


def test_a_rigid_phase_ends_before_contact_where_it_is_asked_to():
    scene, meshes, masses = prepared(three_link.build(axial=4))
    whole = hand_off(scene, meshes, masses)
    part = hand_off(scene, meshes, masses, t_end=0.1)
    assert (part.t_contact, part.v_n, part.contact_point) == (None, None, None)
    assert (part.swing.ended_by, part.swing.t_end) == ("t_end", 0.1)
    rest = swing_until(part.chain, part.theta, part.theta_dot, (), t_start=0.1, t_end=whole.t_contact)
    np.testing.assert_allclose(rest.theta, whole.theta, atol=1e-10)
    assert hand_off(scene, meshes, masses, t_end=1.0).t_contact == whole.t_contact


def test_after_a_rebound_the_nodes_find_the_next_touch():
    """The tip leaves the plate with the speed of its approach; no node of the last link enters the plate before."""
    scene, meshes, masses = prepared(two_link.build(rigid_inertia="mesh"))
    state = hand_off(scene, meshes, masses)
    plane = moving_plane(meshes["plate"], scene.rigid.target, state.placements["plate"], state.t_contact)
    gap = node_gap(state.chain, 1, meshes["AB"].points, plane)
    assert 0.0 <= gap(state.t_contact, state.theta) < 2e-5  # the polyhedron of the nodes lies in the sphere
    run = swing_until(state.chain, state.theta, -state.theta_dot, (gap,), t_start=state.t_contact, t_end=2.0)
    assert run.ended_by == "touch" and run.t_end > state.t_contact + 0.1
    gaps = [gap(t, theta) for t, theta in zip(run.t, run.theta_t, strict=True)]
    assert min(gaps) > -1e-12 and abs(gaps[-1]) < 1e-12
