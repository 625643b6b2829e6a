"""Substeps as chains of launches that wait for each other: the order that a GPU keeps to, tried on a CPU."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from impacts import begun, figures, finished, flushing, prepared
from test_absorbing import chip_on_slab
from test_multi_rate import METAL, STEEL, graded, hinged
from test_overlap import Driver

import warp_mca as mca
from warp_mca.kernels.elements import hex8, hex8_patch
from warp_mca.kernels.hardware.early_launch import EARLY, MIN_ARCH
from warp_mca.kernels.nodes import node
from warp_mca.kernels.nodes.gather import Kind
from warp_mca.physics.elements.patch_stage import PatchStage
from warp_mca.step import early_launch
from warp_mca.step.rate_chains import Chains, Task, tasks
from warp_mca.system.stage import Step


def in_some_order(found: list[Task], top: int, seed: int) -> list[Task]:
    """Tasks in an order in which each comes after those that it waits for, and after the one before it in its chain."""
    ahead = {chain: [k for k, task in enumerate(found) if task.chain == chain] for chain in range(top + 1)}
    done, order, chosen = set(), [], np.random.default_rng(seed)
    while len(order) < len(found):
        ready = [own for own in ahead.values() if own and done.issuperset(found[own[0]].after)]
        number = ready[chosen.integers(len(ready))].pop(0)
        done.add(number)
        order.append(found[number])
    return order


@pytest.mark.parametrize("groups", [3, 4])
def test_tasks_in_any_order_that_keeps_their_waits_give_the_same_bits(groups: int):
    """Contact, friction, a hinge, a driven end and flow; against one substep after the other."""
    plain, chained = (begun(hinged(), multi_rate=groups) for _ in range(2))
    solver, steps = plain.solver, 40
    for impact in (plain, chained):
        impact.advance(until=4)
    solver.step(plain.state, steps)
    with wp.ScopedDevice("cpu"), flushing():
        chains = Chains(chained.solver)
        found = list(tasks(chains.top, 0, steps * chains.substeps))
        order = in_some_order(found, chains.top, groups)
        for task in order:
            chains.launch(task, Step(chained.state))
    chained.state.steps += steps
    rates = solver.model.rates
    assert rates is not None and order != found and chains.top == rates.top
    assert chained.state.differences(plain.state) == []
    assert (chained.state.contacts[0].spring.face.numpy() >= 0).any()


def test_elements_of_a_chain_have_a_node_of_its_level_and_none_below():
    model = prepared(hinged(), multi_rate=4).model
    assert model.rates is not None
    for block in model.blocks:
        ends, levels = (0, *block.part_ends), model.rates.top + 1
        for k in range(levels**2):
            nodes = block.conn[:, ends[k] : ends[k + 1]]
            assert (model.rates.node_level[nodes].min(axis=0) == k % levels).all()


def leaving() -> mca.Scene:
    """A bar strikes the top of a block, whose nodes alone carry the contact, and flies off."""
    bar = graded((0.02, 0.06, 0.02), (1, 8, 1), 6.0)
    block = mca.Box(size=(0.06, 0.03, 0.06), divisions=(8, 2, 8), origin=(-0.02, -0.03, -0.02))
    top = mca.Surface(body="block", nodes="ymax")
    return mca.Scene(
        name="leaving",
        bodies=(
            mca.Body(name="bar", geometry=bar, material=STEEL, velocity=(0.0, -20.0, 0.0)),
            mca.Body(name="block", geometry=block, material=STEEL),
        ),
        contacts=(mca.Contact(slave=mca.Surface(body="bar", nodes="ymin"), master=top, mu=0.3, penalty=0.3),),
        fixed=(mca.Fixed(body="block", nodes="ymin"),),
        impact=mca.ImpactPhase(duration=3e-4, output_interval=4e-6, energy_tolerance=0.2),
    )


@pytest.mark.parametrize("scene", [leaving, chip_on_slab])
def test_an_impact_in_chains_has_the_bits_of_substeps_in_turn(scene: Callable[[], mca.Scene]):
    """With its searches and records."""
    plain, chained = (begun(scene(), duration=4e-5, multi_rate=3) for _ in range(2))
    with wp.ScopedDevice("cpu"):
        chained.solver.chains = Chains(chained.solver)
    for impact in (plain, chained):
        impact.advance()
        assert impact.stopped == [None]
    assert plain.state.scenes[0].touched
    assert chained.state.differences(plain.state) == []
    known, found = figures(plain), figures(chained)
    assert [name for name in known if known[name].tobytes() != found[name].tobytes()] == []


def test_patches_of_a_chain_are_its_elements(monkeypatch: pytest.MonkeyPatch):
    """Of each level up to that of the substep; patches of the fastest that yield are halved where there is room."""
    bar = graded((0.04, 0.3, 0.04), (8, 40, 8), 8.0)
    body = mca.Body(name="bar", geometry=bar, material=METAL)
    scene = mca.Scene(name="bar", bodies=(body,), impact=mca.ImpactPhase(duration=1e-5))
    model = prepared(scene, multi_rate=3).model
    (block,) = model.blocks
    for count, size in ((4, 128), (40, 64)):
        monkeypatch.setattr(wp.get_device("cpu"), "sm_count", count)
        stage = PatchStage(block, model.X, "mixed", hex8, hex8_patch, points=8)
        sizes = np.diff(np.append(stage.patches.head.numpy()[:, 0], stage.count))
        assert sizes[0] == size and sizes.max() == 128
        for (level, chain), patches in stage.chains.items():
            head = patches.head.numpy()
            found = [np.arange(first, first + (counts & 0xFF)) for first, _, counts, _ in head]
            wanted = [np.arange(part.start, part.stop) for part in stage.parts(level, chain)]
            assert np.array_equal(np.concatenate(found), np.concatenate(wanted))
        assert {level for level, _ in stage.chains} == {0, 1}


def test_slow_nodes_do_not_begin_early_but_what_follows_them_does(monkeypatch: pytest.MonkeyPatch):
    """Their threads would wait on the device for elements that take several substeps."""
    slow, fast = (node.integrate_kernel(Kind("mixed", rated=True), beside=beside) for beside in (True, False))
    patches = hex8_patch.force_kernel("mixed", "")
    assert slow.key not in EARLY and fast.key in EARLY
    names = [f"{kernel.key}_1a2b3c4d_cuda_kernel_forward" for kernel in (patches, slow, patches, fast)]
    fake = Driver(names, [(0, 1), (1, 2), (2, 3)])
    monkeypatch.setattr(early_launch, "_call", fake)
    monkeypatch.setattr(wp, "get_cuda_driver_version", lambda: (13, 0))
    device = SimpleNamespace(is_cuda=True, get_cuda_compile_arch=lambda: MIN_ARCH)
    assert early_launch.launch_early(SimpleNamespace(device=device, graph=ctypes.c_void_p(1))) == 2
    assert fake.changes[0][1] == [(1, 2), (2, 3)]


@pytest.mark.gpu
def test_a_device_gives_the_figures_of_the_cpu_and_repeats_itself():
    cpu, cuda, again = (finished(leaving(), multi_rate=3, device=device) for device in ("cpu", "cuda:0", "cuda:0"))
    assert cuda.state.differences(again.state) == []
    known, found = figures(cpu), figures(cuda)
    for name in ("history/F_n_N", "history/E_kinetic", "history/E_internal"):
        assert found[name] == pytest.approx(known[name], abs=1e-4 * np.abs(known[name]).max()), name
