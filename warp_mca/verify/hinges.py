"""Owns the cases of finite elements on hinges: spinning rods, and a double pendulum beside the rigid chain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.recorders.recorder import Cadence, FramesOnly
from warp_mca.verify.case import Row, Setup, case
from warp_mca.verify.vibration import fitted_frequencies

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.recorders.recorder import Frame, RunInfo


E, RHO, LENGTH, SIDE = 70e9, 2700.0, 1.0, 0.01  # of the spinning rod [Pa], [kg/m^3], [m], [m]
PACE = math.sqrt(E / RHO) / LENGTH  # of waves along it [1/s]
OMEGA = PACE / 120.0  # of the rod [rad/s]: slower, and round-off of mixed precision would show in its small strains


def spin(setup: Setup, count: int, hinged: bool, periods: float) -> tuple[mca.Result, Array]:
    """The run of a rod of `count` cells, and the stress along it at its probes [Pa], shape (row_count, count + 1)."""
    rod = {"E": E, "rho": RHO, "length": LENGTH, "side": SIDE, "omega": OMEGA}
    result = setup.run(setup.scene("spinning_rod", axial=count, hinged=hinged, periods=periods, **rod))
    stress = result.paths[0].stress.astype(np.float64)
    c, s = np.cos(OMEGA * result.time)[:, None], np.sin(OMEGA * result.time)[:, None]
    return result, c**2 * stress[..., 0] + s**2 * stress[..., 1] + 2.0 * c * s * stress[..., 3]


def windowed_mean(curve: Array) -> float:
    """Mean with the weights of a Hann window, which leaves out what oscillates a few times."""
    weight = np.hanning(len(curve))
    return float(weight @ curve / weight.sum())


def _free_spin(setup: Setup, count: int) -> tuple[float, float]:
    """Mean and greatest stress at the centre of a rod that spins freely [Pa]."""
    _, stress = spin(setup, count, hinged=False, periods=4.0)
    middle = stress[:, count // 2]
    return windowed_mean(middle), float(middle.max())


def _hinged_spin(setup: Setup, count: int) -> tuple[float, float]:
    """Mean stress in the middle [Pa], and mean reaction of the hinge [N]."""
    result, stress = spin(setup, count, hinged=True, periods=4.0)
    # the hinge holds one line of nodes, so it yields and lengthens the periods: take whole ones of what is there
    lowest = 0.25 * PACE
    found = fitted_frequencies(result.time, stress[:, count // 2], (lowest, 3.0 * lowest, 5.0 * lowest))
    result, stress = spin(setup, count, hinged=True, periods=4.0 * lowest / float(found[0]))
    turn = OMEGA * result.summary["simulated_time"]
    inward = -np.array([math.cos(0.5 * turn), math.sin(0.5 * turn), 0.0])
    # a force that turns by `turn` gives an impulse along its middle direction, shorter by the chord over the arc
    chord = 2.0 * math.sin(0.5 * turn) / OMEGA
    reaction = float(inward @ result.summary["joint_impulse"]["O"] / chord)
    return windowed_mean(stress[:, count // 2]), reaction


@case(
    group="rigid",
    title="A spinning rod: stress by its centrifugal load, free and on a hinge, and the hinge's reaction",
    reference="One-dimensional theory: stress rho omega^2 (L^2 - x^2) / 2 from the pivot, twice that at most after a "
    "start free of stress; reaction m omega^2 L / 2.",
)
def spinning_rod(setup: Setup) -> list[Row]:
    """L = 1 m, 10 mm x 10 mm, E = 70 GPa, rho = 2700 kg/m^3, nu = 0, omega = c / (120 L); four axial periods.

    A Hann window over four periods leaves out the lasting oscillation to some 1e-5. The reaction is a plain mean, over
    whole periods.
    """
    load = RHO * OMEGA**2 * LENGTH**2
    counts = setup.choose((20, 40), (20, 40, 80))
    centre, greatest = zip(*(_free_spin(setup, count) for count in counts), strict=True)
    middle, reaction = zip(*(_hinged_spin(setup, count) for count in counts), strict=True)
    window = setup.by_element(
        "what the window leaves of the oscillation",
        tet4="stress of a tetrahedron is constant, and those around a node are not symmetric about it: order 1",
    )
    ripples = "ripples where waves meet, shorter than a few elements"
    hinge = (
        "what the window leaves of the oscillation, and the hinge's disturbance of the stress at 50 widths: the line "
        "of nodes that it holds pulls sections crooked, by turns to either side; from one to the next that falls to "
        "0.85, 0.71, 0.43 of itself with cells of hex8i 10, 5, 2.5 times as long as deep, to half or less with hex8"
    )
    higher = "higher modes, of which four periods of the lowest are not whole ones"
    return [
        Row("free: mean stress at the centre", load / 8.0, centre, "Pa", setup.by_element(1e-4, tet4=5e-4), window),
        Row("free: greatest stress at the centre", load / 4.0, greatest, "Pa", 0.003, ripples),
        Row("hinged: mean stress at L / 2", load * 3.0 / 8.0, middle, "Pa", 0.0002, hinge),
        Row("hinged: mean reaction", 0.5 * load * SIDE**2, reaction, "N", 0.0002, higher),
    ]


THETA, THETA_DOT = (1.2, 0.4), (-1.0, 3.0)  # of the double pendulum at first [rad], [rad/s]
SPAN = 0.4  # of its motion [s]


def rigid_pendulum(meshes: dict[str, Mesh], masses: dict[str, Array]) -> tuple[Array, Array, float]:
    """Displacement of tip and of hinge A [m], each shape (2,), float64, and kinetic energy [J] after SPAN."""
    from warp_mca.rigid.chain import Chain
    from warp_mca.rigid.link import mesh_link
    from warp_mca.rigid.swing import swing

    links = [mesh_link(name, meshes[name].points, masses[name], hinge_out=(LENGTH, 0.0)) for name in ("OA", "AB")]
    chain = Chain(tuple(links), gravity=(0.0, -9.8))
    end = swing(chain, THETA, THETA_DOT, lambda t, _: SPAN - t, t_max=2.0 * SPAN)
    start = np.array(THETA), np.array(THETA_DOT)

    def travel(link: int) -> Array:
        far = (LENGTH, 0.0)
        return chain.at(link, far, end.theta, end.theta_dot)[0] - chain.at(link, far, *start)[0]

    return travel(1), travel(0), chain.kinetic_energy(end.theta, end.theta_dot)


class _Ends(FramesOnly):
    """A recorder that keeps how far the end of each link has travelled.

    The sum of the history's velocities would not do: links vibrate faster than rows are written, in mixed precision at
    some mm/s by round-off, of which a thousand rows leave 1e-5 m.

    Attributes:
        travel: displacement of the middle of each link's far end since t = 0 [m], shape (3,), float64, by body.
    """

    name = "ends"
    needs = frozenset(("surface",))

    def __init__(self) -> None:
        self.cadence = Cadence(frames=2)
        self.travel: dict[str, Array] = {}
        self._nodes: dict[str, NDArray[np.intp]] = {}
        self._first: dict[str, Array] = {}

    def start(self, info: RunInfo) -> None:
        """Choose the nodes: of each link's far end, on the hinge axis."""
        for link, surface in info.surfaces.items():
            origin = info.scene.body(link).position
            # of the far end, the hinge axis alone is LENGTH from the near hinge
            x, y = (info.model.X[surface.nodes] - origin).T[:2]
            self._nodes[link] = np.flatnonzero(np.abs(np.hypot(x, y) - LENGTH) < 1e-6 * LENGTH)

    def frame(self, frame: Frame) -> None:
        """Measure from the first frame."""
        for link, nodes in self._nodes.items():
            here = frame.points[link][nodes].astype(np.float64).mean(axis=0)
            self.travel[link] = here - self._first.setdefault(link, here)


