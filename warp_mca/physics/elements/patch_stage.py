"""Owns the device side of elements that a GPU computes by patches, and the choice between that and one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.kernels.elements import patch
from warp_mca.kernels.elements.patch_layout import PATCH, SLOTS
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.physics.elements.patches import Array, grid_points, make_patches
from warp_mca.physics.elements.stage import BLOCK_DIM, ElementStage, levels_of
from warp_mca.physics.elements.state import ElementState
from warp_mca.system.threads import Split, whole

if TYPE_CHECKING:
    from warp_mca.system.block import Block
    from warp_mca.system.state import State
    from warp_mca.system.workspace import Workspace


def patch_size(elements: int, multiprocessors: int) -> int:
    """Elements of a patch: fewer where each patch then still has a multiprocessor to itself, and others are left."""
    return PATCH if elements > PATCH // 2 * (3 * multiprocessors // 4) else PATCH // 2


class PatchStage(ElementStage):
    """Patches of the block on the device; a slot for each node of a patch.

    Attributes:
        patches: on the device.
        point: what `kernels.elements.patch.POINT` says of each slot.
        flowing: elements of each patch that took the return map last, shape (patch_count,), int32; empty where no
            order of patches is kept.
        maker: of the element in a patch.
        lanes: threads that compute an element that yields, apart from others; 0 where elements are computed alike.
        most: blocks of threads that the device holds.
        chains: patches of elements up to a level and of one chain, by these two numbers, where there are any.
        beside: blocks of threads of one chain beside that of the fastest nodes.
        blocks: of threads; each computes one patch after another.
    """

    def __init__(
        self,
        block: Block,
        X: Array,
        precision: str,
        kernels: Any,
        patch_kernels: Any,
        points: int,
    ) -> None:
        """Allocate; `patch_kernels` makes the force kernel and the element, other arguments as `ElementStage`."""
        super().__init__(block, precision, kernels, points)
        self.force_kernel = patch_kernels.force_kernel(precision, block.law, block.joining)
        self.maker = patch_kernels.element
        own = self.maker(precision, block.law, block.joining)
        self.lanes = own.lanes if own.flow else 0
        mixed = precision == "mixed"
        ends, size = (*block.ends, *block.part_ends), patch_size(block.conn.shape[1], wp.get_device().sm_count)
        halved = self._halved(size)
        host = make_patches(block.conn, ends, SLOTS[precision], X if mixed else None, size, halved)
        point, exponent = grid_points(X, host) if mixed else (host.node, np.zeros(len(host.start) - 1, dtype=np.int32))
        self.slot_node = host.node
        heads = host.heads(exponent, block.level_ends)
        self.patches = patch.Patches()
        self.patches.head = wp.array(heads, dtype=wp.vec4i)
        self.most = wp.get_device().sm_count * patch.RESIDENT[precision]
        self.blocks = min(len(heads), self.most)
        self.rounds = len(heads) // self.most
        self.point = wp.array(point, dtype=patch.POINT[precision])
        self.patches.corner = wp.array(host.words(block.material), dtype=wp.uint32)
        self.patches.places = wp.array(host.places.view(np.int32), dtype=wp.vec2i)
        patches_of_levels = np.searchsorted(host.start[:-1], block.level_ends)
        self.slot_level = levels_of(host.slot_start[patches_of_levels].tolist())
        self.scheduled = block.plastic and self.lanes > 0
        self.patches.turn = wp.clone(self.patches.head) if self.scheduled else self.patches.head
        self.flowing = wp.zeros(len(heads) if self.scheduled else 0, dtype=wp.int32)
        self.flowing_of_run = wp.zeros(patch.SCHEDULERS if self.scheduled else 0, dtype=wp.int32)
        levels = range(len(block.level_ends))
        self.beside = wp.get_device().sm_count * patch.BESIDE[precision]
        self.chains: dict[tuple[int, int], Any] = {}
        for level, chain in ((k, c) for k in levels for c in range(k + 1)):
            places = [np.arange(*np.searchsorted(host.start[:-1], [p.start, p.stop])) for p in self.parts(level, chain)]
            if places:
                self.chains[level, chain] = self._chosen(heads[np.concatenate(places)])

    def _halved(self, size: int) -> int:
        """Elements of level 0 if they yield, and patches of half the size would still find places at once."""
        if not self.block.level_ends or not self.block.plastic or not self.lanes:
            return 0
        count = self.block.level_ends[0]
        return count if count <= patch.HALVED * wp.get_device().sm_count * (size // 2) else 0

    def _chosen(self, heads: NDArray[np.int32]) -> Any:
        """Some of the patches, in the order of these heads."""
        found = patch.Patches()
        found.head = found.turn = wp.array(heads, dtype=wp.vec4i)
        found.corner, found.places = self.patches.corner, self.patches.places
        return found

    def new_state(self) -> ElementState:
        """As for elements one by one, but lanes read the points of one element together."""
        found = super().new_state()
        if self.lanes > 1:
            found.history = wp.zeros(found.history.shape[::-1], dtype=self.real).transpose()
        return found

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [*super().kernels(), *([patch.schedule] if self.scheduled else [])]

    def make_room(self, blocks: int) -> None:
        """Leave a place to each of so many blocks of contact; to fewer where elements take many rounds.

        Contact then takes rounds too, but a quarter as many at most: it has two kernels, and other work to wait for.
        """
        room = -(-blocks // max(1, self.rounds // 4))
        self.blocks = min(len(self.patches.head), max(self.most // 2, self.most - room))

    def schedule(self) -> None:
        """Patches in which elements yield come before the others, because they take longer."""
        if not self.scheduled or self.blocks >= len(self.patches.head):
            return
        for kernel, inputs, output in (
            (patch.count_flowing, [self.flowing], self.flowing_of_run),
            (patch.schedule, [self.flowing, self.flowing_of_run, self.patches.head], self.patches.turn),
        ):
            wp.launch(kernel, patch.SCHEDULERS, inputs=inputs, outputs=[output], block_dim=BLOCK_DIM)

    def launch(
        self,
        work: Workspace,
        state: State,
        split: Split = whole,
        level: int | None = None,
        chain: int | None = None,
    ) -> None:
        """Forces of each patch on its nodes [N], into the slots of this block; plastic flow."""
        own = state.elements[self.index]
        patches = self.patches if level is None or chain is None else self.chains[level, chain]
        most = min(self.blocks, self.beside) if chain else self.blocks
        blocks = min(most, len(patches.head))
        patches.dt = self.dt
        inputs = [work.X, self.point, patches, work.law, work.displacements(state), self.slot, blocks]
        outputs = [own.yielded, own.history, own.extreme, self.flowing, work.force]
        wp.launch(self.force_kernel, blocks * PATCH, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)


def hexahedral_stage(
    block: Block, X: Array, precision: str, kernels: Any, patch_kernels: Any, points: int
) -> ElementStage:
    """By patches on a GPU at small strain; one by one else, with a rated or general law, or if elements may fail."""
    if block.failing or block.finite or law_functions(block.law, precision).by_points or not wp.get_device().is_cuda:
        return ElementStage(block, precision, kernels, points)
    return PatchStage(block, X, precision, kernels, patch_kernels, points)
