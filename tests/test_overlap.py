"""Kernels that begin while the one before them ends write nothing before they wait; see `kernels.overlap`."""

import re

import pytest
import warp as wp

from warp_mca.kernels import constraint, contact, hex8_patch, hex8r_patch, node, tet4
from warp_mca.kernels.overlap import EARLY, LEAST_ARCH
from warp_mca.overlap import overlap

KERNELS = {
    "integrate": lambda: node.integrate_kernel("mixed", True, True, True, early=True),
    "advance_bound": lambda: constraint.bound_kernel("mixed", True),
    "touch_surface": lambda: contact.surface_kernel(True, False),
    "touch_plane": lambda: contact.plane_kernel(True, False),
    "react": lambda: contact.react_kernel(False, contact.LANES),
    "tet4_dilation": lambda: tet4.dilation_kernel("mixed", False),
    "tet4_average": lambda: tet4.average_kernel("mixed"),
    "tet4_force": lambda: tet4.force_kernel("mixed", True),
    "hex8_patch_force": lambda: hex8_patch.force_kernel("mixed", True),
    "hex8r_patch_force": lambda: hex8r_patch.force_kernel("mixed", True),
}
WAIT = "griddepcontrol.wait"
WRITES = re.compile(r"^\s*(?:@\S+\s+)?(?:st\.(?!shared|local|param)|red\.|atom\.)", re.MULTILINE)


@pytest.mark.parametrize("name", KERNELS)
def test_kernel_writes_nothing_before_it_waits(name, tmp_path):
    kernel = KERNELS[name]()
    assert EARLY[kernel.key].key == kernel.key
    wp.compile_aot_module(kernel.module, device=None, arch=LEAST_ARCH, module_dir=tmp_path, use_ptx=True)
    (source,) = tmp_path.glob("*.ptx")
    text = source.read_text(encoding="utf-8", errors="replace")
    assert text.count(WAIT) == 1
    before, after = text.split(WAIT)
    assert not WRITES.search(before)
    assert WRITES.search(after)


def test_every_kernel_that_begins_early_is_tried():
    assert {key.rpartition("__")[2] for key in EARLY} == set(KERNELS)


def test_graph_of_a_cpu_stays_as_it_is():
    values = wp.zeros(1, dtype=float, device="cpu")
    with wp.ScopedDevice("cpu"), wp.ScopedCapture() as capture:
        values.fill_(1.0)
    assert overlap(capture.graph) == 0
