"""Owns kernel arguments that are scalars for one scene, and arrays with one entry for each scene for a batch."""

from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def _shared(value: Any, scene: int):
    return value


@wp.func
def _own(values: Any, scene: int):
    return values[scene]


def kind(dtype: Any, each: bool) -> Any:
    """Type of a kernel's argument: `dtype`, or an array of it if each scene has its own."""
    return wp.array[dtype] if each else dtype


def value_function(each: bool) -> Any:
    """The function of an argument of that type and the number of a scene that gives the scene's value.

    It also gives the scene of a node or a slave, from an argument that is 0 or an array: a lone scene reads no memory.
    """
    return _own if each else _shared
