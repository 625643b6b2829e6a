"""Owns the warning about bodies at rest on friction that creep, as nodes that bounce off lose their grip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.kernels.records.columns import FRICTION, IMPULSE, NORMAL_IMPULSE, SPRING_ENERGY

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.watch.ledger import Ledger

Array = NDArray[np.float64]

PARTS = 4  # of the second half of a run, in which a body at rest presses alike
CREEPING = 3  # of them, at least: a body that slides until it rests does not
ROWS = 5  # of a part, at least
STEADY = 0.3  # by which normal forces of the parts differ from their mean, at most
WITHIN = 0.95  # of mu F_n: friction below it in the mean does not slide
ONE_WAY = 0.8  # of the friction of rows that their vector sum keeps, at least
ELASTIC = 0.1  # of the energy of the springs: less friction work in a part is no creep
WAY = 30.0  # times the creep: a body that moved further than so rolls, with a creep of less than a hundredth, or slid


def creep_warnings(ledger: Ledger, model: Model, names: Sequence[str], u: Array) -> list[str]:
    """A sentence for each contact that rests on friction, within what that holds, and yet creeps.

    Args:
        ledger: of the run. model: of the scene alone. names: of its contacts.
        u: displacements at the end [m], shape (node_count, 3), float64.
    """
    found = []
    rows = ledger.table(ledger.kept.count // 2)
    if len(rows) <= PARTS * ROWS:
        return []
    for contact, name in enumerate(names):
        own = [k for k, item in enumerate(model.passes) if item.contact == contact]
        normal = model.contact_axes[contact, 0]
        mu = max((model.passes[k].mu for k in own), default=0.0)
        if mu == 0.0 or not normal.any():
            continue
        springs = ledger.springs(rows)[:, own]
        sign = np.array([model.passes[k].sign for k in own])
        speed, share = _creep(springs, sign, normal, mu, ledger.contact_dt)
        time = ledger.steps.interval * (ledger.kept.count - 1)
        if speed > 0.0 and _way(model, own[0], normal, u, time) < WAY * speed * time:
            found.append(
                f"{name} creeps at {speed:.2g} m/s, though friction there is {share:.0%} of what holds it: nodes whose "
                "springs open for a few steps lose their grip and slide when they close; a body that should rest moves "
                "so far, and friction takes that work; a lower penalty or a shorter time step lessens it"
            )
    return found


def _creep(springs: Array, sign: Array, normal: Array, mu: float, dt: float) -> tuple[float, float]:
    """Speed of creep [m/s], 0 where there is none, and friction over what it may be at most [-].

    In a body at rest friction takes what its mean force does: E = F_t v t. `springs`: columns of rows and passes.
    """
    ends = np.linspace(0, len(springs) - 1, PARTS + 1).astype(int)
    # a row holds the impulse of the interval before it, and the work up to its end
    pressed = _sums(springs[:, :, NORMAL_IMPULSE].sum(axis=1), ends)
    force = np.einsum("p,rpc->rc", sign, springs[:, :, IMPULSE])
    along = force - np.outer(force @ normal, normal)
    size, total = _sums(np.linalg.norm(along, axis=1), ends), np.linalg.norm(_sums(along, ends), axis=1)
    work = np.diff(springs[ends, :, FRICTION].sum(axis=1))
    held = float(springs[:, :, SPRING_ENERGY].sum(axis=1).mean())
    creeps = (size < WITHIN * mu * pressed) & (total > ONE_WAY * size) & (work > ELASTIC * held)
    mean = pressed / np.diff(ends)
    if creeps.sum() < CREEPING or mean.min() <= 0.0 or np.abs(mean / mean.mean() - 1.0).max() > STEADY:
        return 0.0, 0.0
    return float(work.sum() / (dt * total.sum())), float(total.sum() / (mu * pressed.sum()))


def _sums(values: Array, ends: NDArray[np.int_]) -> Array:
    """Of the rows after each end up to the next, shape (PARTS, ...)."""
    return np.add.reduceat(values[1:], ends[:-1], axis=0)


def _way(model: Model, k: int, normal: Array, u: Array, time: float) -> float:
    """How far the slave nodes of pass k moved along their master, in the mean [m]."""
    item = model.passes[k]
    other = u[item.master].mean(axis=0) if item.plane is None else time * np.asarray(item.plane.velocity, dtype=float)
    way = u[item.slave].mean(axis=0) - other
    return float(np.linalg.norm(way - (way @ normal) * normal))
