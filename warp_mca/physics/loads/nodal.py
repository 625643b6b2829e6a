"""Owns the host side of loads on nodes, of the kinds in `scene.loads.LOADS`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.loads import LOADS, Load
from warp_mca.system.bodies import Bodies
from warp_mca.system.loads import LoadedNodes

if TYPE_CHECKING:
    from warp_mca.system.model import Model


def loaded_nodes(
    parts: Bodies, start: float, added: NDArray[np.float64], several_rates: bool
) -> dict[str, tuple[LoadedNodes, ...]]:
    """The loads of a scene by kind, for a phase that starts so long after the release [s].

    What they add to the eigenvalues is added to `added` [1/s^2], shape (node_count,).

    Raises:
        RequestError: a load acts on a rigid body, or does not go with `several_rates`.
    """
    found: dict[str, list[LoadedNodes]] = {}
    for load in parts.scene.loads:
        kind = type(load).__name__
        for name, body in load.bodies().items():
            if parts.scene.body(body).rigid and not load.on_rigid:
                raise bad_value(f"{kind}.{name}", body, "loads act on nodes of flexible bodies; leave rigid off")
        if not isinstance(load.refuses, Mapping):
            raise bad_value(f"{kind}.refuses", load.refuses, "give a dict of remedies by what it does not go with")
        if several_rates and "multi_rate" in load.refuses:
            raise bad_value("Scene.loads", kind, f"it does not go with multi_rate; {load.refuses['multi_rate']}")
        item = validate.call("Scene.loads", kind, "making its arrays", _arrays, load, parts, start, added)
        found.setdefault(kind, []).append(item)
    return {kind: tuple(found[kind]) for kind in sorted(found)}


def _arrays(load: Load, parts: Bodies, start: float, added: NDArray[np.float64]) -> LoadedNodes:
    """Those of a load, with its nodes as they may be, and what it adds to the eigenvalues."""
    item = load.build(parts, start)
    if not isinstance(item, LoadedNodes):
        raise TypeError(f"build() gives a {type(item).__name__}, not a LoadedNodes")
    if not (np.isin(item.node, np.arange(len(added))).all() and (len(item.node) or not item.on_nodes)):
        raise IndexError(f"LoadedNodes.node names no node, or others than 0 to {len(added) - 1}")
    np.add.at(added, item.node, item.eigenvalues(parts.mass))
    return item


def load_speed(model: Model, duration: float) -> float:
    """Speed that loads give to a body that nothing holds until then at most [m/s]: contact is searched for by it."""
    starts = np.array(sorted(model.node_start.values()))
    ends = np.append(starts[1:], model.node_count)
    held = np.flatnonzero(model.fixed_axes)
    second = model.joint_second[model.joint_second >= 0]
    bound = np.concatenate([held, model.joint_first, second, model.prescribed_node, model.ties.slave])
    impulse = np.zeros(len(starts))
    for item in (item for items in model.loads.values() for item in items if len(item.node)):
        impulse[np.searchsorted(starts, item.node[0], side="right") - 1] += item.impulse(duration)
    impulse[np.searchsorted(starts, bound, side="right") - 1] = 0.0
    mass = np.array([model.mass[first:end].sum() for first, end in zip(starts, ends, strict=True)])
    return float((impulse / np.where(impulse > 0.0, mass, 1.0)).max())


def check_batch(scenes: Sequence[Mapping[str, Sequence[object]]]) -> None:
    """Refuse scenes of a batch whose kinds of loads differ, or that have a kind which no batch can.

    Args:
        scenes: loads of each scene by kind, as `Model.loads`.

    Raises:
        RequestError: there are such scenes.
    """
    for loads in scenes:
        if loads.keys() != scenes[0].keys():
            differing = ", ".join(sorted(loads.keys() ^ scenes[0].keys()))
            raise bad_value("Scene.loads", differing, "scenes of a batch have loads of the same kinds; run them apart")
        for kind in (kind for kind in loads if LOADS[kind].readings and len(loads[kind]) != len(scenes[0][kind])):
            remedy = "scenes of a batch have as many of them each, which are recorded; run them apart"
            raise bad_value("Scene.loads", f"{len(loads[kind])} {kind}", remedy)
    for kind in scenes[0]:
        if "run_batch" in LOADS[kind].refuses:
            raise bad_value("Scene.loads", kind, f"it does not go with run_batch; {LOADS[kind].refuses['run_batch']}")
