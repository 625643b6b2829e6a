"""Owns the run of one scene of an impact phase: its records as they arrive, and its result at the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.phases.history_rows import contact_histories, history_columns
from warp_mca.phases.rate_groups import rate_figures
from warp_mca.physics.elements.cells import body_materials
from warp_mca.results.contact_history import contact_names
from warp_mca.results.paths import path_histories
from warp_mca.results.result import Result, RunFacts, summarise
from warp_mca.results.sensor_history import sensor_figures, sensor_histories
from warp_mca.step.state_figures import (
    joint_impulses,
    max_normal_force,
    max_penetration,
    max_plastic_strain,
    max_speed,
    rigid_bodies,
)
from warp_mca.watch.energy import peak_losses, spring_shares
from warp_mca.watch.ledger import Ledger
from warp_mca.watch.looks import SceneLooks
from warp_mca.watch.mass_report import body_report, mass_report
from warp_mca.watch.row import Finished
from warp_mca.watch.table import told_at_the_end

if TYPE_CHECKING:
    from warp_mca.phases.prepare import Prepared
    from warp_mca.step.solver import Solver
    from warp_mca.step.state import State
    from warp_mca.step.steps import Steps
    from warp_mca.watch.passing import Watch

Array = NDArray[np.float64]


class SceneRun:
    """Takes in the records of one scene of an impact, and makes its result of them.

    Attributes:
        ledger: rows of its history, energy balance and guards.
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
        tolerance = ready.scene.impact.energy_tolerance
        framed = solver.floating.count > 0
        self.ledger = Ledger(ready.model, steps, tolerance, solver.precision, state.scenes[index], framed)
        self.looks = SceneLooks(solver, self.ledger, watch, index)

    def read(self, written: int, records: Mapping[str, NDArray]) -> None:
        """Take in the first `written` of the solver's records, and hold them to the guards.

        Raises:
            GuardError: a record breaks a guard; those before it count.
        """
        kept, first, rows = self.ledger.kept, self.ledger.kept.count, self.ledger.rows(written)
        try:
            self.ledger.read(written, self.solver.layout.records(records, self.index))
        finally:
            if len(self.ready.probes.corner):
                kept.path_stress.append(records["path_stress"][rows[: kept.count - first], self.probes])
            if self.ready.sensors.channels:
                kept.sensors.extend(records["sensors"][rows[: kept.count - first], self.channels])

    def history(self, first: int = 0) -> dict[str, NDArray[np.float64]]:
        """The columns of history.csv from row `first` on, each shape (row_count,), float64."""
        return history_columns(self.ledger, first)

    def result(
        self, wall: Mapping[str, float], said: Sequence[str] = (), stopped: str | None = None, origin: float = 0.0
    ) -> Result:
        """What came of it, in `wall` seconds by stage, with what recorders `said` and why a guard `stopped` it.

        Times count from `origin` [s] after the first row.
        """
        history = self.history()
        history["time_s"] = history["time_s"] - origin
        names = contact_names(self.ready.scene.contacts)
        contacts = contact_histories(self.ledger, names)
        shares = spring_shares(self.ledger, self.ready.model, names)
        facts = self._facts(wall, shares)
        paths = path_histories(self.ready.probes, self.ledger.kept.path_stress)
        probes, sections = sensor_histories(self.ready.scene, history["time_s"], self.ledger.kept.sensors)
        summary = summarise(history, facts, contacts) | sensor_figures(probes, sections, history)
        told = self._told(stopped is not None, history=history, contacts=contacts, shares=shares, origin=origin)
        own = {"contacts": contacts, "probes": probes, "sections": sections}
        return Result(summary, history, None, (*told, *said), paths, stopped, **own)

    def _facts(self, wall: Mapping[str, float], shares: Mapping[str, float | None]) -> RunFacts:
        scene, start, model, ledger = self.ready.scene, self.ready.start, self.ready.model, self.ledger
        count = self.steps.per_interval * max(ledger.kept.count - 1, 0)  # fewer than asked where it ended early
        more: dict[str, object] = {
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
        if scene.rigid_names:
            more["rigid_bodies"] = rigid_bodies(self.solver, self.state, self.index)
        if model.rates:
            more |= rate_figures(model.rates, self.steps.dt, count, wall)
        if self.solver.layout.count > 1:
            more["batch"] = {"scene": self.index, "scenes": self.solver.layout.count}
        more |= {"bodies": body_report(scene.bodies, self.ready.meshes), **mass_report(scene, model)}
        if ledger.absorbs:
            more["absorbed_impulse"] = self.solver.absorbing.impulses(self.state, self.index)
        if any(model.penalties):
            names = contact_names(scene.contacts)
            more["penalty"] = {name: vars(item) for name, item in zip(names, model.penalties, strict=True) if item}
        more |= {"contact_spring_share": dict(shares), "contact_spring_loss": peak_losses(shares)}
        if scene.ties:
            more["ties"] = [dict(fact) for fact in self.ready.model.ties.facts]
        if scene.stress_paths:
            body = scene.body(scene.stress_paths[0].lines[0].body)
            more["path_headings"] = {path.name: path.heading for path in scene.stress_paths}
            more["wave_speeds"] = body_materials(body, self.ready.meshes[body.name])[0][0].wave_speeds
        return RunFacts(
            scene=scene.name,
            n_elements=model.element_count,
            n_nodes=model.node_count,
            dt=self.steps.dt,
            n_steps=count,
            simulated_time=self.steps.dt * count,
            wall=wall,
            device=f"{self.solver.device} ({wp.get_device(self.solver.device).name})",
            precision=self.solver.precision,
            element=" ".join(sorted({block.element for block in model.blocks})) or "none",
            energy_error=ledger.kept.energy_error,
            energy=ledger.energy(),
            max_plastic_strain=max_plastic_strain(self.solver, self.state, self.index),
            parameters=scene.parameters,
            t_contact=start.t_contact if scene.rigid else None,
            v_n=start.v_n,
            v_t=start.v_t,
            theta=tuple(float(x) for x in start.angles(start.theta)),
            theta_dot=tuple(float(x) for x in start.angles(start.theta_dot)),
            more=more,
        )

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
        """Threads that compute, and whether they do so in floating frames."""
        framed: dict[str, object] = {"floating_frames": True} if self.ledger.framed else {}
        return {"threads": self.solver.threads, **framed}

    def _extremes(self) -> dict[str, float]:
        """Of single steps, whatever the output interval."""
        return {
            "F_n_max": max_normal_force(self.solver, self.state, self.index),
            "max_strain": self.ledger.kept.max_strain,
            "min_jacobian": self.ledger.kept.min_jacobian,
            "max_speed": max_speed(self.solver, self.state, self.index),
            "energy_error": self.ledger.kept.energy_error,
        }

    def _told(self, stopped: bool, **found: Any) -> tuple[str, ...]:
        """What the run says of itself; arguments are fields of `Finished`."""
        ready, nodes = self.ready, self.looks.nodes
        u, v = (np.asarray(field.numpy(), dtype=np.float64) for field in (self.state.u, self.state.v))
        finished = Finished(
            scene=ready.scene,
            meshes=ready.meshes,
            model=ready.model,
            start=ready.start,
            ledger=self.ledger,
            steps_taken=self.state.steps,
            u=u[nodes],
            v=v[nodes],
            depths=[stage.depths(self.state, self.index) for stage in self.solver.contacts],
            bent=self.ledger.kept.stiffened if stopped else self.looks.bent(u),
            watch=self.looks.watch,
            stopped=stopped,
            **found,
        )
        return told_at_the_end(finished, ready.warnings)
