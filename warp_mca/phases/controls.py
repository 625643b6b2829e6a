"""Owns what asks the functions that drive freedoms of joints, at the beginning of output intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Index
from warp_mca.scene import Controller, Scene

if TYPE_CHECKING:
    from warp_mca.system.state import State


class Controls:
    """Controllers of a scene, and the rates of joints that each drives."""

    def __init__(self, scene: Scene, state: State) -> None:
        """None are asked of a scene without."""
        self._state, self._interval = state, scene.impact.output_interval
        rates: dict[int, list[int]] = {}
        self._controllers: dict[int, Controller] = {}
        first = 0
        for whole in filter(None, (joint.whole() for joint in scene.acting_joints)):
            for freedom in whole.freedoms:
                if isinstance(freedom.motor, Controller):
                    self._controllers[id(freedom.motor)] = freedom.motor
                    rates.setdefault(id(freedom.motor), []).append(first)
                first += freedom.rates
        self._rates: dict[int, Index] = {key: np.array(own, dtype=np.int32) for key, own in rates.items()}

    def ask(self, interval: int, time: float) -> None:
        """Ask those that are due at the beginning of an output interval, which has this number, at a time [s].

        Raises:
            RequestError: a function fails, or gives something else than finite numbers.
        """
        every = {key: max(round(item.period / self._interval), 1) for key, item in self._controllers.items()}
        due = [key for key, count in every.items() if interval % count == 0]
        if not due:
            return
        joints = self._state.rigid.joints
        position, rate, held = (array.numpy().copy() for array in (joints.position, joints.rate, joints.held))
        for key in due:
            own = self._rates[key]
            held[own] = self._controllers[key].torques(time, position[own], rate[own])
        joints.held.assign(held)