@case(
    group="rigid",
    title="A stiff double pendulum of finite elements swings as the chain of rigid links does",
    reference="The rigid chain, verified by itself above.",
)
def fe_double_pendulum(setup: Setup) -> list[Row]:
    """Links of 1 m x 0.2 m x 0.1 m, 1000 and 2000 kg/m^3, E = 200 MPa and four times that; 0.4 s under gravity."""
    return _swinging_links(setup)


@case(
    group="rigid",
    title="The same double pendulum with pins, which join the mean motion of the nodes around each hinge axis",
    reference="The rigid chain, verified by itself above.",
)
def pinned_double_pendulum(setup: Setup) -> list[Row]:
    """Pins of 150 mm; four cells along the depth in place of two."""
    return _swinging_links(setup, joint_nodes="pin", pin_radius=0.15, deep=4)


def _swinging_links(setup: Setup, **parameters: object) -> list[Row]:
    """Tip, hinge A and kinetic energy at the end of a swing, for links of rising stiffness."""
    from warp_mca.accuracy.simulation import mesh
    from warp_mca.physics.elements.cells import nodal_masses

    moduli = setup.choose((200e6, 800e6), (200e6, 800e6, 3200e6))
    start = {"theta_OA": THETA[0], "theta_AB": THETA[1], "rate_OA": THETA_DOT[0], "rate_AB": THETA_DOT[1]}
    scenes = [setup.scene("double_pendulum", E=E, length=LENGTH, duration=SPAN, **start, **parameters) for E in moduli]
    meshes = mesh(scenes[0])
    tip_exact, hinge_exact, kinetic_exact = rigid_pendulum(meshes, nodal_masses(scenes[0], meshes))
    tip, hinge, kinetic = [], [], []
    for scene in scenes:
        ends = _Ends()
        result = setup.run(scene, meshes, recorders=[ends])
        tip.append(float(np.linalg.norm(ends.travel["AB"][:2] - tip_exact)))
        hinge.append(float(ends.travel["OA"][0]))
        kinetic.append(float(result["E_kinetic"][-1]))
    share = moduli[1] / moduli[-1]
    sizes = tuple(1.0 / math.sqrt(E) for E in moduli)
    why = "the links bend and stretch in proportion to 1 / E, and so by order 2 in the inverse of the speed of waves"
    # float32 feeds up to 4e-6 of the energy into vibration of links that turn, beside an error of 4e-5 to 5e-5
    order = 1.7 if setup.precision == "float64" else 1.6
    distance = "distance of the tip from that of the rigid chain"
    energy = "kinetic energy at the end"
    return [
        Row(distance, 0.0, tip, "m", 3e-4 * share, why, scale=LENGTH, sizes=sizes, least_order=1.7),
        Row("displacement of hinge A along x", float(hinge_exact[0]), hinge, "m", 3e-4 * share, why, sizes=sizes),
        Row(energy, kinetic_exact, kinetic, "J", 3e-4 * share, why, sizes=sizes, least_order=order),
    ]
