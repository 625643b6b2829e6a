"""Owns the device side of elements that may fail: their own copy of the nodes, and the kernels that judge them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.base.errors import bad_value
from warp_mca.kernels.elements.failure import follow_nodes, lose_kernel, silence_kernel
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.system.precision import limited
from warp_mca.system.threads import ELEMENTS, Split, whole

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.system.block import Block
    from warp_mca.system.state import State
    from warp_mca.system.workspace import Workspace


@dataclass(eq=False)
class FailureState:
    """State of elements that may fail.

    Attributes:
        age: steps that each element has taken, or -1 less these once it has failed [-], shape (element_count,), int32.
        work: half of what the force of a failed element would have done in the step before it failed [J], shape
            (element_count,), float32 or float64.
        damage: of each point, 1 at failure [-], shape (point_count, element_count), float64.
        plastic: equivalent plastic strain of each point in the latest step [-], shape (point_count, element_count),
            float32 or float64.
        left: 1 where contact has left the element's faces out [-], shape (element_count,), int32.
        count: elements that have failed [-], shape (1,), int32.
        u: displacement of each corner of each element, in failed ones that at failure [m], corner by corner, shape
            (corner_count element_count,), vec3d.
    """

    age: wp.array
    work: wp.array
    damage: wp.array
    plastic: wp.array
    left: wp.array
    count: wp.array
    u: wp.array


class Failing:
    """What a stage of elements has where these may fail.

    Attributes:
        X: reference positions of the corners of each element [m], corner by corner, shape (corner_count
            element_count,), vec3d.
        conn: places of these in X, shape (corner_count, element_count), int32.
        parameter: of the criterion, as `system.failing.Failing` has it.
    """

    def __init__(self, stage: ElementStage, precision: str, kernels: Any) -> None:
        """Allocate on the current device.

        Raises:
            RequestError: elements of this formulation do not fail.
        """
        block = stage.block
        assert block.failing is not None
        if not hasattr(kernels, "failure_kernel") or block.element == "tet4":
            remedy = "elements of it cannot fail; choose another element, as hex8i or tet10, or leave failure out"
            raise bad_value("Body.element", block.element, remedy)
        self.stage, real = stage, scalars(precision).real
        corners, count = block.conn.shape
        self.node = stage.conn
        self.conn = wp.array(np.arange(corners * count, dtype=np.int32).reshape(corners, count), dtype=wp.int32)
        self.X: Any = None
        self.parameter = wp.array(limited(block.failing.parameter, precision), dtype=real)
        self.kernel = kernels.failure_kernel(block.failing.law, precision, block.law, block.finite)
        self.lose_kernel = lose_kernel(precision)
        self.points, self.real = self._point_count(kernels, precision), real

    def _point_count(self, kernels: Any, precision: str) -> int:
        maker = kernels.failure_kernel.args[0]
        return maker(precision, self.stage.block.law, self.stage.block.finite).points

    def place(self, X: np.ndarray) -> None:
        """Take over the reference positions of the model's nodes [m]."""
        self.X = wp.array(X[self.stage.block.conn.ravel()], dtype=wp.vec3d)

    def kernels(self) -> list[Any]:
        """Those of a step and of a record."""
        return [follow_nodes, self.kernel, self.lose_kernel]

    def new_state(self) -> FailureState:
        """Of whole elements, on the current device."""
        corners, count = self.stage.block.conn.shape
        return FailureState(
            age=wp.zeros(count, dtype=wp.int32),
            work=wp.zeros(count, dtype=self.real),
            damage=wp.zeros((self.points, count), dtype=wp.float64),
            plastic=wp.zeros((self.points, count), dtype=self.real),
            left=wp.zeros(count, dtype=wp.int32),
            count=wp.zeros(1, dtype=wp.int32),
            u=wp.zeros(corners * count, dtype=wp.vec3d),
        )

    def follow(self, work: Workspace, state: State, split: Split = whole) -> None:
        """Let whole elements see where their nodes are."""
        own, stage = state.elements[self.stage.index].failing, self.stage
        u = work.displacements(state)

        def launch(part: slice) -> None:
            inputs = [u, self.node, own.age, stage.count, part.start]
            wp.launch(follow_nodes, part.stop - part.start, inputs, [own.u])

        split(stage.count, launch, ELEMENTS)

    def judge(self, work: Workspace, state: State, split: Split = whole) -> None:
        """After the forces: damage, and no force of elements that have failed."""
        own, stage = state.elements[self.stage.index], self.stage

        def launch(part: slice) -> None:
            failing = own.failing
            yielded = own.yielded[part] if stage.block.plastic else own.yielded
            history = own.history[:, part] if stage.kept else own.history
            inputs = [self.X, self.conn[:, part], stage.material[part], work.law, yielded, history, failing.u]
            inputs += [*stage.nodal(part), self.parameter[:, part], state.v, self.node[:, part]]
            inputs += [stage.slot + part.start, stage.count, stage.dt]
            outputs = [failing.damage[:, part], failing.plastic[:, part], failing.age[part], failing.work[part]]
            wp.launch(self.kernel, part.stop - part.start, inputs, [*outputs, failing.count, work.force])

        split(stage.count, launch, ELEMENTS)

    def lose(self, work: Workspace, state: State, part: slice) -> None:
        """After the energies of a range of elements: those of failed ones are lost."""
        own, first = state.elements[self.stage.index].failing, self.stage.block.first + part.start
        wp.launch(self.lose_kernel, part.stop - part.start, [own.age[part], own.work[part], first], [work.energy])


def silence(stage: ElementStage, element: wp.array, state: FailureState, force: wp.array) -> None:
    """No force of a stage's elements that have failed; `element` are their places in the block with this state."""
    inputs = [state.age, element, stage.slot, stage.corners]
    wp.launch(silence_kernel(str(stage.real.__name__)), len(element), inputs, [force])


def failing_of(stage: ElementStage, precision: str, kernels: Any) -> Failing | None:
    """What a stage has more where its elements may fail."""
    return Failing(stage, precision, kernels) if stage.block.failing else None


def failed(block: Block, age: np.ndarray) -> np.ndarray:
    """Which elements of a block have failed, shape (element_count,), bool; `age` as in `FailureState`."""
    return age < 0 if block.failing else np.zeros(block.conn.shape[1], dtype=bool)
