"""Owns the cycle of phases: a swing until something touches, an impact until all has parted, and so on.

Each kind of phase has a driver, which takes a `Motion` and returns the next one with its part of the history.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import GuardError
from warp_mca.geometry.mesh import Mesh
from warp_mca.kernels.records.columns import NORMAL_IMPULSE
from warp_mca.model.model import build_model, nodal_masses
from warp_mca.results.paths import Found, locate
from warp_mca.rigid.body_motion import held_axes
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.handback import HandBack, carriage_motion, deformed_chain, hand_back
from warp_mca.rigid.handoff import hand_off
from warp_mca.rigid.placement import Placement, link_placements
from warp_mca.rigid.swing import Swing, swing_until
from warp_mca.rigid.target import TargetPlane, TurningPlane, moving_plane, node_gap, target_plane
from warp_mca.runs.advice import mesh_warnings
from warp_mca.runs.arguments import Progress
from warp_mca.runs.impact import Impact
from warp_mca.runs.meshing import mesh
from warp_mca.runs.motion import Motion
from warp_mca.runs.plastic_history import give_history, take_history
from warp_mca.runs.prepare import Clock, Prepared
from warp_mca.runs.residual import Relaxation
from warp_mca.runs.settings import Settings
from warp_mca.scene import RigidPlane, Scene, Surface
from warp_mca.solve.solver import Solver
from warp_mca.solve.state import State

Array = NDArray[np.float64]

CLEARANCE = 1e-3  # of a slave face's edge, that bodies are apart when a later impact begins: shapes settle by less
BENDING = 2.0 * math.pi / 15.418  # T c kappa / L^2 of the first bending of a rod with a hinge at one end


@dataclass(frozen=True, kw_only=True)
class SwingPart:
    """What a rigid phase adds to a run.

    Attributes:
        motion: at its beginning.
        swing: how the chain moved.
        kinetic: of the other bodies, which move on as they are [J].
        stopped: why the run ends here, in one sentence, or None.
    """

    motion: Motion
    swing: Swing
    kinetic: float
    stopped: str | None = None


@dataclass(frozen=True, kw_only=True)
class ImpactPart:
    """What an impact phase adds to a run.

    Attributes:
        start, end: time from the release [s].
        ended_by: "separation", "duration" or "t_end".
        impact: as it ended.
        theta: angles of the links at the start [rad], shape (link_count,), float64.
        jump: kinetic energy of the nodes at the start less that of the rigid bodies [J].
        settled: elastic energy that the shape lost when it settled at the start [J].
        back: the way back to rigid bodies; None where the run ends with the impact.
        lost: energy of vibration that the way back leaves out [J].
        jump_back: kinetic energy of the chain that swings on, less that of its nodes' rigid motion [J].
        hinge_impulse: that each link's inbound hinge gave when the motion became rigid [N s], by joint, shape (2,).
    """

    start: float
    end: float
    ended_by: str
    impact: Impact
    theta: Array
    jump: float
    settled: float
    back: HandBack | None
    lost: float
    jump_back: float
    hinge_impulse: Mapping[str, Array]


Part = SwingPart | ImpactPart


class Cycle:
    """A scene that goes through swings and impacts in turn.

    Attributes:
        scene: with `t_end`.
        meshes: of its bodies.
        masses: lumped nodal masses [kg] by body.
        parts: phases so far.
        first: the first hand-off.
        ready: the first impact's scene, or what a run without one says of it.
    """

    def __init__(
        self,
        scene: Scene,
        meshes: Mapping[str, Mesh] | None,
        span: float,
        settings: Settings,
        clock: Clock,
        tell: Progress,
    ) -> None:
        """Mesh the scene; each impact lasts at most `span` [s]."""
        tell("mesh", 0.0)
        self.scene, self.span, self.settings, self.clock, self.tell = scene, span, settings, clock, tell
        self.meshes = mesh(scene, None, meshes)
        self.masses = nodal_masses(scene, self.meshes)
        self.held = held_axes(scene, self.meshes)
        self.places: Found = {}
        self.parts: list[Part] = []
        assert scene.t_end is not None and scene.rigid is not None
        self.t_end, self.rigid = scene.t_end, scene.rigid
        clock.lap("mesh")

    def run(self) -> None:
        """Go through the phases until the time is up.

        Raises:
            RequestError: the scene cannot be built as written.
            GuardError: an impact lost its footing.
        """
        motion, part = self._first_swing()
        while True:
            self.parts.append(part)
            self.clock.lap("rigid")
            if part.swing.ended_by == "t_end" or part.stopped:
                return
            after, impact = self._impact(motion)
            self.parts.append(impact)
            if after is None:
                return
            motion, part = self._swing(after)

    def _first_swing(self) -> tuple[Motion, SwingPart]:
        """From the release to the first touch."""
        self.tell("rigid", 0.0)
        start = hand_off(self.scene, self.meshes, self.masses, t_end=self.t_end)
        assert start.chain is not None and start.swing is not None
        self.first, self.chain = start, start.chain
        release = Motion(
            t=0.0,
            chain=start.chain,
            theta=start.swing.theta_t[0],
            theta_dot=start.swing.theta_dot_t[0],
            placements=start.placements,
        )
        motion = replace(release, t=start.swing.t_end, theta=start.theta, theta_dot=start.theta_dot)
        return motion, SwingPart(motion=release, swing=start.swing, kinetic=self._others(start.placements))

    def _others(self, placements: Mapping[str, Placement]) -> float:
        """Kinetic energy of the bodies that are no links [J]."""
        links = {link.body for link in self.chain.links}
        moving = {name: p.place(self.meshes[name].points)[1] for name, p in placements.items() if name not in links}
        return float(sum(0.5 * self.masses[name] @ (V**2).sum(axis=1) for name, V in moving.items()))

    def _swing(self, motion: Motion) -> tuple[Motion, SwingPart]:
        """From a separation to the next touch of any link."""
        self.tell("rigid", motion.t / self.t_end)
        plane = self._plane(motion)
        gaps = [
            node_gap(motion.chain, k, motion.points(link.body, self.meshes[link.body].points), plane)
            for k, link in enumerate(motion.chain.links)
        ]
        clearance = self._clearance()
        apart = [lambda t, theta, gap=gap: gap(t, theta) - clearance for gap in gaps]
        run = swing_until(motion.chain, motion.theta, motion.theta_dot, apart, t_start=motion.t, t_end=self.t_end)
        placed = motion.chain.moved_to(run.t_end)
        links = link_placements(placed, run.theta, run.theta_dot)
        placements = {name: p.after(run.t_end - motion.t) for name, p in motion.placements.items()} | links
        after = replace(motion, t=run.t_end, theta=run.theta, theta_dot=run.theta_dot, placements=placements)
        stopped = self._unknown_touch(after, run, plane) if run.ended_by == "touch" else None
        return after, SwingPart(motion=motion, swing=run, kinetic=self._others(motion.placements), stopped=stopped)

    def _plane(self, motion: Motion) -> TargetPlane | TurningPlane:
        """The target, which moves on."""
        target = self.rigid.target
        if isinstance(target, RigidPlane):
            return target_plane(self.scene, target, self.meshes)
        return moving_plane(self.meshes[target.body], target, motion.placements[target.body], motion.t)

    def _slaves(self) -> dict[str, NDArray[np.int32]]:
        """Nodes of each link that a contact keeps out of the target."""
        target, found = self.rigid.target, {}
        for contact in self.scene.contacts:
            sides = [(contact.slave, contact.master)]
            if isinstance(contact.master, Surface):
                sides.append((contact.master, contact.slave))
            for own, other in sides:
                meets = other == target or (
                    isinstance(other, Surface) and isinstance(target, Surface) and other.body == target.body
                )
                if meets and isinstance(own, Surface):
                    nodes = np.unique(self.meshes[own.body].surface(own.nodes)[0])
                    found[own.body] = np.union1d(found.get(own.body, nodes), nodes)
        return found

    def _clearance(self) -> float:
        """How far bodies are apart at the start of a later impact [m]."""
        edges = []
        for body, nodes in self._slaves().items():
            faces = self.meshes[body].boundary[0]
            faces = faces[np.isin(faces, nodes).all(axis=1)]
            corners = self.meshes[body].points[faces]
            edges.append(float(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1).min()))
        return CLEARANCE * min(edges, default=0.0)

    def _unknown_touch(self, motion: Motion, run: Swing, plane: TargetPlane | TurningPlane) -> str | None:
        """Why what touched cannot be computed, or None: no contact of the scene says what happens there."""
        assert run.touched is not None
        name = motion.chain.links[run.touched].body
        world, _ = motion.placements[name].place(motion.points(name, self.meshes[name].points))
        point, normal = plane.at(run.t_end)
        node = int(((world - point) @ normal).argmin())
        if node in self._slaves().get(name, ()):
            return None
        x, y, z = world[node]
        return (
            f"the run ends at t = {run.t_end:.4g} s: {name} touches the target at ({x:.4g}, {y:.4g}, {z:.4g}) m, where "
            "no contact of the scene keeps it out; add these nodes to a Contact"
        )

    def _impact(self, motion: Motion) -> tuple[Motion | None, ImpactPart]:
        """From a touch until all contacts have parted."""
        X, u, V = self._place(motion)
        watched = [(link.body, node) for link in self.chain.links for node in self.link_ends(link.body)]
        model = build_model(self.scene, self.meshes, X, V, watched, chain=self.chain, start=motion.t)
        probes = locate(self.scene, model, self.meshes, self.places)
        warnings = () if self._impacts else tuple(mesh_warnings(self.scene, self.meshes, model))
        ready = Prepared(self.scene, self.meshes, self.first, model, probes, warnings)
        rotations = {name: p.rotation for name, p in motion.placements.items()}
        self.clock.lap("mesh")
        self.tell("compile", 0.0)
        settled = 0.0

        def shape(solver: Solver, state: State) -> None:
            nonlocal settled
            give_history(solver, state, motion.history, rotations)
            relaxation = Relaxation(model, device=self.settings.device, threads=self.settings.threads, dt=solver.dt)
            found = relaxation.settle(np.concatenate([u[body.name] for body in self.scene.bodies]), state)
            settled = motion.elastic + motion.hourglass - found.elastic - found.hourglass
            state.u.assign(found.u)

        span = min(self.span, self.t_end - motion.t)
        impact = Impact([ready], span, **vars(self.settings), shape=shape if motion.shapes else None)
        self.clock.lap("compile")
        self._advance(impact)
        self.clock.lap("fe")
        if impact.stopped[0] is not None:
            raise GuardError(f"impact {self._impacts + 1}: {impact.stopped[0]}")
        rows = impact.accounts[0].ledger.kept.count - 1
        end = motion.t + rows * impact.steps.interval
        ended_by = "separation" if rows < impact.steps.intervals else "duration" if span == self.span else "t_end"
        part = ImpactPart(
            start=motion.t,
            end=end,
            ended_by=ended_by,
            impact=impact,
            theta=self.chain.angles(motion.theta),
            jump=self._kinetic(V) + self._carriage_kinetic(motion) - self._rigid_kinetic(motion),
            settled=settled,
            back=None,
            lost=0.0,
            jump_back=0.0,
            hinge_impulse={},
        )
        return (None, part) if ended_by == "t_end" else self._hand_back(motion, part, rotations)

    @property
    def _impacts(self) -> int:
        return sum(isinstance(part, ImpactPart) for part in self.parts)

    def _advance(self, impact: Impact) -> None:
        """Until all contacts have been open for a while, or to the end of its time."""
        account, interval = impact.accounts[0], impact.steps.interval
        passes, wait = len(account.ready.model.passes), self.open_time
        springs = account.ledger.springs

        def told() -> None:
            self.tell("impact", impact.rows / (impact.steps.intervals + 1))

        def ended() -> bool:
            sums = account.ledger.kept.sums
            if (len(sums) - 1) * interval < wait or not passes:
                return False
            recent = np.array(sums[-math.ceil(wait / interval) :])
            return not (springs(recent)[..., NORMAL_IMPULSE] > 0.0).any()

        impact.advance(told=told, ended=ended)

    @property
    def open_time(self) -> float:
        """How long all contacts must be open for an impact to end [s]."""
        if self.scene.impact.open_time is not None:
            return self.scene.impact.open_time
        return max(_bending_period(self.scene, link.body, self.meshes, self.masses) for link in self.chain.links)

    def _place(self, motion: Motion) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
        """Reference positions [m], displacements [m] and velocities [m/s] of the nodes by body.

        Nodes without displacement lie where the undeformed chain has them, so that those of hinges coincide.
        """
        placed = self.chain.moved_to(motion.t)
        plain = {**motion.placements, **link_placements(placed, motion.theta, motion.theta_dot)}
        X, u, V = {}, {}, {}
        for body in self.scene.bodies:
            name, points = body.name, self.meshes[body.name].points
            X[name], V[name] = plain[name].place(points)
            if motion.shapes:
                deformed, V[name] = motion.placements[name].place(motion.points(name, points))
                u[name] = deformed - X[name]
        return X, u, V

    def _kinetic(self, V: Mapping[str, Array]) -> float:
        """Kinetic energy of the nodes [J]."""
        return float(sum(0.5 * self.masses[name] @ (v**2).sum(axis=1) for name, v in V.items()))

    def _carriage_kinetic(self, motion: Motion) -> float:
        """Kinetic energy of the carriage [J]."""
        _, velocities = self.chain.moved_to(motion.t).hinges(motion.theta, motion.theta_dot)
        return float(0.5 * self.chain.carriage_mass * (velocities[0] ** 2).sum())

    def _rigid_kinetic(self, motion: Motion) -> float:
        """Kinetic energy of the chain and the other bodies [J]."""
        chain = motion.chain.moved_to(motion.t)
        return chain.kinetic_energy(motion.theta, motion.theta_dot) + self._others(motion.placements)

    def link_ends(self, name: str) -> tuple[int, int]:
        """Nodes of a link whose motion tells its angle: at its inbound hinge, and farthest from it."""
        link = next(link for link in self.chain.links if link.body == name)
        away = np.linalg.norm(self.meshes[name].points[:, :2] - np.asarray(link.hinge_in), axis=1)
        return int(away.argmin()), int(away.argmax())

    def _hand_back(self, motion: Motion, part: ImpactPart, rotations: Mapping[str, Array]) -> tuple[Motion, ImpactPart]:
        """The rigid motion after an impact, the shape that goes on, and what it leaves out."""
        impact = part.impact
        model = impact.ready[0].model
        u, v = impact.at_last_record()
        relaxation = Relaxation(model, device=self.settings.device, threads=self.settings.threads, dt=impact.solver.dt)
        kept = relaxation.settle(u, impact.state)
        names = [body.name for body in self.scene.bodies]
        ends = [*(model.node_start[name] for name in names[1:]), model.node_count]

        def by_body(field: Array) -> dict[str, Array]:
            return dict(zip(names, np.split(field, ends[:-1]), strict=True))

        points = {name: self.meshes[name].points for name in names}
        now, rest, velocities = by_body(model.X + u), by_body(model.X + kept.u), by_body(v)
        base = self.chain.links[0].body
        carriage = carriage_motion(self.chain, part.end, points[base], now[base], velocities[base])
        near = self.chain.angles(motion.theta)
        common = {"held": self.held, "t": part.end, "carriage": carriage}
        still = {name: np.zeros_like(x) for name, x in rest.items()}
        shapes = hand_back(self.chain, points, self.masses, rest, still, near=near, **common).displacements
        deformed = {name: points[name] + shapes[name] for name in names}
        chain = deformed_chain(self.chain, points, deformed)
        back = hand_back(chain, deformed, self.masses, now, velocities, near=near, **common)
        assert back.chain is not None
        swings = back.chain if self.rigid.inertia == "mesh" else _with_inertia_of(back.chain, self.chain)
        turned = take_history(relaxation.solver, kept.state, rotations)
        after = Motion(
            t=part.end,
            chain=swings,
            theta=back.theta,
            theta_dot=back.theta_dot,
            placements=back.placements,
            shapes=shapes,
            history=turned,
            elastic=kept.elastic,
            plastic=kept.plastic,
            hourglass=kept.hourglass,
        )
        energy = impact.accounts[0].ledger.energy()
        stored = sum(energy[key] for key in ("kinetic", "elastic", "plastic", "hourglass", "contact"))
        left = back.kinetic_energy + kept.elastic + kept.plastic + kept.hourglass
        return after, replace(
            part,
            back=back,
            lost=stored - left - back.drive_work,
            jump_back=self._rigid_kinetic(after) - back.kinetic_energy,
            hinge_impulse=self._hinge_impulses(back, deformed, velocities),
        )

    def _hinge_impulses(
        self, back: HandBack, points: Mapping[str, Array], velocities: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Impulse on each link through its inbound hinge as its motion becomes rigid [N s], by the link's body."""
        found, beyond = {}, np.zeros(2)
        for link in reversed(self.chain.links):
            _, rigid = back.placements[link.body].place(points[link.body])
            beyond = beyond + self.masses[link.body] @ (rigid - velocities[link.body])[:, :2]
            found[link.body] = beyond
        return dict(reversed(found.items()))


def _with_inertia_of(chain: Chain, other: Chain) -> Chain:
    """The chain with mass, centre and inertia of another one's links."""
    links = [
        replace(link, mass=own.mass, centre=own.centre, inertia=own.inertia)
        for link, own in zip(chain.links, other.links, strict=True)
    ]
    return replace(chain, links=tuple(links))


def _bending_period(scene: Scene, name: str, meshes: Mapping[str, Mesh], masses: Mapping[str, Array]) -> float:
    """Longest period of bending of a link, taken for a uniform rod with a hinge at one end [s].

    Length and radius of gyration of the cross-section follow from the second moments of its mass.
    """
    from warp_mca.model.assembly import body_materials

    points, mass = meshes[name].points, masses[name]
    arms = points - mass @ points / mass.sum()
    _, across, along = np.linalg.eigvalsh(np.einsum("n,ni,nj->ij", mass, arms, arms) / mass.sum())
    slowest = min(item.wave_speeds["bar"] for item, _ in body_materials(scene.body(name), meshes[name]))
    return BENDING * 12.0 * along / (slowest * math.sqrt(across))
