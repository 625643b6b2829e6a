"""Owns what joins the pressure of elements: bulk viscosity, what it leaves of the stable step, thermal strains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.chunks import CHUNK, chunks
from warp_mca.base.errors import bad_value
from warp_mca.model.stable_step import with_dashpots
from warp_mca.scene.loads import ThermalStrain
from warp_mca.system.time_step import StableStep

if TYPE_CHECKING:
    from warp_mca.model.assembly import Assembly
    from warp_mca.physics.elements.cells import Cells
    from warp_mca.system.model import Model

LARGEST = 0.98  # share of the step that is stable for certain which a viscous model takes at most


def element_lengths(mean_gradients: Callable[[Array], Array], cells: Cells, X: Array, mass: Array) -> Array:
    """Length of each cell that bulk viscosity goes by [m], shape (cell_count,), float64.

    h^2 = 12 / (sum of m_a times sum of |b_a|^2 / m_a), with the gradient b_a of the mean dilatation: an element of bulk
    modulus K alone has the frequency omega = 2 sqrt(3 K / rho) / h. A brick with edges a, b, c has the length
    h^2 = 3 / (1/a^2 + 1/b^2 + 1/c^2), a cube its edge.

    Args:
        mean_gradients: as in `Element`.
        cells: of one formulation.
        X: positions of nodes [m], shape (node_count, 3), float64.
        mass: lumped masses [kg], shape (cell_count, corners), float64.
    """
    found = np.empty(len(mass))
    for part in chunks(len(found), CHUNK):
        b = mean_gradients(X[cells.conn[part]])
        found[part] = ((b**2).sum(axis=2) / mass[part]).sum(axis=1) * mass[part].sum(axis=1)
    return np.sqrt(12.0 / found)


def viscosities(parts: Assembly, k: int) -> Array | None:
    """`Block.viscosity` of all cells of the k-th formulation of an assembly, or None without.

    Raises:
        RequestError: elements of deformable bodies have no bulk viscosity.
    """
    cells, (linear, quadratic) = parts.cells[k], parts.scene.impact.viscosity
    if not (linear or quadratic) or parts.rigid[cells.index].all():
        return None
    mean_gradients = getattr(cells.element, "mean_gradients", None)
    if mean_gradients is None:
        remedy = f"{cells.element.name} has no bulk viscosity; leave it out, or choose another element"
        raise bad_value("ImpactPhase.bulk_viscosity", parts.scene.impact.bulk_viscosity, remedy)
    mass = parts.element_mass[k] if parts.relief is None else parts.element_mass[k] / parts.relief[cells.conn]
    h, rho = element_lengths(mean_gradients, cells, parts.X, mass), parts.rho[cells.index]
    c = np.sqrt((parts.K[cells.index] + 4.0 / 3.0 * parts.G[cells.index]) / rho)
    return np.stack([linear * rho * c * h, quadratic**2 * rho * h**2])


def thermal_strains(parts: Assembly) -> Array | None:
    """`Block.thermal` of all elements of an assembly, in the order of the meshes, or None without.

    Raises:
        RequestError: elements of a heated body take no thermal strain.
    """
    loads = [load for load in parts.scene.loads if isinstance(load, ThermalStrain)]
    if not loads:
        return None
    found = np.stack([np.full(parts.element_count, -1.0), parts.volume])
    for k, load in enumerate(loads):
        first = parts.element_start[load.body]
        found[0, first : first + parts.meshes[load.body].cell_count] = k
    for cells in parts.cells:
        if not hasattr(cells.element, "mean_gradients") and (found[0, cells.index] >= 0.0).any():
            remedy = f"its elements {cells.element.name} take no thermal strain; choose another element"
            body = loads[int(found[0, cells.index].max())].body
            raise bad_value("ThermalStrain.body", body, remedy)
    return found


def thermal_energy(model: Model) -> float:
    """Energy that it takes to press all thermal strains of a model back at their greatest [J]; 0 without any."""
    total = 0.0
    loads: Any = model.loads.get(ThermalStrain.__name__, ())
    greatest = np.array([abs(load.strain) * np.abs(load.values).max() for load in loads])
    for block in model.blocks:
        if block.thermal is not None:
            load, volume = block.thermal[0].astype(int), block.thermal[1]
            strain = np.where(load >= 0, greatest[load], 0.0)
            total += float((4.5 * model.law[block.material, 0] * volume * strain**2).sum())
    return total


def share_of_step(parts: Assembly, velocity: Array) -> float:
    """What bulk viscosity leaves of the stable step of any element [-]; arguments as `with_viscosity`."""
    whole = StableStep(dt=1.0, element=0, contact_share=0.0, shortened=1.0)
    return with_viscosity(whole, parts, velocity, 0.0).dt


def with_viscosity(stable: StableStep, parts: Assembly, velocity: Array, decay: float) -> StableStep:
    """The stable step of a scene with bulk viscosity and with contact dashpots of a rate of `decay` [1/s].

    q is a dashpot of the mean dilatation that reads the rate of half a step before, see `with_dashpots`. Its rate of
    decay is 2 x omega_v at most, with omega_v of the bulk modulus alone, x = c1 sqrt(3 M / K) and M = K + 4 G / 3: in a
    cell, omega_v = 2 sqrt(3 K / rho) / h, and q over K theta is c1 rho c h theta_dot / (K theta). omega_v is no more
    than the frequency of the cell, so that a step h with omega^2 h^2 + 4 x omega h <= 4 is stable. Waves along one
    direction of equal cells have x = c1; as other programs do, `time_step_scale` s counts from there, but s times the
    result never exceeds LARGEST of what is stable for certain. Speeds count as c2^2 dv / c in c1, with dv the greatest
    difference of initial velocities and of them to what is at rest.

    Args:
        stable: without [s]. parts: of the scene, with viscous elements. decay: of contact dashpots.
        velocity: initial velocities [m/s], shape (node_count, 3), float64.
    """
    linear, quadratic = parts.scene.impact.viscosity
    index = np.flatnonzero(~parts.rigid)
    if not (linear or quadratic) or not len(index):
        return with_dashpots(stable, decay)
    with np.errstate(over="ignore", invalid="ignore"):
        K, M = parts.K[index], parts.K[index] + 4.0 / 3.0 * parts.G[index]
        span = np.append(velocity, np.zeros((1, 3)), axis=0)
        dv = float(np.linalg.norm(np.ptp(span, axis=0)))
        c1 = linear + quadratic**2 * dv / np.sqrt(M / parts.rho[index])
        ratios = float(c1.max()), float((c1 * np.sqrt(3.0 * M / K)).max())
    omega = 2.0 / stable.dt
    usual, certain = (with_dashpots(stable, decay + 2.0 * x * omega).dt for x in ratios)
    return replace(stable, dt=min(usual, LARGEST / parts.scene.impact.time_step_scale * certain))
