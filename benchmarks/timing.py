"""Owns how a time is taken: repeats that last long enough, the device waited for, and their median."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import warp as wp

from warp_mca.system.threads import Pool, Program


@dataclass(frozen=True)
class Care:
    """How long a timing lasts at least, `seconds`, and how many `repeats` the median is of."""

    seconds: float = 0.2
    repeats: int = 5


QUICK = Care(0.02, 3)


Call = Callable[[], None]


def clock(device: str) -> Callable[[], float]:
    """Wall time on a GPU; on the CPU processor time of this process, which others on the machine cannot lengthen.

    Processor time is that of all threads: where a solver runs several, take wall time on a machine of one's own.
    """
    return time.perf_counter if wp.get_device(device).is_cuda else time.process_time


def seconds_per_call(call: Call, device: str, care: Care, reset: Call | None = None) -> float:
    """Median time of a call [s], of calls that follow each other until `care.seconds` are over."""
    count = _enough(call, device, care, reset)
    return statistics.median(_timed(call, count, device, reset) for _ in range(care.repeats)) / count


def ratio(one: tuple[Call, Call], other: tuple[Call, Call], device: str, care: Care) -> float:
    """Median ratio of the times of two calls, taken in turns; each comes with its reset."""
    counts = [_enough(call, device, care, reset) for call, reset in (one, other)]
    found = []
    for _ in range(care.repeats):
        spent = [_timed(call, n, device, reset) / n for (call, reset), n in zip((one, other), counts, strict=True)]
        found.append(spent[0] / spent[1])
    return statistics.median(found)


def _enough(call: Call, device: str, care: Care, reset: Call | None) -> int:
    """How many calls take `care.seconds`."""
    call()
    wp.synchronize_device(device)
    count = 1
    while True:
        spent = _timed(call, count, device, reset)
        if spent > 0.25 * care.seconds:
            return max(1, math.ceil(count * 1.1 * care.seconds / spent))
        count = count * 4 if spent < 0.02 * care.seconds else round(count * 0.5 * care.seconds / spent) + 1


def _timed(call: Callable[[], None], count: int, device: str, reset: Callable[[], None] | None) -> float:
    if reset:
        reset()
    wp.synchronize_device(device)
    now = clock(device)
    begun = now()
    for _ in range(count):
        call()
    wp.synchronize_device(device)
    return now() - begun


def captured(body: Callable[[], None], count: int, device: str) -> Callable[[], None]:
    """A graph of `count` times what `body` launches, as a call."""
    with wp.ScopedDevice(device):
        body()  # loads what capture must find ready
        if not wp.get_device().is_cuda:
            program, pool = Program(1, lambda split: body()), Pool(1)
            return lambda: pool.run(program, count)
        with wp.ScopedCapture() as capture:
            for _ in range(count):
                body()
    graph: Any = capture.graph
    return lambda: wp.capture_launch(graph)


def steps_per_graph(seconds: float, care: Care) -> int:
    """Steps of a graph whose one step takes `seconds`: as many as a run between two searches, fewer if slow."""
    return max(1, min(20, round(0.25 * care.seconds / max(seconds, 1e-9))))
