"""Kernels that begin while the one before them ends touch nothing that changes before they wait."""

import ctypes
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
import warp as wp

from warp_mca.kernels.contact import contact, edge_shares, sides
from warp_mca.kernels.elements import hex8_patch, hex8i_patch, hex8r_patch, patch, tet4
from warp_mca.kernels.hardware.early_launch import EARLY, MIN_ARCH
from warp_mca.kernels.nodes import absorbing, constraint, floating, node
from warp_mca.kernels.nodes.gather import Kind
from warp_mca.scene.materials import Elastic, J2Bilinear
from warp_mca.step import early_launch as module
from warp_mca.step.early_launch import launch_early

KERNELS = Path(node.__file__).parents[1]
# As float32 without and float64 with what a model may have more, plasticity, friction, scenes of their own, ...
TWO = (("mixed", False), ("float64", True))
LAWS = {False: Elastic.law, True: J2Bilinear.law}
VARIANTS = {
    "integrate": [
        *(node.integrate_kernel(Kind(p, not m, m, False, not m), True, m, m) for p, m in TWO),
        *(node.integrate_kernel(Kind(p, not m, m, True), True, m, m) for p, m in TWO),
    ],
    "advance_absorbing": [absorbing.absorbing_kernel(Kind(p, m, m), m) for p, m in TWO],
    "advance_bound": [constraint.bound_kernel(Kind(p, m, m), m, driven=m) for p, m in TWO],
    "see_nodes": [floating.see_nodes],
    "touch_surface": [contact.surface_kernel(m, m) for _, m in TWO],
    "touch_sides": [sides.sided_kernel(True, True, 3)],  # takes 7 s to compile
    "touch_plane": [contact.plane_kernel(m, m) for _, m in TWO],
    "carry": [edge_shares.carry_kernel(3)],
    "react": [contact.react_kernel(m, contact.LANES) for _, m in TWO],
    "tet4_dilatation": [tet4.dilatation_kernel(p, m) for p, m in TWO],
    "tet4_average": [tet4.average_kernel(p) for p, _ in TWO],
    "tet4_force": [tet4.force_kernel(p, LAWS[m], False) for p, m in TWO],
    # All begin alike (`patch_kernel.py`): one of each element, one of them with lanes for elements that yield.
    "patch_force": [
        hex8_patch.force_kernel("mixed", LAWS[True]),
        *(own.force_kernel("float64", LAWS[False]) for own in (hex8r_patch, hex8i_patch.kernels(8))),
    ],
}
# Reads ahead of the wait: the first two slots and the mass of a node, its number where it is listed, or its place and
# frame; head, corners and points of patches.
READS = {"integrate": 3, "integrate_rated": 4, "see_nodes": 4, "patch_force": 15}
WAIT = "griddepcontrol.wait"
READ = re.compile(r"\b(?:ld\.(?!param|shared|local|const)|cp\.async\.c)")
WRITE = re.compile(r"\b(?:st\.(?!param|shared|local)|red\.|atom\.(?!shared))")
BRANCH = re.compile(r"\bbra\b")


@pytest.mark.parametrize(("name", "k"), [(name, k) for name, kernels in VARIANTS.items() for k in range(len(kernels))])
def test_kernel_touches_nothing_that_changes_before_it_waits(name, k, tmp_path):
    kernel = VARIANTS[name][k]
    assert kernel.key in EARLY
    wp.compile_aot_module(kernel.module, device=None, arch=MIN_ARCH, module_dir=tmp_path, use_ptx=True)
    (source,) = tmp_path.glob("*.ptx")
    text = source.read_text(encoding="utf-8", errors="replace")
    assert text.count(WAIT) == 1
    before, after = text.split(WAIT)
    assert not WRITE.search(before)
    assert WRITE.search(after)
    assert len(READ.findall(before)) <= READS.get(kernel.key, READS.get(name, 0))
    if name not in READS:  # Warp asks whether there are so many threads, no more
        assert len(BRANCH.findall(before)) == 1


def test_every_kernel_that_begins_early_is_tried():
    found = [re.findall(r"begins_early\((\w+)\)", file.read_text(encoding="utf-8")) for file in KERNELS.rglob("*.py")]
    assert sorted(name for names in found for name in names) == sorted(VARIANTS)


class Driver:
    """A graph whose nodes are named by Warp's names of kernels, or None where they are something else."""

    first = 0x7F0000000000  # as wide as a pointer

    def __init__(self, names, edges):
        self.names, self.changes = names, []
        self.edges = edges

    def name(self, node):
        return self.names[node - self.first]

    def __call__(self, what, *arguments):
        if what == "cuGraphGetEdges_v2":
            _, begin, end, _, count = arguments
            count._obj.value = len(self.edges)
            for k, (a, b) in enumerate(self.edges if begin else ()):
                begin[k], end[k] = self.first + a, self.first + b
        elif what == "cuGraphNodeGetType":
            arguments[1]._obj.value = 0 if self.name(arguments[0].value) else 1
        elif what == "cuGraphKernelNodeGetParams_v2":
            arguments[1]._obj.func = arguments[0].value
        elif what == "cuFuncGetName":
            arguments[0]._obj.value = self.name(arguments[1].value).encode()
        else:
            _, begin, end, data, count = arguments
            ports = {(e.from_port, e.to_port, e.type, bytes(e.reserved)) for e in data[: count.value]}
            pairs = [(a - self.first, b - self.first) for a, b in zip(begin[: count.value], end, strict=False)]
            self.changes.append((what, pairs, ports))


def changed(monkeypatch, arch=MIN_ARCH, driver=(13, 0)):
    """Edges that `launch_early` asks the driver to change, in a graph of two steps with a copy behind the first."""
    patches = VARIANTS["patch_force"][0].key
    keys = [patch.schedule.key, patches, patches, VARIANTS["integrate"][0].key, None, patches]
    names = [key and f"{key}_1a2b3c4d_cuda_kernel_forward" for key in keys]
    fake = Driver(names, [(0, 1), (1, 2), (2, 3), (3, 4), (3, 5), (4, 5)])
    monkeypatch.setattr(module, "_call", fake)
    monkeypatch.setattr(wp, "get_cuda_driver_version", lambda: driver)
    device = SimpleNamespace(is_cuda=True, get_cuda_compile_arch=lambda: arch)
    assert launch_early(SimpleNamespace(device=device, graph=ctypes.c_void_p(1))) == (2 if fake.changes else 0)
    return fake.changes


def test_edges_between_kernels_of_two_kinds_that_begin_early_are_changed(monkeypatch):
    remove, add = changed(monkeypatch)
    assert remove == ("cuGraphRemoveDependencies_v2", [(2, 3), (3, 5)], {(0, 0, 0, bytes(5))})
    assert add == ("cuGraphAddDependencies_v2", [(2, 3), (3, 5)], {(1, 0, 1, bytes(5))})


@pytest.mark.parametrize(("arch", "driver"), [(80, (13, 0)), (90, (12, 2)), (90, None)])
def test_code_or_driver_that_is_too_old_leaves_a_graph_as_it_is(arch, driver, monkeypatch):
    assert changed(monkeypatch, arch, driver) == []


def test_graph_of_a_cpu_stays_as_it_is():
    values = wp.zeros(1, dtype=float, device="cpu")
    with wp.ScopedDevice("cpu"), wp.ScopedCapture() as capture:
        values.fill_(1.0)
    assert launch_early(capture.graph) == 0
