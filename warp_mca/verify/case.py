"""Owns what a verification case is: a problem with a known answer, measured on one mesh or on several."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.physics.elements import ELEMENTS

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh

USUAL = ("hex8i", "hex8", "hex8r", "tet4")  # elements that cases are run with where none is named
SHAPES = ("hex8i", "tet4")  # one of each shape, where cases see only masses and faces of cells, or plane waves
Level = Literal["quick", "full"]
T = TypeVar("T")
EPSILON = {"mixed": 2.0**-23, "float64": 2.0**-52}  # round-off by precision


@dataclass(frozen=True, kw_only=True)
class Setup:
    """How cases are run.

    Attributes:
        device, precision: as in `warp_mca.run`.
        element: formulation of every body.
        level: "quick" takes coarse meshes, for a few seconds a case on a CPU; "full" takes fine ones.
    """

    device: str = "cpu"
    precision: str = "mixed"
    element: str = USUAL[0]
    level: Level = "quick"

    def by_element(self, value: T, **others: T) -> T:
        """`value`, or the one that is named after this element."""
        return others.get(self.element, value)

    def choose(self, quick: tuple, full: tuple) -> tuple:
        """What belongs to the level: meshes from coarse to fine, most often."""
        return full if self.level == "full" else quick

    def scene(self, name: str, **parameters: Any) -> mca.Scene:
        """A built-in scene with this element."""
        return self.with_element(mca.make_scene(name, **parameters))

    def with_element(self, scene: mca.Scene) -> mca.Scene:
        """The scene with every body made of this element."""
        bodies = tuple(dataclasses.replace(body, element=self.element) for body in scene.bodies)
        return dataclasses.replace(scene, bodies=bodies)

    def run(self, scene: mca.Scene, meshes: dict[str, Mesh] | None = None, **more: object) -> mca.Result:
        """Run a scene on this device in this precision."""
        settings: dict = {"device": self.device, "precision": self.precision, **more}
        return mca.run(self.with_element(scene), meshes=meshes, **settings)


@dataclass(frozen=True)
class Row:
    """One quantity beside its known value.

    Attributes:
        quantity: in a few words, with its symbol.
        exact: the known value.
        measured: from the coarsest mesh to the finest.
        unit: of both.
        tolerance: largest error allowed on the finest mesh, as a share of `scale`.
        why: what the tolerance is made of.
        sizes: element sizes of the meshes, in any one unit; needed for an order.
        scale: what errors are shares of; |exact| by default, so needed where that is 0.
        least_order: observed order that is demanded between the two finest meshes, or None.
        open: what is known where the row is not met for reasons not yet found; it is shown as open then, and does not
            fail its case.
    """

    quantity: str
    exact: float
    measured: Sequence[float]
    unit: str
    tolerance: float
    why: str
    sizes: tuple[float, ...] = ()
    scale: float | None = None
    least_order: float | None = None
    open: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "measured", tuple(self.measured))

    @property
    def errors(self) -> tuple[float, ...]:
        """Relative errors, one for each mesh."""
        scale = abs(self.exact) if self.scale is None else self.scale
        return tuple(abs(value - self.exact) / scale for value in self.measured)

    @property
    def order(self) -> float | None:
        """Observed order of convergence between the two finest meshes; None without two."""
        if len(self.sizes) < 2 or len(self.measured) < 2 or min(self.errors[-2:]) == 0.0:
            return None
        return math.log(self.errors[-2] / self.errors[-1]) / math.log(self.sizes[-2] / self.sizes[-1])

    @property
    def verdict(self) -> str:
        """In a word."""
        return "met" if self.met else "OPEN" if self.open else "NOT MET"

    @property
    def met(self) -> bool:
        """Whether the finest mesh is within the tolerance, and the order is what it must be."""
        good = self.errors[-1] <= self.tolerance  # not-a-number is not
        return good and (self.least_order is None or (self.order is not None and self.order >= self.least_order))


Measure = Callable[[Setup], list[Row]]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A verification case.

    Attributes:
        name: unique, as the command line takes it.
        group: heading of the table that lists it.
        title: what is checked, in one line.
        reference: where the known answer comes from.
        measure: runs it.
        needs: a module that it compares with and that may be missing; the case is skipped then.
        elements: that it is run with where none is named; none where no finite elements take part, so that it is run
            once.
    """

    name: str
    group: str
    title: str
    reference: str
    measure: Measure
    needs: str | None = None
    elements: tuple[str, ...] = USUAL

    def taken(self, element: str | None = None) -> tuple[str, ...]:
        """Elements to run it with: that which is named, or all of its own; any one where none takes part."""
        return (element,) if element and self.elements else self.elements or USUAL[:1]


CASES: dict[str, Case] = {}


def every(*left_out: str) -> tuple[str, ...]:
    """Names of all elements but some, for `case`."""
    return tuple(name for name in ELEMENTS if name not in left_out)


def share_row(quantity: str, error: float, tolerance: float, why: str) -> Row:
    """A row of a quantity over its known value, from its relative error [-]."""
    return Row(quantity, 1.0, (1.0 + error,), "-", tolerance, why)


def crossings(time: NDArray[np.float64], value: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """Times at which a curve, taken as straight between its samples, crosses a level, either way."""
    side = np.sign(value - level)
    k = np.flatnonzero(side[:-1] * side[1:] < 0.0)
    share = (level - value[k]) / (value[k + 1] - value[k])
    return time[k] + share * (time[k + 1] - time[k])


def case(**facts: Any) -> Callable[[Measure], Measure]:
    """Register the function below as the case of its name; `facts` are the other fields of `Case`."""

    def register(measure: Measure) -> Measure:
        name: str = measure.__name__  # type: ignore[attr-defined]
        assert name not in CASES, name
        CASES[name] = Case(name=name, measure=measure, **facts)
        return measure

    return register
