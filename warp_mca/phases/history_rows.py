"""Owns the rows of a phase in the history of a run, from what its ledger keeps, and how those of all become one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.kernels.records.columns import (
    IMPULSE,
    NORMAL_ENERGY,
    NORMAL_FORCE,
    NORMAL_IMPULSE,
    PRESSURE,
    STICK_IMPULSE,
)
from warp_mca.results.contact_history import ContactHistory
from warp_mca.results.paths import path_histories
from warp_mca.results.sensor_history import sensor_histories
from warp_mca.scene.contacts import contact_names
from warp_mca.system.columns import added_columns

if TYPE_CHECKING:
    from warp_mca.model.paths import Probes
    from warp_mca.phases.prepare import Prepared
    from warp_mca.scene import Scene
    from warp_mca.watch.ledger import Ledger

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Rows:
    """What a phase adds to the histories of a run.

    Attributes:
        history: columns of history.csv, each shape (row_count,), float64.
        facts: what `summary.json` says of the phase.
        sensors: as `SceneRecords.sensors`.
        contacts: each of the scene's contacts; empty where none can act, as in a swing of rigid links.
        path_stress: as `SceneRecords.path_stress`; empty where it is not known.
    """

    history: Mapping[str, Array]
    facts: Mapping[str, Any]
    sensors: Sequence[Array]
    contacts: tuple[ContactHistory, ...] = ()
    path_stress: Sequence[NDArray[np.float32]] = ()


def joined(scene: Scene, probes: Probes | None, parts: Sequence[Rows]) -> dict[str, Any]:
    """The rows of all phases as the fields of a `Result`: history, contacts, paths, probes and sections.

    Args:
        scene: that was run.
        probes: of its paths; None where stress is not known in any phase.
        parts: rows of each phase in turn.
    """
    history = {name: np.concatenate([part.history[name] for part in parts]) for name in parts[0].history}
    counts = [len(part.history["time_s"]) for part in parts]
    known = [part.contacts or _open(scene, count) for part, count in zip(parts, counts, strict=True)]
    stress = []
    for part, count in zip(parts, counts, strict=True) if probes else ():
        shape = count, len(probes.corner) if probes else 0, 6
        stress += part.path_stress or [np.full(shape, np.nan, dtype=np.float32)]
    records = [row for part in parts for row in part.sensors]
    seen, cut = sensor_histories(scene, history["time_s"], records, counts)
    contacts = tuple(_one_contact(own) for own in zip(*known, strict=True))
    paths = path_histories(probes, stress) if probes else ()
    return {"history": history, "contacts": contacts, "paths": paths, "probes": seen, "sections": cut}


def _one_contact(parts: Sequence[ContactHistory]) -> ContactHistory:
    """A contact over all phases."""
    names = ("force", "pressure", "normal_force", "closing_speed")
    return replace(parts[0], **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _open(scene: Scene, count: int) -> tuple[ContactHistory, ...]:
    """Contacts in so many rows without force."""
    none, nothing, never = np.zeros((count, 3)), np.zeros(count), np.full(count, np.nan)
    return tuple(
        ContactHistory(name=name, force=none, pressure=nothing, normal_force=none, closing_speed=never)
        for name in contact_names(scene.contacts)
    )


def rows_of(
    ready: Prepared, ledger: Ledger, facts: Mapping[str, Any], *, before: float = 0.0, origin: float = 0.0
) -> Rows:
    """The rows of a ledger; times count from `origin` [s] after a moment that lies `before` [s] after the first row."""
    history = history_columns(ledger)
    history["time_s"] = history["time_s"] - before - origin
    contacts = contact_histories(ledger, contact_names(ready.scene.contacts))
    kept = ledger.kept
    return Rows(history=history, facts=facts, sensors=kept.sensors, contacts=contacts, path_stress=kept.path_stress)


def phase_facts(kind: str, start: float, end: float, ended_by: str, energy: Mapping[str, float]) -> dict[str, Any]:
    """What `summary.json` says of a phase: its ledger at the end."""
    return {"kind": kind, "start": start, "end": end, "ended_by": ended_by, "energy": dict(energy), "lost": 0.0}


def history_columns(ledger: Ledger, first: int = 0) -> dict[str, Array]:
    """The columns of history.csv from row `first` on, each shape (row_count,), float64.

    Forces are means over the interval before.
    """
    model, steps, kept = ledger.model, ledger.steps, ledger.kept
    table, energy = ledger.table(first), ledger.energies(first)
    counted = [k for k, item in enumerate(model.passes) if not item.internal]
    F_n, F_t, stick = _forces(ledger, ledger.springs(table), counted)
    velocity = np.array(kept.velocities[first:]).reshape(-1, len(model.points), 3)
    velocity[:, model.points < 0] = np.nan
    if model.points[1] < 0 and model.passes and model.passes[0].plane is not None:
        velocity[:, 1] = model.passes[0].plane.velocity
    stored = energy["elastic"] + energy["plastic"] + energy["hourglass"]
    balance = sum(value for key, value in energy.items() if key != "external_work") - energy["external_work"]
    columns = {
        "time_s": steps.interval * np.arange(first, kept.count, dtype=np.float64),
        "F_n_N": F_n,
        "F_t_N": F_t,
        "stick_fraction": stick,
        "tip_vx": velocity[:, 0, 0],
        "tip_vy": velocity[:, 0, 1],
        "plate_vx": velocity[:, 1, 0],
        "E_kinetic": energy["kinetic"],
        "E_internal": stored,
        "E_plastic": energy["plastic"],
        "E_contact": energy["contact"],
        "E_friction": energy["friction"],
        "E_total_error": balance - ledger.initial_energy,
        "tip_vz": velocity[:, 0, 2],
        "plate_vy": velocity[:, 1, 1],
        "plate_vz": velocity[:, 1, 2],
        "closing_speed": _closing_speed(ledger, first, counted),
    }
    for own in added_columns(model).values():
        begin = own.first + len(own.energies)
        columns |= {name: table[:, begin + k] for k, name in enumerate(own.readings)}
        earlier = ledger.table(max(first - 1, 0)) if own.means else table
        for k, name in enumerate(own.readings[: own.means]):
            change = np.diff(earlier[:, begin + k], prepend=earlier[:1, begin + k]) / steps.interval
            columns[name] = change[min(first, 1) :]
    added = {name for own in added_columns(model).values() for name in own.energies} - {"external_work"}
    return columns | {f"E_{name}": energy[name] for name in sorted(added)}


def _forces(ledger: Ledger, springs: Array, passes: Sequence[int]) -> tuple[Array, Array, Array]:
    """Normal and tangential force [N] and the share of the normal force that sticks [-], each shape (row_count,).

    `springs` are the columns of each row and contact pass, shape (row_count, pass_count, PASS_COLUMNS); `passes` count.
    """
    model, share = ledger.model, ledger.contact_dt / ledger.steps.interval
    F_n, F_t, stick = np.zeros(len(springs)), np.zeros(len(springs)), np.zeros(len(springs))
    for k, item in ((k, model.passes[k]) for k in passes):
        force = share * item.sign * springs[:, k, IMPULSE]
        normal, tangent = model.contact_axes[item.contact]
        F_n += force @ normal if normal.any() else share * springs[:, k, NORMAL_IMPULSE]  # see `Model.contact_axes`
        F_t += force @ tangent
    pressed, stuck = (springs[:, passes, column].sum(axis=1) for column in (NORMAL_IMPULSE, STICK_IMPULSE))
    np.divide(stuck, pressed, out=stick, where=pressed > 0.0)
    return F_n, F_t, stick


def contact_histories(ledger: Ledger, names: Sequence[str]) -> tuple[ContactHistory, ...]:
    """Each contact by itself, with these `names`."""
    passes, springs = ledger.model.passes, ledger.springs(ledger.table())
    share = ledger.contact_dt / ledger.steps.interval
    found: list[ContactHistory] = []
    for index, name in enumerate(names):
        own = [k for k, item in enumerate(passes) if item.contact == index]
        sign = np.array([passes[k].sign for k in own])
        found.append(
            ContactHistory(
                name=name,
                force=share * np.einsum("p,rpc->rc", sign, springs[:, own, IMPULSE]),
                pressure=share * springs[:, own, NORMAL_IMPULSE].sum(axis=1),
                normal_force=np.einsum("p,rpc->rc", sign, springs[:, own, NORMAL_FORCE]),
                closing_speed=_closing_speed(ledger, 0, own),
            )
        )
    return tuple(found)


def _closing_speed(ledger: Ledger, first: int, passes: Sequence[int]) -> Array:
    """As in `ContactHistory`, of some passes, from row `first` on.

    Normal forces do the work dE = sum(F_n v dt) on their springs. So the gain of these in an interval, over the normal
    impulse by the trapezoidal rule, is the mean of v over nodes and time that is weighted with F_n.
    """
    rows = ledger.table(max(first - 1, 0))
    springs = ledger.springs(rows)[:, passes].sum(axis=1)
    gain, rise = np.diff(springs[:, NORMAL_ENERGY]), np.diff(springs[:, PRESSURE])
    impulse = ledger.contact_dt * (springs[1:, NORMAL_IMPULSE] - 0.5 * rise)
    speed: Array = np.full(len(rows), np.nan)
    np.divide(gain, impulse, out=speed[1:], where=impulse > 0.0)
    return speed[min(first, 1) :]
