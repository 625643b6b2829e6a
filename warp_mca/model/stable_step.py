"""Owns the stable time step: the largest eigenvalue of any element, contact springs included."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.chunks import CHUNK, chunks
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.base.kept import Kept
from warp_mca.physics.elements import Element
from warp_mca.system.time_step import StableStep

BATCH = 96  # elements whose exact eigenvalues are found at a time
MAX_EXACT = 266 * BATCH  # elements with exact eigenvalues: each 24 x 24 problem takes 50 us
# Largest (omega dt)^2 of a contact spring on its node, at USUAL_SCALE of the stable step: BOUNCE where the spring alone
# holds the node, up to SUPPORT more where the element does; see docs/measurements/methods.md.
BOUNCE, SUPPORT, USUAL_SCALE = 1.0, 1.0, 0.9
KEY = np.random.default_rng(0).integers(1, 2**62, 82) | 1  # weights that make one number of an element's shape


MOST_KEPT = 200_000  # elements whose arrays are compared with those of earlier runs
_KEPT: Kept[tuple[Element, StableStep]] = Kept(64)  # found last

Part = NDArray[np.intp]  # indices of some elements


@dataclass(frozen=True)
class Elements:
    """Elements of one formulation, and what their stable steps depend on.

    Attributes:
        element: their formulation.
        X: positions of the nodes [m], shape (node_count, 3), float64.
        conn: nodes of each element, shape (element_count, corners), int32.
        K, G: moduli [Pa], shape (element_count,), float64.
        mass: lumped masses [kg], shape (element_count, corners), float64.
        contact: eigenvalue that contact springs add at each element [1/s^2], shape (element_count,), float64.
        index: number that each element goes by, shape (element_count,), int32.
    """

    element: Element
    X: Array
    conn: Index
    K: Array
    G: Array
    mass: Array
    contact: Array
    index: Index

    @property
    def digest(self) -> bytes:
        """Of all arrays, equal for equal ones."""
        found = hashlib.sha256()
        for values in (self.X, self.conn, self.K, self.G, self.mass, self.contact, self.index):
            found.update(f"{values.dtype}{values.shape}".encode())
            found.update(values.tobytes())
        return found.digest()

    def exact(self, some: Part) -> Array:
        """Largest eigenvalues of some elements by themselves [1/s^2]."""
        return self.element.largest_eigenvalues(*self._of(some))

    def bounds(self, coarse: bool, some: Part | None = None) -> Array:
        """Upper bounds of them, of all elements or of some [1/s^2]."""
        some = np.arange(len(self.conn)) if some is None else some
        own = np.empty(len(some))
        for part in chunks(len(some), CHUNK):
            own[part] = self.element.eigenvalue_bounds(*self._of(some[part]), coarse)
        return own

    def _of(self, some: Part) -> tuple[Array, Array, Array, Array]:
        return self.X[self.conn[some]], self.K[some], self.G[some], self.mass[some]


def stable_step(elements: Elements) -> StableStep:
    """Stable step of elements, that of the same arrays taken from an earlier run of this process.

    Raises:
        RequestError: as in `_stable_step`.
    """
    if len(elements.conn) > MOST_KEPT:
        return _stable_step(elements)
    key = id(elements.element), elements.digest
    element, found = _KEPT.get(key) or (None, None)
    if found is None or element is not elements.element:
        found = _stable_step(elements)
        _KEPT.put(key, (elements.element, found))
    return found


@np.errstate(divide="ignore", over="ignore", invalid="ignore")  # bounds that are not numbers are refused
def _stable_step(elements: Elements) -> StableStep:
    """Stable step from max over elements of (element eigenvalue + contact eigenvalue), both upper bounds of their part.

    Springs that dominate count for more, since they open and close.

    The largest eigenvalue of an assembly never exceeds the largest of its elements (Irons and Treharne, 1971). A
    coarse bound ranks the elements, a closer one those that could still be the worst after the first exact
    eigenvalues, and exact ones decide.

    Raises:
        RequestError: a bound is not finite.
    """
    contact, index = elements.contact, elements.index

    def exact(part: Part) -> Array:
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # values that are not numbers are refused
                return elements.exact(part) + contact[part]
        except np.linalg.LinAlgError as error:
            raise _out_of_range(int(index[part[0]]), float(bound.max())) from error

    bound = elements.bounds(True) + contact
    if not np.isfinite(bound).all():
        raise _out_of_range(int(index[np.argmin(np.isfinite(bound))]), float(bound.max()))
    usual = float(np.median(bound))
    worst, element = _worst(elements, bound, exact)
    own = worst - float(contact[element])
    stiff = np.flatnonzero(switching(contact, 1.0) > worst)
    if len(stiff):
        bound = elements.bounds(False, stiff)
        value = switching(contact[stiff], contact[stiff] / (bound + contact[stiff]))
        most = int(value.argmax())
        if value[most] > worst:
            worst, element, own = float(value[most]), int(stiff[most]), float(bound[most])
    return StableStep(
        dt=2.0 / math.sqrt(worst),
        element=int(index[element]),
        contact_share=1.0 - own / worst,
        shortened=math.sqrt(own / usual),
    )


def with_dashpots(stable: StableStep, decay: float) -> StableStep:
    """The stable step where dashpots add up to `decay` to M^-1 C [1/s]. They read the velocity of half a step before.

    With z^2 - (2 - a h - w^2 h^2) z + 1 - a h = 0 for the factor z from step to step h of an oscillator of frequency w
    and rate of decay a, |z| <= 1 asks for w^2 h^2 + 2 a h <= 4: h <= (sqrt(a^2 + 4 w^2) - a) / w^2.
    """
    if not decay:
        return stable
    square = (2.0 / stable.dt) ** 2
    return replace(stable, dt=(math.sqrt(decay**2 + 4.0 * square) - decay) / square)


def at_elements(conn: Index, value: Array) -> Array:
    """Greatest of the values >= 0 at the nodes of each element, shape (element_count,)."""
    touched = np.flatnonzero((value != 0.0)[conn].any(axis=1))
    found = np.zeros(len(conn))
    found[touched] = value[conn[touched]].max(axis=1)
    return found


def element_steps(elements: Elements, *, coarse: bool = False) -> Array:
    """Stable step that each element would ask for by itself, contact springs included [s], shape (element_count,).

    A lower bound from upper bounds of the eigenvalues: that of a hexahedron's own stiffness is 12 to 18 % below its
    step, `coarse` ones are 7 % lower and three times as quick.
    """
    return step_of(elements.bounds(coarse), elements.contact)


def step_of(own: Array, contact: Array) -> Array:
    """Stable step [s] by an element's own eigenvalue and that of its contact springs [1/s^2].

    The greater of both together, and of what stands for a spring that opens and closes.
    """
    return 2.0 / np.sqrt(np.maximum(own + contact, switching(contact, contact / (own + contact))))


def exact_or_bound(elements: Elements, limit: float) -> tuple[Part, Array]:
    """Elements whose eigenvalue, with what contact adds, may exceed a limit [1/s^2], and their own eigenvalues.

    Eigenvalues [1/s^2] are exact for the MAX_EXACT greatest bounds, bounds for others.
    """
    contact = elements.contact

    def whole(own: Array, touched: Array) -> Array:
        return np.maximum(own + touched, switching(touched, touched / (own + touched)))

    mine = np.arange(len(contact))
    own = np.zeros(0)
    for coarse in (True, False):
        own = elements.bounds(coarse, mine)
        over = whole(own, contact[mine]) > limit
        mine, own = mine[over], own[over]
    greatest = _greatest(own, MAX_EXACT)
    for part in chunks(len(greatest), BATCH):
        own[greatest[part]] = elements.exact(mine[greatest[part]])
    over = whole(own, contact[mine]) > limit
    return mine[over], own[over]


def _worst(elements: Elements, bound: Array, exact: Callable[[Part], Array]) -> tuple[float, int]:
    """Largest eigenvalue of any element with its contact springs [1/s^2], and that element.

    Args:
        bound: coarse upper bound of each [1/s^2], shape (element_count,), float64; closer ones replace them.
        exact: exact eigenvalues of some elements.
    """
    first = _greatest(bound, BATCH)
    value = exact(first)
    worst, element = float(value.max()), int(first[value.argmax()])
    bound[first] = 0.0
    left = np.flatnonzero(bound > worst)
    if len(left) > MAX_EXACT:
        left = left[_different(elements.X, elements.conn[left], bound[left])]
    bound[left] = elements.bounds(False, left) + elements.contact[left]
    left = left[bound[left] > worst]
    left = left[np.argsort(-bound[left], kind="stable")]
    for start in range(0, len(left), BATCH):
        part = left[start : start + BATCH]
        if bound[part[0]] <= worst:
            break
        if start >= MAX_EXACT:  # the bound of the remaining elements is close enough
            worst, element = float(bound[part[0]]), int(part[0])
            break
        value = exact(part)
        if value.max() > worst:
            worst, element = float(value.max()), int(part[value.argmax()])
    return worst, element


def _out_of_range(element: int, bound: float) -> RequestError:
    remedy = "moduli and penalty over density exceed the range of numbers there; check their units"
    return bad_value(f"largest eigenvalue of element {element} [1/s^2]", bound, remedy)


def switching(contact: Array, share: Array | float) -> Array:
    """Eigenvalue [1/s^2] that stands for a contact spring which opens and closes.

    Central differences keep a linear spring bounded up to (omega dt)^2 = 4. A node that bounces on a spring of one side
    gains energy from less on, because it is pushed back for whole steps only.

    Args:
        contact: of the spring on its node [1/s^2].
        share: of the spring in the eigenvalue of node and element [-].
    """
    return (2.0 * USUAL_SCALE) ** 2 / (BOUNCE + SUPPORT * (1.0 - share)) * contact


def _greatest(value: Array, count: int) -> NDArray[np.intp]:
    """Indices of the `count` greatest values, from the greatest on."""
    least = np.partition(value, len(value) - count)[len(value) - count] if count < len(value) else -np.inf
    found = np.flatnonzero(value >= least)
    return found[np.argsort(-value[found], kind="stable")][:count]


def _different(X: Array, conn: Index, bound: Array) -> NDArray[np.intp]:
    """First of each lot of elements whose shapes and bounds agree to a millionth of the greatest, in order."""
    size = max(float(np.abs(X[conn[:, k]] - X[conn[:, 0]]).max()) for k in range(1, conn.shape[1]))

    def digits(part: NDArray[np.intp] | slice) -> NDArray[np.int64]:
        shape = (X[conn[part]] - X[conn[part, :1]]).reshape(-1, 3 * conn.shape[1]) / size
        return np.rint(1e6 * np.column_stack([bound[part] / bound.max(), shape])).astype(np.int64)

    key = np.empty(len(conn), dtype=np.int64)
    for part in chunks(len(conn), CHUNK):
        key[part] = (digits(part) * KEY[: 1 + 3 * conn.shape[1]]).sum(axis=1)
    _, first, lot = np.unique(key, return_index=True, return_inverse=True)
    kept = np.zeros(len(conn), dtype=bool)
    kept[first] = True
    for part in chunks(len(conn), CHUNK):  # groups that agree in the key alone are separated
        kept[part] |= (digits(part) != digits(first[lot[part]])).any(axis=1)
    return np.flatnonzero(kept)
