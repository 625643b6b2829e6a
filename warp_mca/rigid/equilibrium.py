"""Owns the shape that a body keeps: the static equilibrium of its internal forces with its plastic strain.

Newton's method on f(u) = 0 in the space of displacements that leave the rigid motions out. Each linear step K p = f is
solved by conjugate gradients without a matrix: K p = (f(u) - f(u + h p)) / h. The preconditioner is the inverse of K at
the start where a few nodes have few neighbours. Else it is the diagonal of K, estimated from products with random signs
(Bekas, Kokiopoulou and Saad, Applied Numerical Mathematics 57, 2007), the same for the three axes of a node. Each
iteration j releases the energy a_j r_j . z_j / 2, and the sum over the last d iterations is what was still free to
leave before them (Strakos and Tichy, ETNA 13, 2002): the measure of convergence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import GuardError
from warp_mca.rigid.body_motion import Motions
from warp_mca.rigid.chain import Array
from warp_mca.rigid.factors import Inverse
from warp_mca.rigid.stiffness import Stiffness

Forces = Callable[[Array], Array]

TOLERANCE = 1e-6  # share of the elastic energy that may still be free to leave
CONDITION = 1e6  # of the stiffness over its diagonal, in slender bodies: what may leave is that times f^2 / diagonal
PROBES = 12  # products with random signs for the diagonal
DIFFERENCE = 1e-8  # largest displacement of a difference quotient, over the body's radius of inertia
MIN_DELAY = 50  # iterations that tell what is still free to leave
FACTORED_DELAY = 4  # the same with the inverse of K, which takes few iterations
RESTS = 1e-2  # share of what may be left that the inverse of K says is left, which may be that before bodies yielded
MOST_TURNED = 12  # iterations with factors of an earlier shape, of which a body has only turned if that is so few
MAX_NEWTON = 20
MAX_ITERATIONS = 20_000  # of conjugate gradients, in each linear step
MAX_HALVINGS = 10


@dataclass(frozen=True, kw_only=True)
class Equilibrium:
    """The shape that a body keeps.

    Attributes:
        u: nodal displacements, with the rigid motion of the start [m], shape (node_count, 3), float64.
        released: elastic energy that left on the way, by the trapezoidal rule over the steps [J].
        remaining: elastic energy that is still free to leave, by the last linear step [J].
        evaluations: of the forces.
    """

    u: Array
    released: float
    remaining: float
    evaluations: int


def equilibrium(
    forces: Forces,
    u: Array,
    points: Array,
    masses: Array,
    *,
    elastic_energy: float,
    held: NDArray[np.bool_] | None = None,
    name: str = "body",
    energy: Callable[[Array], float] | None = None,
    stiffness: Stiffness | None = None,
    free: Array | None = None,
) -> Equilibrium:
    """Relax the displacements of one body until its internal forces balance.

    Rigid motions are left out by projection: the mean position and rotation of the nodes, weighted with mass, stay.

    Args:
        forces: internal nodal forces [N] of displacements [m], both shape (node_count, 3), float64, from the plastic
            history at the start, which it must not change. Elements may yield on the way: from that history in one
            step, so the history of the shape found is that of its displacements, evaluated once.
        u: displacements at the start [m], shape (node_count, 3), float64.
        points: node positions without displacement [m], shape (node_count, 3), float64.
        masses: lumped nodal masses [kg], shape (node_count,), float64.
        elastic_energy: against which the remaining energy is small [J]: that of the body at the start, or of the scene.
        held: axes of nodes that keep their displacement and may take forces, shape (node_count, 3), bool.
        name: of the body, for messages.
        energy: strain energy of displacements, plastic work included [J], from the same history. Where elements yield
            and unload, a step may make it smaller, though not the forces; such a step is taken too.
        stiffness: for the inverse of K, which is kept there; without it its diagonal is taken.
        free: fields of the motions without strain, shape (node_count, 3, motion_count), float64; those of a rigid body
            if None.

    Raises:
        GuardError: forces are not finite, or the search does not converge.
    """
    search = _Search(forces, u, points, masses, held, name, energy, stiffness, free)
    u, residual = u.copy(), search.residual(u)
    released, drop, delay = 0.0, np.inf, 0
    for _ in range(MAX_NEWTON):
        if not residual.any() or search.rests(u, residual, elastic_energy):
            return Equilibrium(u=u, released=released, remaining=0.0, evaluations=search.evaluations)
        step, drop, iterations = search.linear_step(u, residual, 0.1 * TOLERANCE * elastic_energy, delay)
        delay = max(delay, iterations // 2)
        enough, found = drop <= TOLERANCE * elastic_energy, search.apply(u, residual, step)
        if found is None and not enough:
            raise search.failure("no part of the last step makes its forces smaller")
        if found is not None:
            released += float((0.5 * (residual + found[1]) * (found[0] - u)).sum())
            u, residual = found
        if enough:  # a last step that helps no more is rounding
            return Equilibrium(u=u, released=released, remaining=drop, evaluations=search.evaluations)
    raise GuardError(
        f"the shape of {name} without vibration was not found: after {MAX_NEWTON} steps {drop:.3g} J of "
        f"{elastic_energy:.3g} J were still free to leave; its elements may be close to yielding or buckling at rest"
    )


class _Search:
    """The search for one body.

    Attributes:
        evaluations: of the forces so far.
    """

    def __init__(
        self,
        forces: Forces,
        u: Array,
        points: Array,
        masses: Array,
        held: NDArray[np.bool_] | None,
        name: str,
        energy: Callable[[Array], float] | None,
        stiffness: Stiffness | None,
        free: Array | None,
    ) -> None:
        self._forces, self._masses, self._name, self._energy = forces, masses[:, None], name, energy
        self._loose = np.ones(u.shape) if held is None else (~held).astype(np.float64)
        shape = points + u
        none = np.zeros(u.shape, dtype=bool)
        motions = Motions(shape, masses @ shape / masses.sum(), masses, none if held is None else held)
        self._span, self._rigid = DIFFERENCE * motions.radius, motions.free() if free is None else free
        self._gram = np.linalg.inv(np.einsum("nck,n,ncl->kl", self._rigid, masses, self._rigid, optimize=True))
        self.evaluations, self._diagonal = 0, None
        self._inverse: Inverse | None = None
        self._points = points
        self._kept = stiffness if stiffness and stiffness.small else None

    def residual(self, u: Array) -> Array:
        """Forces that deform [N]: without those on held axes, and without net force and moment on free motions.

        Raises:
            GuardError: they are not finite.
        """
        force = self._internal(u)
        net = self._gram @ np.einsum("nck,nc->k", self._rigid, force)
        return force - self._loose * self._masses * (self._rigid @ net)

    def _internal(self, u: Array) -> Array:
        """Forces [N], without those on held axes."""
        self.evaluations += 1
        return self._finite(self._loose * self._forces(u))

    def _finite(self, force: Array) -> Array:
        if not np.isfinite(force).all():
            raise GuardError(f"the internal forces of {self._name} became infinite while its shape at rest was sought")
        return force

    def rests(self, u: Array, residual: Array, elastic_energy: float) -> bool:
        """Whether forces are so small that next to no energy [J] is free to leave, in however slender a body."""
        if self._kept and self._inverse is None:
            self._factor(u, self._kept)
        if self._exact:  # a step more takes few evaluations
            free = 0.5 * float((residual * self._precondition(u, residual, residual)).sum())
            return free <= 0.1 * RESTS * TOLERANCE * elastic_energy
        return self._diagonal is not None and CONDITION * self._size(residual) <= TOLERANCE * elastic_energy

    def linear_step(self, u: Array, residual: Array, enough: float, delay: int) -> tuple[Array, float, int]:
        """Solve K p = f by conjugate gradients, until the last `delay` iterations released no more than `enough` [J].

        Returns:
            The step p [m], the energy that it releases [J] and the number of iterations.

        Raises:
            GuardError: the body has no stiffness against some displacement, or the iterations do not end.
        """
        step, r, start = np.zeros_like(u), residual, residual
        z, delay = self._precondition(u, start, r), max(delay, FACTORED_DELAY if self._exact else MIN_DELAY)
        p, rz, drops = z, float((r * z).sum()), []
        turned = self._inverse is not None and self._inverse.turned
        for _ in range(MOST_TURNED if turned else MAX_ITERATIONS):
            Kp = self._stiffness(u, start, p)
            curvature = float((p * Kp).sum())
            if curvature <= 0.0 or rz <= 0.0:
                break
            a = rz / curvature
            step, r = step + a * p, r - a * Kp
            drops.append(0.5 * a * rz)
            least = max(enough, 1e-4 * sum(drops))
            if len(drops) >= delay and sum(drops[-delay:]) <= least:
                return step, sum(drops), len(drops)
            z = self._precondition(u, start, r)
            before, rz = rz, float((r * z).sum())
            if self._exact and 0.5 * rz <= RESTS * least:
                return step, sum(drops), len(drops)
            p = z + (rz / before) * p
        if turned and self._kept:
            self._factor(u, self._kept, anew=True)
            return self.linear_step(u, residual, enough, delay)
        if drops and self._inverse:  # K differs with the direction where elements yield: a Newton step more finds it
            return step, sum(drops) if self._exact else np.inf, len(drops)
        if len(drops) < MAX_ITERATIONS:
            raise self.failure("it has no stiffness against some displacement")
        raise self.failure(f"a linear step takes more than {MAX_ITERATIONS} iterations")

    def apply(self, u: Array, residual: Array, step: Array) -> tuple[Array, Array] | None:
        """The displacements after the step, halved until it makes residual or energy smaller, and the residual then.

        None if no part of the step does.
        """
        before, stored = self._size(residual), self._energy(u) if self._energy else 0.0
        for _ in range(MAX_HALVINGS):
            after = self.residual(u + step)
            if self._size(after) < before or (self._energy and self._energy(u + step) < stored):
                return u + step, after
            step = 0.5 * step
        return None

    def _size(self, residual: Array) -> float:
        """The residual's square over the diagonal of K [J]."""
        assert self._diagonal is not None
        return float((residual**2 / self._diagonal).sum())

    def _stiffness(self, u: Array, start: Array, p: Array) -> Array:
        """K p [N]."""
        h = self._span / np.abs(p).max()
        return (start - self.residual(u + h * p)) / h

    def _precondition(self, u: Array, start: Array, r: Array) -> Array:
        """The inverse of K, or of its diagonal, times r, without rigid motions [m]."""
        if self._diagonal is None:
            self._diagonal = self._estimate_diagonal(u, start)
        z = self._inverse(r) if self._inverse else r / self._diagonal
        rigid = self._gram @ np.einsum("nck,nc->k", self._rigid, self._masses * z)
        return z - self._loose * (self._rigid @ rigid)

    @property
    def _exact(self) -> bool:
        return self._inverse is not None and self._inverse.exact

    def _factor(self, u: Array, stiffness: Stiffness, anew: bool = False) -> None:
        """Find the inverse of K at u, and the diagonal of K; `anew`: by factors of this u."""
        first, second = stiffness.pairs
        loose = self._loose.copy()
        loose[second] = loose[first]

        def forces(u: Array) -> Array:
            self.evaluations += 1
            return self._finite(loose * stiffness.forces(u))

        start = forces(u)

        def product(p: Array) -> Array:
            return (start - forces(u + self._span * loose * p)) / self._span

        self._inverse = stiffness.inverse(product, self._points + u, anew)
        if self._inverse is None:
            self._kept = None
            return
        nodal = self._inverse.trace / np.maximum(self._loose.sum(axis=1), 1.0)
        typical = float(np.median(nodal[self._loose.any(axis=1)]))
        self._diagonal = np.maximum(nodal, 1e-2 * typical)[:, None]

    def _estimate_diagonal(self, u: Array, start: Array) -> Array:
        """Diagonal of K, mean of a node's axes [N/m], shape (node_count, 1), float64.

        Raises:
            GuardError: most of it is 0.
        """
        rng, total = np.random.default_rng(0), np.zeros(len(u))
        for _ in range(PROBES):
            signs = self._loose * rng.choice([-1.0, 1.0], u.shape)
            total += (signs * self._stiffness(u, start, signs)).sum(axis=1)
        axes = self._loose.sum(axis=1)
        diagonal = total / (PROBES * np.maximum(axes, 1.0))
        typical = float(np.median(np.abs(diagonal[axes > 0.0])))
        if typical == 0.0:
            raise self.failure("it has no stiffness")
        return np.maximum(diagonal, 1e-2 * typical)[:, None]

    def failure(self, reason: str) -> GuardError:
        """An error that says why the search failed."""
        return GuardError(f"the shape of {self._name} without vibration was not found: {reason}")
