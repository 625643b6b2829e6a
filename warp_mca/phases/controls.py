"""Owns what asks the functions that drive freedoms of joints, at the beginning of output intervals."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.validate import DAMAGE
from warp_mca.scene import Controller, Scene

if TYPE_CHECKING:
    from warp_mca.system.state import State

CALLS = "controls/calls"  # beside the arrays of a stored state


class Controls:
    """Controllers of a scene, the rates of joints that each drives, and all calls so far.

    A function may keep a state of its own, such as an integral. Where a run goes on from a stored state, it is called
    again with all that it got before, so that this state is what it was.
    """

    def __init__(self, scene: Scene, state: State) -> None:
        """None are asked of a scene without."""
        self._state, self._interval = state, scene.impact.output_interval
        rates: dict[int, list[int]] = {}
        controllers: dict[int, Controller] = {}
        first = 0
        for whole in filter(None, (joint.whole() for joint in scene.acting_joints)):
            for freedom in whole.freedoms:
                if isinstance(freedom.motor, Controller):
                    controllers[id(freedom.motor)] = freedom.motor
                    rates.setdefault(id(freedom.motor), []).append(first)
                first += freedom.rates
        self._controllers = list(controllers.values())
        self._rates: list[Index] = [np.array(rates[key], dtype=np.int32) for key in controllers]
        self._calls: list[Array] = []  # number of the controller, time, positions, rates and what it gave

    @property
    def plan(self) -> list[tuple[float, list[int]]]:
        """Period of each controller [s], and the rates that it drives."""
        return [(item.period, own.tolist()) for item, own in zip(self._controllers, self._rates, strict=True)]

    def ask(self, interval: int, time: float) -> None:
        """Ask those that are due at the beginning of an output interval, which has this number, at a time [s].

        Raises:
            RequestError: a function fails, or gives something else than finite numbers.
        """
        every = [max(round(item.period / self._interval), 1) for item in self._controllers]
        due = [k for k, count in enumerate(every) if interval % count == 0]
        if not due:
            return
        joints = self._state.rigid.joints
        position, rate, held = (array.numpy().copy() for array in (joints.position, joints.rate, joints.held))
        for k in due:
            own = self._rates[k]
            held[own] = self._controllers[k].torques(time, position[own], rate[own])
            self._calls.append(np.concatenate([[k, time], position[own], rate[own], held[own]]))
        joints.held.assign(held)

    def arrays(self) -> dict[str, NDArray]:
        """All calls so far as one array, to be stored with the state; nothing of a scene without controllers."""
        return {CALLS: np.concatenate([[], *self._calls])} if self._controllers else {}

    def restore(self, path: str | os.PathLike[str]) -> None:
        """Call the functions as they were called before the state in the file `path` was stored.

        Raises:
            RequestError: the file is damaged, or a function gives other numbers than it gave then.
        """
        if not self._controllers:
            return
        try:
            with np.load(path, allow_pickle=False) as archive:
                stored = np.asarray(archive[CALLS], dtype=np.float64)
            calls, at = [], 0
            while at < len(stored):
                size = 2 + 3 * len(self._rates[int(stored[at])])
                calls.append(stored[at : at + size].copy())
                at += size
            if at != len(stored):
                raise ValueError(CALLS)
        except DAMAGE as error:
            remedy = "it is damaged or of another version; remove it and run again"
            raise bad_value("state", str(path), remedy) from error
        for call in calls:
            self._repeat(call)
        self._calls = calls

    def _repeat(self, call: Array) -> None:
        controller, time = self._controllers[int(call[0])], float(call[1])
        position, rate, given = np.split(call[2:].copy(), 3)
        if not np.array_equal(controller.torques(time, position, rate), given):
            name = getattr(controller.function, "__name__", type(controller.function).__name__)
            remedy = f"at {time:g} s it gives other numbers than before the interruption"
            raise bad_value("Controller.function", name, f"{remedy}; run again with --force (force=True)")
