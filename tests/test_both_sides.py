"""Faces and corners that nodes of the slave alone do not keep apart, and springs of general contact beside them."""

import numpy as np
import pytest
from impacts import prepared
from scipy.spatial.transform import Rotation

import warp_mca as mca

L = 0.02
SOFT = mca.Elastic(E=1e7, nu=0.3, rho=1000.0)
STIFF = mca.Elastic(E=2e9, nu=0.3, rho=2000.0)
RUBBER = mca.Elastic(E=3e6, nu=0.49, rho=1100.0)


def pressed(
    material: mca.Elastic, contacts: tuple | str, strain: float = 0.05, stiff: mca.Elastic = STIFF, width: float = L
) -> mca.Scene:
    """A cube of 4 x 4 x 4 cells between two stiff blocks, of which the upper one comes down without a jerk."""
    end = mca.Box(size=(width, 0.01, width), divisions=(4, 2, 4), origin=(0.5 * (L - width), 0.0, 0.5 * (L - width)))
    times = np.linspace(0.0, 1e-2, 41)
    speeds = -strain * L / times[-1] * (1.0 - np.cos(2.0 * np.pi * times / times[-1]))
    return mca.Scene(
        name="pressed",
        bodies=(
            mca.Body(name="soft", geometry=mca.Box(size=(L, L, L), divisions=(4, 4, 4)), material=material),
            mca.Body(name="top", geometry=end, material=stiff, position=(0.0, L, 0.0)),
            mca.Body(name="base", geometry=end, material=stiff, position=(0.0, -0.01, 0.0)),
        ),
        contacts=contacts,  # type: ignore[arg-type]
        fixed=(mca.Fixed(body="base", nodes="ymin"),),
        prescribed=(mca.Prescribed(body="top", nodes="ymax", axis="y", times=tuple(times), velocities=tuple(speeds)),),
        impact=mca.ImpactPhase(duration=1e-2, output_interval=1e-4),
    )


def listed(**contact) -> tuple[mca.Contact, ...]:
    """The cube's faces against those of the blocks; the force is that of the upper one."""
    faces = {"top": ("ymax", "ymin", -1.0), "base": ("ymin", "ymax", 1.0)}
    return tuple(
        mca.Contact(
            slave=mca.Surface(body="soft", nodes=own),
            master=mca.Surface(body=name, nodes=its),
            normal=(0.0, sign, 0.0),
            internal=name == "base",
            **contact,
        )
        for name, (own, its, sign) in faces.items()
    )


def test_nodes_that_bulge_over_a_border_still_bear_their_share():
    """The outer nodes slid off the stiff blocks, with half a row of cells: 44 % of E strain A, or a stopped run."""
    result = mca.run(pressed(SOFT, listed(penalty=10.0)), figures="none")
    loss = result.summary["contact_spring_loss"]["soft–top"]
    assert result.F_n[-5:].mean() == pytest.approx(SOFT.E * 0.05 * L**2 * (1.0 + loss), rel=0.03)
    assert result.summary["energy"]["contact_loss"] < 1e-3 * result.summary["energy"]["external_work"]


@pytest.mark.parametrize(
    ("stiff", "width", "two_way"),
    [(STIFF, L, True), (STIFF, 1.02 * L, True), (STIFF, 2.0 * L, False), (SOFT, L, False)],
)
def test_only_soft_faces_that_end_at_the_border_of_stiffer_ones_are_two_way(stiff, width, two_way):
    model = prepared(pressed(SOFT, listed(), stiff=stiff, width=width)).model
    assert len(model.passes) == (4 if two_way else 2)


@pytest.mark.parametrize("stiff", [STIFF, RUBBER])
def test_springs_of_general_contact_are_those_of_two_way_contacts(stiff):
    """Rubber had an eighth of their stiffness, and what lies on something stiffer half of it."""

    def within(contacts) -> float:
        model = prepared(pressed(RUBBER, contacts, stiff=stiff)).model
        item = model.passes[0]
        middle = np.abs(model.X[item.slave] - (0.5 * L, L, 0.5 * L)).sum(axis=1).argmin()
        factor = 1.0 if item.pairs is None else item.pairs.factor[0, 1]
        return factor * float(item.stiffness[middle])

    assert within("all") == pytest.approx(within(listed(two_way=True)), rel=0.02)


def test_what_springs_of_general_contact_take_of_a_slow_drive_is_said():
    """Its force of all adds those of both faces. A third of what was missing was said."""
    scene = pressed(SOFT, "all", stiff=STIFF, width=2.0 * L)
    result = mca.run(scene, figures="none")
    (loss,) = result.summary["contact_spring_loss"].values()
    measured = result.F_n[-5:].mean() / (2.0 * SOFT.E * 0.05 * L**2) - 1.0
    assert measured < -0.3
    assert loss == pytest.approx(measured, abs=0.05)


@pytest.mark.parametrize("turn", [(0.6, 0.1, 0.8), (0.0, 0.0, 0.8)])
def test_a_corner_or_an_edge_of_the_master_does_not_sink_into_a_face_of_the_slave(turn):
    """No slave node was near, so that there was no force, and no word of it."""
    cube = mca.Box(size=(L, L, L), divisions=(3, 3, 3), origin=(-0.01, -0.01, -0.01))
    slab = mca.Box(size=(2 * L, 0.01, 2 * L), divisions=(9, 2, 9), origin=(-L, -0.01, -L))
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    low = float((Rotation.from_rotvec(turn).as_matrix() @ cube.build().points.T)[1].min())
    bodies = (
        mca.Body(name="slab", geometry=slab, material=steel),
        mca.Body(
            name="cube",
            geometry=cube,
            material=steel,
            rotation=turn,
            position=(0.0, 1e-5 - low, 0.0),
            velocity=(0.0, -8.0, 0.0),
        ),
    )

    def impulse(slave: str, master: str, two_way: bool | None = None) -> float:
        one, other = (mca.Surface(body=name, nodes="boundary") for name in (slave, master))
        contact = mca.Contact(slave=one, master=other, normal=(0.0, 1.0, 0.0), two_way=two_way)
        impact = mca.ImpactPhase(duration=3e-5, output_interval=3e-7)
        result = mca.run(
            mca.Scene(name="poke", bodies=bodies, contacts=(contact,), impact=impact), figures="none", device="cpu"
        )
        return abs(float(np.trapezoid(result.F_n, result.time)))

    both = impulse("cube", "slab", two_way=True)
    assert impulse("slab", "cube") == pytest.approx(both, rel=1e-3)
    assert 0.6 < both / impulse("cube", "slab") < 1.1  # springs hold most of the energy
