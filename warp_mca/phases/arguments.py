"""Owns the arguments that runs and batches share: what they may be, progress, and that runs wait for each other."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import wraps
from typing import ParamSpec, TypeVar

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.base.kept import unchanged
from warp_mca.base.progress import progress_bar
from warp_mca.recorders.recorder import Recorder
from warp_mca.scene import Scene

Progress = Callable[[str, float], None]  # stage, share done
RECORDER = ("name", "needs", "cadence", "start", "frame", "history", "finish")  # what a `Recorder` has

P = ParamSpec("P")
T = TypeVar("T")
_RUNNING = threading.RLock()  # Warp captures graphs for the whole process: one run at a time


def one_at_a_time(run: Callable[P, T]) -> Callable[P, T]:
    """`run`, which waits until no other thread is in a function that was made by this; meshes stay as they are."""

    @wraps(run)
    def wait_and_run(*args: P.args, **kwargs: P.kwargs) -> T:
        with _RUNNING, unchanged():
            return run(*args, **kwargs)

    return wait_and_run


def shows_progress(run: Callable[P, T]) -> Callable[P, T]:
    """`run`, whose keyword `progress` may also be True, for a bar or lines, or False for nothing."""

    @wraps(run)
    def run_and_show(*args: P.args, **kwargs: P.kwargs) -> T:
        if kwargs.get("progress") is not True:
            return run(*args, **kwargs)
        with progress_bar() as tell:
            kwargs["progress"] = tell
            return run(*args, **kwargs)

    return run_and_show


def check_scene(field: str, scene: object) -> None:
    """What the user gave as `field` must be a scene.

    Raises:
        RequestError: it is none.
    """
    validate.kind_of(field, scene, Scene, "give a warp_mca.Scene; mca.make_scene(NAME) makes one by its name")


def teller(progress: Progress | bool | None) -> Progress:
    """What is told of stages: `progress`, or nothing.

    Raises:
        RequestError: it cannot be called.
    """
    if progress is None or progress is False:
        return lambda stage, done: None
    if not callable(progress):
        raise bad_value("progress", validate.brief(progress), "give a function progress(stage, done), or leave it out")
    return progress


def span_of(scene: Scene, duration: float | None) -> float:
    """The duration [s] of the impact phase: `duration`, or the scene's own if None.

    Raises:
        RequestError: it is no time that a run can have.
    """
    span = scene.impact.duration if duration is None else duration
    if not validate.is_time(span):
        raise bad_value("duration", validate.brief(span), validate.TIME)
    return float(span)


def check_recorders(recorders: Sequence[Recorder]) -> None:
    """What the user gave as recorders must be a list of them, made and not their classes.

    Raises:
        RequestError: it is none.
    """
    remedy = "give a list of recorders, as mca.run(scene, recorders=[RerunStream(FILE)]), or leave it out"
    validate.kind_of("recorders", recorders, (tuple, list), remedy)
    for k, item in enumerate(recorders):
        missing = [name for name in RECORDER if not hasattr(item, name)]
        if isinstance(item, type) or missing:
            remedy = "give a recorder, as RerunStream(FILE)"
            if not isinstance(item, type) and len(missing) < len(RECORDER):
                remedy += f"; this has no {', '.join(missing)}"
            raise bad_value(f"recorders[{k}]", validate.brief(item), remedy)
