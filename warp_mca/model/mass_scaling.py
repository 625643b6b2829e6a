"""Owns selective mass scaling: elements whose stable step is too short for the wanted one gain mass, others none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.model.assembly import Assembly
from warp_mca.model.stable_step import at_elements, exact_or_bound, switching
from warp_mca.scene import Scene, Surface
from warp_mca.system.time_step import MassScaling, StableStep

# Relative error of the first force peak over the mass added where bodies strike, as a share of the lightest of them;
# measured, see docs/decisions.md.
PEAK_ERROR = 6.0
LIMIT = 0.1  # estimated error of the first force peak above which mass scaling is refused
CLOSE = 1e-3  # relative excess of an eigenvalue that is close enough: half of it in the step
LONGEST = 100.0  # times the stable step that may be asked for
ROUNDS = 200  # of adding mass at most


def scale_masses(parts: Assembly, contact: Array, plain: StableStep) -> tuple[StableStep, MassScaling | None]:
    """Stable step of an assembly, with what `contact` springs add at each node [1/s^2]; raises its masses if asked for.

    An element whose eigenvalue exceeds that of the wanted step w, omega_w^2 = (2 / dt_w)^2, has its lumped masses
    multiplied by their ratio. Contact springs count with the mass of the nodes: masses grow until
    lambda_e / s_e + contact_e <= omega_w^2 for all elements. The step is safe: added mass never lowers one, and
    lambda_e is exact or an upper bound. `plain` is the step without.

    Raises:
        RequestError: the scene has rigid bodies or ties, or the wanted step is out of reach.
    """
    asked = parts.scene.impact.mass_scaling
    if asked is None:
        return plain, None
    if parts.rigid.any():
        remedy = "rigid bodies must keep their mass; leave mass_scaling out, or Body.rigid"
        raise bad_value("ImpactPhase.mass_scaling", asked, remedy)
    if parts.scene.ties:
        remedy = "masters of ties carry the mass of their slaves; leave mass_scaling out, or the ties"
        raise bad_value("ImpactPhase.mass_scaling", asked, remedy)
    wanted = float(asked.rstrip("s")) if isinstance(asked, str) else asked * plain.dt
    if not wanted <= LONGEST * plain.dt:
        remedy = f"that is more than {LONGEST:g} times the stable step of {plain.dt:.3g} s; ask for less"
        raise bad_value("ImpactPhase.mass_scaling", asked, remedy)
    before = parts.mass.copy()
    slow = [_Slow(parts, k, contact, (2.0 / wanted) ** 2) for k in range(len(parts.cells))] if wanted > plain.dt else []
    stable = _stable(plain, slow, wanted, _add(parts, slow, contact, before)) if slow else plain
    count = sum(int((part.factor > 1.0).sum()) for part in slow)
    return stable, MassScaling(added=parts.mass - before, elements=count, plain_dt=plain.dt)


def check_masses(parts: Assembly, scaling: MassScaling | None) -> None:
    """Refuse so much mass that a body, or by estimate the first force peak, would change by more than LIMIT.

    Raises:
        RequestError: so it is.
    """
    if scaling is None:
        return
    shares = added_shares(parts.scene, parts.node_start, parts.mass, scaling.added)
    body, error = (
        striking_body(parts.scene, shares),
        peak_error(parts.scene, parts.node_start, parts.mass, scaling.added),
    )
    moved = f" and move the first force peak by about {error:.0%}" if error > LIMIT else ""
    if not moved:
        body = max(shares, key=lambda name: shares[name])
    if moved or shares[body] > LIMIT:
        remedy = f"ask for less, at most {LIMIT:.0%} of each, or make the smallest cells larger"
        what = f"it would add {shares[body]:.2g} times its mass to body {body}{moved}"
        raise bad_value("ImpactPhase.mass_scaling", parts.scene.impact.mass_scaling, f"{what}; {remedy}")


class _Slow:
    """Elements of one formulation that are too slow for a wanted step.

    Attributes:
        mine: their indices among `Assembly.cells[k]`, shape (count,).
        own: their eigenvalues without contact, or upper bounds [1/s^2], shape (count,), float64.
        factor: by which their masses are multiplied [-], shape (count,), float64.
        excess: of their eigenvalue with contact over the limit [-], shape (count,), float64.
    """

    def __init__(self, parts: Assembly, k: int, contact: Array, limit: float) -> None:
        cells, self.mass, self.limit = parts.cells[k], parts.element_mass[k], limit
        elements = parts.elements(cells.element, cells.conn, self.mass, contact, cells.index)
        self.mine, self.own = exact_or_bound(elements, limit)
        self.conn, self.index = cells.conn[self.mine], cells.index[self.mine]
        self.factor = np.ones(len(self.mine))
        self.contact = self.excess = np.zeros(len(self.mine))

    def measure(self, contact: Array) -> float:
        """The greatest excess, with what contact springs add at each node of the present masses [1/s^2]."""
        self.contact = at_elements(self.conn, contact)
        own = self.own / self.factor
        whole = own + self.contact
        self.excess = np.maximum(whole, switching(self.contact, self.contact / whole)) / self.limit
        return float(self.excess.max(initial=0.0))

    def added(self) -> Array:
        """Mass that each gains at its corners [kg], shape (count, corners)."""
        return (self.factor - 1.0)[:, None] * self.mass[self.mine]


def _add(parts: Assembly, slow: Sequence[_Slow], contact: Array, before: Array) -> float:
    """Raise the masses of the assembly until all steps are long enough; the greatest excess that is left [-]."""
    for _ in range(ROUNDS):
        if max(part.measure(contact * (before / parts.mass)) for part in slow) <= 1.0 + CLOSE:
            break
        parts.mass = before.copy()
        for part in slow:
            part.factor = part.factor * np.maximum(part.excess, 1.0)
            parts.mass += np.bincount(part.conn.ravel(), part.added().ravel(), minlength=len(before))
    for part in slow:
        part.mass[part.mine] += part.added()
    return max(part.measure(contact * (before / parts.mass)) for part in slow)


def _stable(plain: StableStep, slow: Sequence[_Slow], wanted: float, excess: float) -> StableStep:
    """The step reached, where some eigenvalues exceed those of the wanted one [s], and the element that sets it now."""
    dt = wanted / math.sqrt(max(excess, 1.0))
    if not any(len(part.mine) for part in slow):  # `plain` may be a bound that is lower than any element's step
        return replace(plain, dt=dt)
    part = max(slow, key=lambda part: part.excess.max(initial=0.0))
    worst = int(part.excess.argmax())
    return StableStep(
        dt=dt,
        element=int(part.index[worst]),
        contact_share=float(part.contact[worst] / (part.contact[worst] + part.own[worst] / part.factor[worst])),
        shortened=plain.shortened * plain.dt / dt,
    )


def added_shares(scene: Scene, node_start: Mapping[str, int], mass: Array, added: Array) -> dict[str, float]:
    """Mass that each body gained, as a share of its own [-]; `mass` [kg] has the `added` one in it."""
    first = [node_start[body.name] for body in scene.bodies]
    ends = [*first[1:], len(mass)]
    sums = {
        body.name: (added[begin:end].sum(), mass[begin:end].sum())
        for body, begin, end in zip(scene.bodies, first, ends, strict=True)
    }
    return {name: float(gain / (whole - gain)) for name, (gain, whole) in sums.items()}


def striking_body(scene: Scene, shares: Mapping[str, float]) -> str:
    """The link that strikes; without a rigid phase, of the bodies in contact, or of all, the one that gained most."""
    if scene.rigid is not None:
        return scene.rigid.tip.body
    sides = [side for pair in scene.surface_pairs() for side in pair]
    names = {side.body for side in sides if isinstance(side, Surface)} or set(shares)
    return max(sorted(names), key=lambda name: shares[name])


def peak_error(scene: Scene, node_start: Mapping[str, int], mass: Array, added: Array) -> float:
    """Estimated relative error of the first force peak [-]."""
    shares = added_shares(scene, node_start, mass, added)
    return PEAK_ERROR * shares[striking_body(scene, shares)]
