"""Owns which kernels of a captured CUDA graph begin while the one before them ends, and which need the device at once.

The first by marks on its edges, the second by an attribute of its nodes; see `kernels.hardware.early_launch` and
`kernels.resident.meeting` for the kernels' side.

Warp captures graphs but leaves their edges as they are, so that the driver is asked to change them: CUDA Driver API,
"Graph Management".
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.early_launch import EARLY, LEADING, MIN_ARCH
from warp_mca.kernels.resident.meeting import TOGETHER

MIN_DRIVER = (12, 3)

_KERNEL = 0  # CU_GRAPH_NODE_TYPE_KERNEL
_COOPERATIVE = 2  # CU_LAUNCH_ATTRIBUTE_COOPERATIVE
_PROGRAMMATIC = 1  # CU_GRAPH_DEPENDENCY_TYPE_PROGRAMMATIC and CU_GRAPH_KERNEL_NODE_PORT_PROGRAMMATIC
_SUFFIX = "_cuda_kernel_forward"  # Warp's names are key, underscore, hash, and this


class _Edge(ctypes.Structure):
    """CUgraphEdgeData."""

    _fields_ = (
        ("from_port", ctypes.c_ubyte),
        ("to_port", ctypes.c_ubyte),
        ("type", ctypes.c_ubyte),
        ("reserved", ctypes.c_ubyte * 5),
    )


class _Node(ctypes.Structure):
    """CUDA_KERNEL_NODE_PARAMS_v2."""

    _fields_ = (("func", ctypes.c_void_p), ("sizes", ctypes.c_uint * 7), ("others", ctypes.c_void_p * 4))


@cache
def _driver() -> Any:
    return ctypes.CDLL("libcuda.so.1")


def _call(name: str, *arguments: Any) -> None:
    if code := getattr(_driver(), name)(*arguments):
        raise RuntimeError(f"{name} failed with CUDA error {code}")


def _key(node: int) -> str:
    """Key of the Warp kernel of a node; empty where it is something else.

    Raises:
        RuntimeError: the driver does not say.
    """
    handle, kind, params, name = ctypes.c_void_p(node), ctypes.c_int(), _Node(), ctypes.c_char_p()
    _call("cuGraphNodeGetType", handle, ctypes.byref(kind))
    if kind.value != _KERNEL:
        return ""
    _call("cuGraphKernelNodeGetParams_v2", handle, ctypes.byref(params))
    _call("cuFuncGetName", ctypes.byref(name), ctypes.c_void_p(params.func))
    return (name.value or b"").decode().removesuffix(_SUFFIX).rpartition("_")[0]


def launch_together(graph: Any) -> int:
    """Launch all blocks of threads of the kernels that TOGETHER names at once, or not at all.

    Args:
        graph: captured by Warp, not launched yet.

    Returns:
        The number of kernels.

    Raises:
        RuntimeError: the driver failed.
    """
    if not graph.device.is_cuda:
        return 0
    count = ctypes.c_size_t()
    _call("cuGraphGetNodes", graph.graph, None, ctypes.byref(count))
    if not count.value:
        return 0
    nodes = (ctypes.c_void_p * count.value)()
    _call("cuGraphGetNodes", graph.graph, nodes, ctypes.byref(count))
    chosen = [node for node in nodes if _key(node) in TOGETHER]
    value = (ctypes.c_int * 16)(1)  # CUkernelNodeAttrValue, a union of 64 bytes
    for node in chosen:
        _call("cuGraphKernelNodeSetAttribute", ctypes.c_void_p(node), _COOPERATIVE, ctypes.byref(value))
    return len(chosen)


def launch_early(graph: Any) -> int:
    """Let a kernel that is registered by `begins_early` begin while the registered kernel before it ends.

    That may be one that is registered by `lets_begin` alone. Edges to and from other kernels stay as they are, because
    what these write may be read ahead of a wait. So do edges between two kernels of one kind, such as elements of two
    blocks: the second would spread unevenly over multiprocessors that are partly full.

    Args:
        graph: captured by Warp, not launched yet.

    Returns:
        The number of edges changed: 0 on a CPU, for code compiled for GPUs before Hopper, or with a driver older than
        12.3.

    Raises:
        RuntimeError: the driver failed.
    """
    device = graph.device
    if not device.is_cuda or tuple(wp.get_cuda_driver_version() or ()) < MIN_DRIVER:
        return 0
    if device.get_cuda_compile_arch() < MIN_ARCH:  # of the code, which may be older than the device's own
        return 0
    count = ctypes.c_size_t()
    _call("cuGraphGetEdges_v2", graph.graph, None, None, None, ctypes.byref(count))
    if not count.value:  # the driver refuses to list none
        return 0
    Nodes, Edges = ctypes.c_void_p * count.value, _Edge * count.value
    begin, end, data = Nodes(), Nodes(), Edges()
    _call("cuGraphGetEdges_v2", graph.graph, begin, end, data, ctypes.byref(count))
    keys = {node: _key(node) for node in {*begin, *end}}
    pairs = [(keys[a], keys[b]) for a, b in zip(begin, end, strict=True)]
    chosen = [k for k, (a, b) in enumerate(pairs) if a in EARLY | LEADING and b in EARLY and a != b]
    if not chosen:
        return 0
    edges = [_Edge(from_port=_PROGRAMMATIC, type=_PROGRAMMATIC) for _ in chosen]
    for name, kinds in (("Remove", [data[k] for k in chosen]), ("Add", edges)):
        nodes = [Nodes(*[side[k] for k in chosen]) for side in (begin, end)]
        _call(f"cuGraph{name}Dependencies_v2", graph.graph, *nodes, Edges(*kinds), ctypes.c_size_t(len(chosen)))
    return len(chosen)
