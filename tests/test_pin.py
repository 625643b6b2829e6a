"""Hinges with pins: clusters of nodes around the axis keep one point and one axis, momentum, and energy."""

import numpy as np
import pytest
from impacts import finished, momentum, result_of
from scipy.spatial.transform import Rotation
from test_joint import SOFT

import warp_mca as mca
from warp_mca.base.rotation import mean_pose

SIZE = (0.1, 0.02, 0.02)
ORIGIN = (0.0, -0.01, -0.01)
TURNING = 30.0  # of each bar, in opposite directions [rad/s]


def bar(name, divisions, **change):
    box = mca.Box(size=SIZE, divisions=divisions, origin=ORIGIN)
    return mca.Body(name=name, geometry=box, material=SOFT, kinematics="finite", **change)


def bars(divisions=(10, 4, 2), other=(10, 4, 2), duration=2e-3, **change):
    """Two bars on a hinge at (0.1, 0, 0) that fold up, drift along z and turn about x."""
    speed = np.cross((0.0, 0.0, TURNING), (0.1, 0.0, 0.0))
    return mca.Scene(
        name="bars",
        bodies=(
            bar("a", divisions, angular_velocity=(5.0, 0.0, TURNING), velocity=(0.0, 0.0, 1.0)),
            bar(
                "b",
                other,
                position=(0.1, 0.0, 0.0),
                angular_velocity=(5.0, 0.0, -TURNING),
                velocity=(0.0, float(speed[1]), 1.0),
            ),
        ),
        joints=(mca.Revolute(name="A", body="a", at=(0.1, 0.0, 0.0), other="b", nodes="pin", pin_radius=0.008),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 20.0),
        **change,
    )


def poses(impact):
    """Point and axis of the first hinge as each of its clusters carries it, shape (2, 2, 3)."""
    model, (item, *_) = impact.solver.model, impact.solver.model.couplings
    x, found = model.X + impact.state.u.numpy(), []
    turns = Rotation.from_quat(impact.state.couplings.orientation.numpy()[0])
    for k, (start, end) in enumerate(((item.start, item.middle), (item.middle, item.end))):
        nodes = model.joint_first[start:end]
        weights = item.weight[start - item.start : end - item.start] * model.mass[nodes]
        _, centre, R = mean_pose(model.X[nodes], x[nodes], weights)
        assert turns[k].as_matrix() == pytest.approx(R, abs=2e-5)  # strain within the cluster lets them drift apart
        found.append((centre + turns[k].apply(item.arm[k]), turns[k].apply(item.axis)))
    return np.array(found)


@pytest.mark.parametrize("other", [(10, 4, 2), (7, 6, 3)], ids=["equal meshes", "meshes that do not match"])
def test_bars_on_a_pin_keep_momentum_angular_momentum_and_energy(other):
    impact = finished(bars(other=other), precision="float64")
    result, model = result_of(impact), impact.solver.model
    u, v = impact.state.u.numpy(), impact.state.v.numpy()
    scale = model.mass.sum()
    assert momentum(impact) == pytest.approx(model.mass @ model.V, abs=1e-14 * scale)
    before, after = (model.mass @ np.cross(x, w) for x, w in ((model.X, model.V), (model.X + u, v)))
    assert np.abs(before).max() > 0.1 * scale
    assert after == pytest.approx(before, abs=1e-14 * scale)
    (point, axis), (other_point, other_axis) = poses(impact)
    assert point == pytest.approx(other_point, abs=1e-15)
    assert axis == pytest.approx(other_axis, abs=1e-12)
    assert 1.0 - axis[2] > 1e-5  # it has turned
    assert result.summary["energy_error"] < 1e-6
    end = model.node_start["b"]
    gained = momentum(impact, 0, end) - model.mass[:end] @ model.V[:end]
    assert result.summary["joint_impulse"]["A"] == pytest.approx(gained, abs=1e-14 * scale)
