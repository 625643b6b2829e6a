"""Owns kernel arguments that may differ between the scenes of a batch: a scalar for one scene, else an array."""

from typing import Any

import warp as wp


@wp.func
def _shared(value: Any, scene: int):
    return value


@wp.func
def _own(values: Any, scene: int):
    return values[scene]


def kind(dtype: Any, each: bool) -> Any:
    """Type of a kernel's argument: `dtype`, or an array of it, indexed by scene, if `each` scene has its own value."""
    return wp.array[dtype] if each else dtype


def value_function(each: bool) -> Any:
    """The function (argument of that type, scene) -> value of the scene.

    With (0 or array of scenes, node or slave) it gives the scene of a node or a slave. For a single scene it reads no
    memory.
    """
    return _own if each else _shared
