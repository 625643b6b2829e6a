"""What a record sums: against NumPy's sums of the arrays that it is of, by scene and whatever the number of entries."""

from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

from warp_mca.kernels.records import ledger
from warp_mca.kernels.records.columns import (
    DRIVE_WORK,
    ELASTIC,
    GRAVITY_WORK,
    HOURGLASS,
    JACOBIAN,
    KINETIC,
    PLASTIC,
    STRAIN,
)
from warp_mca.kernels.records.ledger import RUN, SUM_WIDTH
from warp_mca.system.layout import Layout
from warp_mca.system.workspace import run_count

COLUMNS = 8


def offsets(*counts: int) -> np.ndarray:
    return np.cumsum([0, *counts]).astype(np.int32)


def record(kernel, scenes: int, inputs: list, *more: wp.array) -> np.ndarray:
    """Row 1 of two, shape (scene_count, COLUMNS, SUM_WIDTH), not a number where nothing was written."""
    partial = wp.full((2, scenes, COLUMNS, SUM_WIDTH), np.nan, dtype=wp.float64, device="cpu")
    row = wp.array([1], dtype=wp.int32, device="cpu")
    wp.launch(kernel, (scenes, SUM_WIDTH, 1), inputs=[row, *inputs], outputs=[partial, *more], device="cpu")
    assert np.isnan(partial.numpy()[0]).all()
    return partial.numpy()[1]


@pytest.mark.parametrize("counts", [(1000,), (1, RUN - 1, RUN + 1, RUN * SUM_WIDTH + 5)])
def test_motion(counts: tuple[int, ...]):
    rng = np.random.default_rng(0)
    first, driven = offsets(*counts), offsets(*(k // 3 for k in counts))
    mass, heavy = rng.uniform(1.0, 2.0, (2, first[-1]))
    u, before, v = rng.normal(size=(3, first[-1], 3))
    gravity = rng.normal(size=(len(counts), 3))
    gravity[-1] = 0.0
    work = rng.normal(size=(driven[-1], 3))
    points = np.array([0, first[-1] - 1])
    kinds = [wp.float64, wp.float64, wp.vec3d, wp.vec3d, wp.vec3d, wp.vec3d]
    values = (mass, heavy, gravity, u, before, v)
    arrays = [wp.array(x, dtype=k, device="cpu") for x, k in zip(values, kinds, strict=True)]
    starts = [wp.array(x, dtype=wp.int32, device="cpu") for x in (first, driven, points)]
    found = wp.zeros((2, 2), dtype=wp.vec3d, device="cpu")
    inputs = [*arrays, 0.1, starts[0], wp.array(work, dtype=wp.vec3d, device="cpu"), starts[1], starts[2]]
    sums = record(ledger.record_motion, len(counts), inputs, found).sum(axis=2)
    for k in range(len(counts)):
        part = slice(first[k], first[k + 1])
        kinetic = 0.5 * np.einsum("i,ij,ij", mass[part], before[part], v[part])
        fall = heavy[part] @ (u[part] - 0.1 * v[part]) @ gravity[k]
        assert sums[k, KINETIC] == pytest.approx(kinetic, rel=1e-12, abs=1e-12)
        assert sums[k, GRAVITY_WORK] == pytest.approx(fall, rel=1e-12, abs=1e-12)
        assert sums[k, DRIVE_WORK] == pytest.approx(work[driven[k] : driven[k + 1]].sum(), rel=1e-12, abs=1e-12)
    assert found.numpy()[1] == pytest.approx(0.5 * (before + v)[points], rel=1e-15)


@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_elements_of_several_blocks_and_scenes(precision: str):
    """A scene without elements in a block has the bits that it has where there is no such block."""
    real = {"mixed": np.float32, "float64": np.float64}[precision]
    counts = np.array([[700, 300], [0, 1000], [3, 0]])  # of each scene in each block
    ends = offsets(*counts.T.ravel())[1:].reshape(2, 3).T
    ranges = np.stack([ends - counts, ends], axis=2).astype(np.int32)
    energy = np.random.default_rng(0).uniform(0.0, 2.0, (5, counts.sum())).astype(real)

    def sums(energy: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        inputs = [wp.array(energy, device="cpu"), wp.array(ranges, device="cpu")]
        return record(ledger.sum_elements_kernel(precision), len(ranges), inputs)

    partial = sums(energy, ranges)
    for k in range(3):
        own = np.concatenate([energy[:, a:b] for a, b in ranges[k]], axis=1).astype(float)
        for column, row in ((ELASTIC, 0), (PLASTIC, 1), (HOURGLASS, 4)):
            assert partial[k, column].sum() == pytest.approx(own[row].sum(), rel=1e-12)
        assert partial[k, STRAIN].max() == own[2].max()
        assert partial[k, JACOBIAN].min() == min(own[3].min(), 1.0)
    second = slice(*ranges[1, 1])
    alone = sums(np.ascontiguousarray(energy[:, second]), np.array([[[0, 1000]]], dtype=np.int32))
    assert np.array_equal(alone[0], partial[1], equal_nan=True)


@pytest.mark.parametrize(
    ("entries", "expected"), [(5, 8), (8 * RUN, 8), (8 * RUN + 1, 16), (60 * RUN, 64), (10**6, 256)]
)
def test_a_batch_keeps_as_many_runs_as_its_scenes_have_and_sums_stay(entries: int, expected: int):
    layout = Layout(nodes=offsets(3, entries), joints=offsets(0, 0), elements=np.zeros((2, 1, 2), dtype=np.int32))
    none = SimpleNamespace(passes=(), loads={}, absorbing=SimpleNamespace(node=np.zeros(0)))
    assert run_count(none, layout) == expected  # type: ignore[arg-type]
    partial = np.zeros((5, 2, 7, SUM_WIDTH))
    filled = min(expected, -(-entries // RUN))
    partial[..., :filled] = np.random.default_rng(entries).normal(size=(5, 2, 7, filled))
    few = np.ascontiguousarray(partial[..., :expected])
    assert np.array_equal(few[:, 1][:4, :6].sum(axis=2), partial[:, 1][:4, :6].sum(axis=2))
