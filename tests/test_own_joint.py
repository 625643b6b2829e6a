"""A joint kind of the user's own: one dataclass and one registration, and the solver ties its nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from impacts import finished, momentum, result_of
from test_joint import BAR, HEAVY, SOFT

import warp_mca as mca
from warp_mca.scene.bodies import Vec3
from warp_mca.scene.joints import Joint
from warp_mca.scene.ties import Side, Ties, coincident

NORMAL = np.array([0.0, 0.8, 0.6])


@dataclass(frozen=True, kw_only=True)
class Planar(Joint):
    """Coincident nodes of two sets stay in one plane and slide along it; `normal` is in the scene's frame."""

    nodes: str
    other_nodes: str
    normal: Vec3

    def ties(self, first: Side, second: Side | None) -> Ties:
        """The nodes at the same place, along the normal."""
        assert second is not None
        pairs = coincident(first, first.mesh.nodes(self.nodes), second, second.mesh.nodes(self.other_nodes))
        return Ties(*pairs, tied=np.outer(self.normal, self.normal))


@pytest.fixture
def registered(register: Callable[..., object]) -> None:
    """The one registration."""
    register(Planar)


def pair(normal: Vec3 = tuple(NORMAL), **change) -> mca.Scene:
    return mca.Scene(
        name="pair",
        bodies=(
            mca.Body(name="a", geometry=BAR, material=SOFT, velocity=(0.0, 1.0, 0.0)),
            mca.Body(name="b", geometry=BAR, material=HEAVY, position=(0.1, 0.0, 0.0), velocity=(0.3, 0.3, 0.2)),
        ),
        joints=(Planar(name="P", body="a", nodes="xmax", other="b", other_nodes="xmin", normal=normal),),
        impact=mca.ImpactPhase(duration=3e-4, output_interval=1e-5, energy_tolerance=1.0),  # inelastic at the start
        **change,
    )


def test_pairs_share_the_motion_along_the_normal_and_no_other(registered: None):
    """Each body keeps its momentum along the plane, both together keep it along the normal; no energy is made."""
    impact = finished(pair(), precision="float64")
    result, model = result_of(impact), impact.solver.model
    u, v, start = impact.state.u.numpy(), impact.state.v.numpy(), model.node_start["b"]
    gained = [
        momentum(impact, *part) - model.mass[slice(*part)] @ model.V[slice(*part)]
        for part in ((0, start), (start, None))
    ]
    assert gained[0] + gained[1] == pytest.approx(0.0, abs=1e-14)
    assert gained[0] == pytest.approx((gained[0] @ NORMAL) * NORMAL, abs=1e-14)
    assert abs(gained[0] @ NORMAL) > 1e-3
    assert result.summary["joint_impulse"]["P"] == pytest.approx(gained[0], abs=1e-14)
    for motion in (u, v):
        apart = motion[model.joint_first] - motion[model.joint_second]
        assert apart @ NORMAL == pytest.approx(0.0, abs=1e-15)
    assert np.abs(u[model.joint_first] - u[model.joint_second]).max() > 5e-5
    total = result["E_kinetic"] + result["E_internal"]
    assert total[2:] == pytest.approx(total[2], rel=1e-3) and total[2] < total[0]


def test_a_batch_holds_scenes_with_hinges_beside(registered: None):
    """Each scene gives the digits that it gives alone."""
    alone = mca.run(pair())
    hinge = mca.Revolute(name="P", body="a", at=(0.1, 0.0, 0.0), other="b")
    hinged = mca.Scene(**{**vars(pair()), "joints": (hinge,)})
    both = mca.run_batch([hinged, pair()])
    for result, scene in zip(both, (hinged, pair()), strict=True):
        known = mca.run(scene) if scene is hinged else alone
        assert result["E_kinetic"] == pytest.approx(known["E_kinetic"], rel=1e-12)
        assert result.summary["joint_impulse"]["P"] == pytest.approx(known.summary["joint_impulse"]["P"], rel=1e-9)


def test_ties_that_project_on_nothing_are_refused(registered: None):
    with pytest.raises(mca.RequestError, match=r"Planar P.ties = .*: its ties must give an orthogonal projector"):
        mca.run(pair(normal=(0.0, 2.0, 0.0)))


def test_what_is_not_registered_is_refused():
    with pytest.raises(mca.RequestError, match=r"^Scene.joints\[0\] = .Planar.: give a Revolute or a Weld or "):
        pair()
