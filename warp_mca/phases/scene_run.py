"""Owns the run of one scene of an impact phase: its records as they arrive, and its result at the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.phases.history_rows import Rows, history_columns, joined, phase_facts, rows_of
from warp_mca.phases.rate_groups import rate_figures
from warp_mca.phases.stress_rows import StressRows
from warp_mca.physics.contact.bonds import bond_reports
from warp_mca.physics.elements.cells import body_materials
from warp_mca.results.joint_report import joint_reports
from warp_mca.results.result import Result, summarise
from warp_mca.results.sensor_history import sensor_figures
from warp_mca.scene.contacts import contact_names
from warp_mca.step.state_figures import (
    flexible_bodies,
    joint_impulses,
    max_normal_force,
    max_penetration,
    max_plastic_strain,
    max_speed,
    motion_at_the_end,
    rigid_bodies,
    rigid_extremes,
)
from warp_mca.system.reading import on_host
from warp_mca.watch.energy import spring_shares
from warp_mca.watch.failure_report import failure_report
from warp_mca.watch.ledger import Ledger
from warp_mca.watch.looks import SceneLooks
from warp_mca.watch.mass_report import body_report, mass_report
from warp_mca.watch.peaks import peak_report
from warp_mca.watch.row import Context, Finished, SpringShare
from warp_mca.watch.table import told_at_the_end

if TYPE_CHECKING:
    from warp_mca.phases.prepare import Prepared
    from warp_mca.step.solver import Solver
    from warp_mca.step.steps import Steps
    from warp_mca.system.state import State
    from warp_mca.watch.passing import Watch

Array = NDArray[np.float64]


class SceneRun:
    """Takes in the records of one scene of an impact, and makes its result of them.

    Attributes:
        ledger: rows of its history, energy balance and guards.
        stress: along its paths.
        looks: what is looked at of the shape of its bodies.
    """

    def __init__(
        self,
        ready: Prepared,
        steps: Steps,
        solver: Solver,
        state: State,
        watch: Watch,
        index: int = 0,
        first_probe: int = 0,
        first_channel: int = 0,
    ) -> None:
        """Go on from what the state has recorded.

        Args:
            ready: the scene.
            steps: of the run.
            solver: that runs it.
            state: that it advances.
            watch: of what may go into each other.
            index: number of the scene in the solver's layout.
            first_probe: number of the scene's first probe of paths among the solver's.
            first_channel: number of the first channel of its probes and sections among the solver's.
        """
        self.ready, self.steps, self.solver, self.state, self.index = ready, steps, solver, state, index
        self.probes = slice(first_probe, first_probe + len(ready.probes.corner))
        self.channels = slice(first_channel, first_channel + ready.sensors.channels)
        tolerance, framed = ready.scene.impact.energy_tolerance, solver.floating.count > 0
        self.ledger = Ledger(ready.model, steps, tolerance, solver.precision, state.scenes[index], framed)
        self.looks = SceneLooks(solver, self.ledger, watch, index, ready.home)
        self.stress = StressRows(self.ledger.kept, steps.checks, self.probes, ready.stress_room())

    def read(self, written: int, records: Mapping[str, NDArray]) -> None:
        """Take in the first `written` of the solver's records.

        Raises:
            GuardError: a record breaks a guard; those before it count.
        """
        kept, first, rows = self.ledger.kept, self.ledger.kept.count, self.ledger.rows(written)
        try:
            self.ledger.read(written, self.solver.layout.records(records, self.index))
        finally:
            good = rows[: kept.count - first]
            if len(self.ready.probes.corner):
                kept.path_stress = self.stress.first(kept.count)
            if self.ready.sensors.channels:
                kept.sensors.extend(records["sensors"][good, self.channels])

    def history(self, first: int = 0) -> dict[str, NDArray[np.float64]]:
        """The columns of history.csv from row `first` on, each shape (row_count,), float64."""
        return history_columns(self.ledger, first)

    def rows(self, start: float = 0.0, origin: float = 0.0) -> Rows:
        """Its rows, as those of an impact that began at `start` [s]; times count from `origin` [s] after the first."""
        end = start + self.steps.dt * self.step_count
        facts = phase_facts("impact", start, end, "duration", self.ledger.energy())
        return rows_of(self.ready, self.ledger, facts, origin=origin)

    def result(self, wall: Mapping[str, float], **more: Any) -> Result:
        """What came of it, with what it says of itself; arguments as in `outcome`."""
        found, finished = self.outcome(wall, **more)
        return replace(found, warnings=told_at_the_end(finished, self.ready.warnings))

    def outcome(
        self, wall: Mapping[str, float], stopped: str | None = None, *, before: Sequence[Rows] = (), origin: float = 0.0
    ) -> tuple[Result, Finished]:
        """What came of it, without warnings, and what these depend on.

        Figures of the summary are those of the impact, but for probes and sections after a swing.

        Args:
            wall: seconds by stage.
            stopped: why a guard stopped it.
            before: rows of the phases before it.
            origin: times count from then on [s], after the first row of the impact.
        """
        ready, own = self.ready, self.rows(before[-1].facts["end"] if before else 0.0, origin)
        shares = spring_shares(self._context, self.ledger, contact_names(ready.scene.contacts), self._depths)
        summary = summarise(own.history, self._facts(wall, shares), own.contacts)
        summary |= self._rigid_facts(own.history, stopped is not None)
        facts = {"history": own.history, "contacts": own.contacts, "shares": shares, "peaks": summary["bodies"]}
        finished = self._finished(stopped is not None, origin=origin, **facts)
        found = joined(ready.scene, ready.probes, [*before, own])
        last = slice(-len(own.history["time_s"]) if ready.scene.phases else 0, None)
        seen, cut = ([item.at(last) for item in found[name]] for name in ("probes", "sections"))
        summary |= sensor_figures(seen, cut, {name: column[last] for name, column in found["history"].items()})
        if before:
            summary["phases"] = [part.facts for part in (*before, own)]
        return Result(summary=summary, warnings=(), stopped=stopped, **found), finished

    @property
    def _context(self) -> Context:
        return Context(scene=self.ready.scene, meshes=self.ready.meshes, model=self.ready.model)

    @property
    def _depths(self) -> list[Array]:
        """Of each contact pass, largest penetration of each spring [m], shape (spring_count,), float64."""
        return [stage.depths(self.state, self.index) for stage in self.solver.contacts]

    @property
    def step_count(self) -> int:
        """Steps that its rows cover [-], fewer than asked where it ended early."""
        return self.steps.per_interval * max(self.ledger.kept.count - 1, 0)

    def _rigid_facts(self, history: Mapping[str, Array], stopped: bool) -> dict[str, Any]:
        """What a summary says of rigid bodies and of joints between whole bodies, at the last row of the history.

        A run that was `stopped` ended somewhere behind it.
        """
        model, scene, found = self.ready.model, self.ready.scene, {}
        if not scene.rigid_names:
            return found
        u, v = motion_at_the_end(self.solver, self.state, self.looks.nodes, stopped)
        found["rigid_bodies"] = rigid_bodies(model, u, v)
        if model.body_joints:
            found["joints"] = joint_reports(self.solver, self.index, history)
        found["flexible_bodies"] = flexible_bodies(model, u, v, [body.name for body in scene.bodies if not body.rigid])
        return found

    def _facts(self, wall: Mapping[str, float], shares: Mapping[str, SpringShare | None]) -> dict[str, Any]:
        scene, start, model, ledger = self.ready.scene, self.ready.start, self.ready.model, self.ledger
        count = self.step_count
        more: dict[str, Any] = {
            **self._hand_off(),
            "max_penetration": max_penetration(self.solver, self.state, self.index),
            "max_strain": ledger.kept.max_strain,
            "extremes": self._extremes(),
            "energy_error_exchanged": ledger.exchange_error,
            "stable_dt": model.stable.dt,
            "joint_impulse": joint_impulses(self.solver, self.state, self.index),
            **self._solver_facts(),
            "refine": scene.refine,
        }
        if model.rates:
            more |= rate_figures(model.rates, self.steps.dt, count, wall)
        if self.solver.layout.count > 1:
            more["batch"] = {"scene": self.index, "scenes": self.solver.layout.count}
        more |= {"bodies": self._bodies(), **mass_report(scene, model)}
        if ledger.absorbs:
            more["absorbed_impulse"] = self.solver.absorbing.impulses(self.state, self.index)
        if any(model.penalties):
            names = contact_names(scene.contacts)
            more["penalty"] = {name: vars(item) for name, item in zip(names, model.penalties, strict=True) if item}
        more["contact_spring_share"] = {name: item and item.share for name, item in shares.items()}
        more["contact_spring_loss"] = {name: item and -item.loss for name, item in shares.items()}
        if any(item.bonds for item in model.passes):
            names = contact_names(scene.contacts)
            found = bond_reports(self.solver.contacts, self.state, self.index, self.solver.model.X)
            more["bonds"] = {names[contact]: report for contact, report in found.items()}
        if scene.ties:
            more["ties"] = [dict(fact) for fact in self.ready.model.ties.facts]
        if paths := scene.stress_paths:
            body = scene.body(paths[0].lines[0].body)
            more["path_headings"] = {path.name: path.heading for path in paths}
            more["wave_speeds"] = body_materials(body, self.ready.meshes[body.name])[0][0].wave_speeds
        return dict(
            scene=scene.name,
            n_elements=model.element_count,
            n_nodes=model.node_count,
            dt=self.steps.dt,
            n_steps=count,
            simulated_time=self.steps.dt * count,
            wall=dict(wall),
            device=f"{self.solver.device} ({wp.get_device(self.solver.device).name})",
            precision=self.solver.precision,
            element=" ".join(sorted({block.element for block in model.blocks})) or "none",
            energy_error=ledger.kept.energy_error,
            energy=ledger.energy(),
            max_plastic_strain=max_plastic_strain(self.solver, self.state, self.index),
            parameters=dict(scene.parameters),
            t_contact=start.t_contact if scene.rigid else None,
            v_n=start.v_n,
            v_t=start.v_t,
            theta=start.angles(start.theta).tolist(),
            theta_dot=start.angles(start.theta_dot).tolist(),
            **more,
        )

    def _bodies(self) -> dict[str, dict[str, Any]]:
        """Mass of each body, and its greatest stress and plastic strain."""
        scene, meshes = self.ready.scene, self.ready.meshes
        masses = self.ready.masses or body_report(scene.bodies, meshes, scene.masses)
        peaks = peak_report(scene, meshes, self.solver, self.state, self.index, self.steps)
        return {name: {**masses[name], **peaks.get(name, {})} for name in masses}

    def _hand_off(self) -> dict[str, object]:
        """How well rigid links and their nodes agree at the start, and the way of a base that slides."""
        start = self.ready.start
        mismatch = {
            "momentum": start.momentum_mismatch,
            "angular_momentum": start.angular_momentum_mismatch,
            "kinetic_energy": start.energy_mismatch,
        }
        found: dict[str, object] = {"energy_drift_rigid": start.energy_drift, "handoff_mismatch": mismatch}
        if start.slides:
            found["carriage"] = {"way": float(start.theta[0]), "speed": float(start.theta_dot[0])}
        return found

    def _solver_facts(self) -> dict[str, object]:
        """Threads that compute, whether they do so in floating frames, and which elements failed."""
        found: dict[str, object] = {"threads": self.solver.threads}
        if self.ledger.framed:
            found["floating_frames"] = True
        if self.ready.model.fails:
            found["failure"] = failure_report(self.ready.scene, self.ready.meshes, self.solver, self.state, self.index)
        return found

    def _extremes(self) -> dict[str, float]:
        """Of single steps, whatever the output interval."""
        return {
            "F_n_max": max_normal_force(self.solver, self.state, self.index),
            "max_strain": self.ledger.kept.max_strain,
            "min_jacobian": self.ledger.kept.min_jacobian,
            "max_speed": max_speed(self.solver, self.state, self.index),
            "energy_error": self.ledger.kept.energy_error,
        }

    def _finished(self, stopped: bool, **found: Any) -> Finished:
        """What warnings depend on; arguments are fields of it."""
        ready, nodes = self.ready, self.looks.nodes
        u, v = (np.asarray(on_host(field), dtype=np.float64) for field in (self.state.u, self.state.v))
        model = ready.model
        if model.fails and len(self.solver.contacts) == len(model.passes):  # as surfaces are by then
            model = replace(model, passes=tuple(stage.items[0] for stage in self.solver.contacts))
        return Finished(
            scene=ready.scene,
            meshes=ready.meshes,
            model=model,
            start=ready.start,
            ledger=self.ledger,
            steps_taken=self.state.steps,
            u=u[nodes],
            v=v[nodes],
            depths=self._depths,
            bent=self.ledger.kept.stiffened if stopped else self.looks.bent(u),
            watch=self.looks.watch,
            stopped=stopped,
            rigid=rigid_extremes(self.solver, self.state, self.index),
            **found,
        )
