"""Owns how a time is taken: repeats that last long enough, the device waited for, and their median."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import warp as wp


@dataclass(frozen=True)
class Care:
    """How long a timing lasts at least, `seconds`, and how many `repeats` the median is of."""

    seconds: float = 0.2
    repeats: int = 5


QUICK = Care(0.02, 3)


def seconds_per_call(
    call: Callable[[], None], device: str, care: Care, reset: Callable[[], None] | None = None
) -> float:
    """Median time of a call [s], of calls that follow each other until `care.seconds` are over."""
    call()
    wp.synchronize_device(device)
    count, spent = 1, 0.0
    while True:
        spent = _timed(call, count, device, reset)
        if spent > 0.25 * care.seconds:
            break
        count = count * 4 if spent < 0.02 * care.seconds else round(count * 0.5 * care.seconds / spent) + 1
    count = max(1, round(count * 1.1 * care.seconds / spent))
    return statistics.median(_timed(call, count, device, reset) for _ in range(care.repeats)) / count


def _timed(call: Callable[[], None], count: int, device: str, reset: Callable[[], None] | None) -> float:
    if reset:
        reset()
    wp.synchronize_device(device)
    begun = time.perf_counter()
    for _ in range(count):
        call()
    wp.synchronize_device(device)
    return time.perf_counter() - begun


def captured(body: Callable[[], None], count: int, device: str) -> Callable[[], None]:
    """A graph of `count` times what `body` launches, as a call."""
    with wp.ScopedDevice(device):
        body()  # loads what capture must find ready
        with wp.ScopedCapture() as capture:
            for _ in range(count):
                body()
    return lambda: wp.capture_launch(capture.graph)


def steps_per_graph(seconds: float, care: Care, multiple: int = 1) -> int:
    """Steps of a graph whose one step takes `seconds`: as many as a run between two searches, fewer if slow."""
    return max(1, min(20, round(0.25 * care.seconds / max(seconds, 1e-9)))) if multiple == 1 else multiple
