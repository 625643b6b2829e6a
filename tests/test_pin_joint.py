"""A hinge with pins solved by one block of threads gives what the step of couplings gives, but for rounding."""

import numpy as np
import pytest
import warp as wp
from impacts import begun
from test_pin import bar, bars

import warp_mca as mca
from warp_mca.kernels.nodes.cluster import Clusters
from warp_mca.kernels.nodes.coupling import Inverse
from warp_mca.kernels.nodes.hinge import Ahead, Side, hinge_inverse
from warp_mca.kernels.resident import pin_joint
from warp_mca.kernels.resident.node_role import Nodes
from warp_mca.kernels.resident.pin_joint import COLUMNS, TOTALS
from warp_mca.system.stage import Step


@wp.kernel(enable_backward=False)
def solve_alone(
    clusters: Clusters,
    nodes: Nodes,
    X: wp.array(dtype=wp.vec3d),
    v_free: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    pool: wp.array(dtype=wp.float64),
    sides: wp.array(dtype=Side),
    ahead: wp.array(dtype=Ahead),
    inverse: wp.array(dtype=Inverse),
    shared: wp.array(dtype=wp.vec3d),
    turn: wp.array(dtype=wp.quatd),
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    place_out: wp.array(dtype=wp.vec3d),
):
    """One thread in place of a block: rows of nodes are summed one after the other, as many of both clusters."""
    begin = clusters.begin[0]
    start = place_out[0]
    count = wp.max(begin[1] - begin[0], begin[2] - begin[1])
    for k in range(count):
        one = pin_joint.pinned_node(begin[0] + k, begin[1], start, clusters, nodes, X, u_out, v_out)
        other = pin_joint.pinned_node(begin[1] + k, begin[2], start, clusters, nodes, X, u_out, v_out)
        if one.node >= 0:
            one.v = v_free[one.node]
        if other.node >= 0:
            other.v = v_free[other.node]
        for part in range(2):
            a = pin_joint.moment_row(one, part)
            b = pin_joint.moment_row(other, part)
            for c in range(COLUMNS):
                pool[TOTALS + COLUMNS * part + c] += a[c]
                pool[TOTALS + COLUMNS * (2 + part) + c] += b[c]
        p = pin_joint.momentum_row(one, other)
        for c in range(COLUMNS):
            pool[TOTALS + COLUMNS * pin_joint.MOMENTA + c] += p[c]
    for side in range(2):
        pin_joint.find_side(0, side, clusters, turn, pool, sides, shared)
    inverse[0] = hinge_inverse(sides[0].mean, sides[1].mean, sides[0].axis)
    for side in range(2):
        pin_joint.find_ahead(side, dt, pool, sides, ahead)
    for side in range(2):
        pin_joint.find_impulses(side, wp.float64(1.0) / dt, sides, inverse, ahead, shared)
    for k in range(begin[0], begin[2]):
        node = pin_joint.pinned_node(k, begin[2], start, clusters, nodes, X, u_out, v_out)
        node.v = v_free[node.node]
        node = pin_joint.pulled(node, wp.where(k < begin[1], 0, 1), dt, shared)
        u_out[node.node] = node.u
        v_out[node.node] = node.v
    for side in range(2):
        pin_joint.carry_joint(0, side, dt, start, sides, ahead, turn, shared, place_out)


def on_the_ground():
    scene = bars()
    body = bar("bar", (6, 4, 1), rotation=(0.0, 0.0, 0.3), angular_velocity=(3.0, 2.0, 30.0))
    joint = mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0), nodes="pin", pin_radius=0.008)
    return mca.Scene(name="bar", bodies=(body,), joints=(joint,), impact=scene.impact)


@pytest.mark.parametrize("scene", [bars(other=(7, 6, 3)), on_the_ground()], ids=["two bodies", "ground"])
def test_one_block_joins_clusters_as_the_stages_of_a_step_do(scene):
    impact = begun(scene, precision="float64")
    solver, state = impact.solver, impact.state
    impact.advance(until=40)
    before, own = state.copy(), state.couplings
    solver.forces(state)
    solver.nodes.advance_bound(Step(state))
    v_free, turn = wp.clone(state.v), wp.array(before.couplings.orientation.numpy()[0].copy(), dtype=wp.quatd)
    solver.couplings.couple(Step(state))
    nodes = Nodes()
    nodes.data = solver.nodes.given(state)[0]
    pool, inverse = wp.zeros(pin_joint.SIDES, dtype=wp.float64), wp.zeros(1, dtype=Inverse)
    sides, ahead = wp.zeros(2, dtype=Side), wp.zeros(2, dtype=Ahead)
    shared = wp.zeros(pin_joint.VECTORS, dtype=wp.vec3d)
    inputs = [solver.couplings.clusters, nodes, solver.work.X, v_free, solver.couplings.dt]
    inputs += [pool, sides, ahead, inverse, shared, turn]
    wp.launch(solve_alone, 1, inputs=inputs, outputs=[before.u, before.v, before.couplings.place])
    pinned = impact.solver.model.joint_first
    pull = np.abs(state.v.numpy() - v_free.numpy())[pinned].max()
    assert pull > 0.0
    np.testing.assert_allclose(before.v.numpy()[pinned], state.v.numpy()[pinned], rtol=0.0, atol=1e-9 * pull)
    near = 1e-9 * solver.dt * pull + 1e-17
    np.testing.assert_allclose(before.u.numpy()[pinned], state.u.numpy()[pinned], rtol=0.0, atol=near)
    np.testing.assert_allclose(before.couplings.place.numpy(), own.place.numpy(), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(turn.numpy(), own.orientation.numpy()[0], rtol=0.0, atol=1e-15)
    assert np.abs(turn.numpy()[:, :3]).max() > 1e-6
