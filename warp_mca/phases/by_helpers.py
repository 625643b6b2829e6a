"""Owns what helpers do for the scenes of a batch, or this process in turn: all until the impact, and what is told."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace

from warp_mca.base.errors import RequestError
from warp_mca.base.helpers import Helpers, travel
from warp_mca.base.kept import unchanged
from warp_mca.base.outside import registered
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.meshing import made_of
from warp_mca.phases.prepare import Prepared, Request, prepare
from warp_mca.phases.settings import Settings
from warp_mca.scene import Scene
from warp_mca.watch.passing import skins_of
from warp_mca.watch.row import Finished
from warp_mca.watch.table import told_at_the_end

MOST_CELLS = 200_000  # of a scene for a helper: larger ones fill memory, and a batch has few of them
STARTING = 3.0  # least work left for which helpers are started; they take a second to begin [s]
SENDING = 0.3  # the same where they are there [s]
MANY = 64  # scenes whose work is more than that, so that helpers begin with the first
HELPERS = Helpers(__name__)

Wall = dict[str, float]  # seconds by stage
Answer = tuple[Prepared, Wall]


def prepared(scenes: Sequence[Scene], meshes: Sequence[Mapping[str, Mesh]] | None, request: Request) -> list[Prepared]:
    """Every scene at the start of its impact phase: the same, bit by bit, whoever computes it.

    Args:
        scenes: those of a batch, or a lone one.
        meshes: finished meshes by body of each scene, or None.
        request: how they are run; where it has more than two threads, as many helpers may do it.

    Raises:
        RequestError: one cannot be built as written; names the first.
    """
    made: dict[object, Mesh] = {}
    ready: list[Prepared] = []
    if len(scenes) >= MANY and _may_help(request.settings, meshes):
        HELPERS.begin(request.settings.threads)

    def here(k: int) -> Prepared:
        own = replace(request, tell=lambda stage, _: request.tell(stage, k / len(scenes)))
        try:
            return prepare(scenes[k], None if meshes is None else meshes[k], own, made)
        except RequestError as error:
            if len(scenes) == 1:
                raise
            raise RequestError(f"scenes[{k}]: {error}") from error

    for k in range(len(scenes)):
        begun = time.perf_counter()
        ready.append(here(k))
        if k == 1 and _worth_it(ready, (time.perf_counter() - begun) * (len(scenes) - 2), request.settings, meshes):
            return [*ready, *_by_helpers(scenes[2:], made, request, lambda k: here(k + 2))]
    return ready


def _worth_it(ready: Sequence[Prepared], left: float, settings: Settings, meshes: object) -> bool:
    """Whether helpers end sooner with work that takes this process so long [s]."""
    if not _may_help(settings, meshes):
        return False
    small = all(sum(item.cell_count for item in own.meshes.values()) <= MOST_CELLS for own in ready)
    return small and left > (SENDING if HELPERS.count >= settings.threads else STARTING)


def _may_help(settings: Settings, meshes: object) -> bool:
    """Whether there are cores for helpers, and they know all that a run may have."""
    return settings.threads > 2 and meshes is None and not registered()


def _by_helpers(
    scenes: Sequence[Scene], made: Mapping[object, Mesh], request: Request, here: Callable[[int], Prepared]
) -> list[Prepared]:
    """Scenes, prepared by helpers where they know all classes of it, or `here`."""
    pickled = _pickled(scenes)
    if not pickled:
        return [here(k) for k in range(len(scenes))]
    wall: Wall = {}

    def data(k: int) -> bytes:
        return pickle.dumps((pickled[k], made_of(scenes[k], made), request.span, request.settings), protocol=5)

    def told(k: int, answer: Answer) -> None:
        ready, own = answer
        if own:
            request.begun(scenes[k], ready.model, ready.meshes)
            request.tell("mesh", (k + 2) / (len(scenes) + 2))
            wall.update({stage: wall.get(stage, 0.0) + took for stage, took in own.items()})

    answers = HELPERS.carry_out(prepare_one, len(scenes), data, lambda k: (here(k), {}), request.settings.threads, told)
    if any(wall.values()):
        request.clock.share(wall)
    return [replace(ready, scene=scene) for (ready, _), scene in zip(answers, scenes, strict=True)]


def _pickled(scenes: Sequence[Scene]) -> list[bytes]:
    """Scenes for helpers; none where they do not know all classes of them."""
    try:
        found = [pickle.dumps(scene, protocol=pickle.HIGHEST_PROTOCOL) for scene in scenes]
    except Exception:  # what functions and classes of the user's own raise
        return []
    return found if all(map(travel, found)) else []


def prepare_one(scene: bytes, made: dict[object, Mesh], span: float, settings: Settings) -> Answer:
    """What a helper does: a pickled scene at the start of its impact phase, and wall time by stage [s]."""
    request = Request(span=span, settings=settings)
    with unchanged():
        ready = prepare(pickle.loads(scene), None, request, made)
        return replace(ready, skins=skins_of(ready.scene, ready.meshes, ready.model)), request.clock.wall


def told(finished: Sequence[Finished], before: Sequence[Sequence[str]], threads: int) -> list[tuple[str, ...]]:
    """What each scene of a batch says of itself, as `told_at_the_end`, by helpers where they are there.

    Args:
        finished: the scenes.
        before: what was told of each before.
        threads: of the run.
    """

    def here(k: int) -> tuple[str, ...]:
        return told_at_the_end(finished[k], before[k])

    wanted = len(finished) > threads > 2 and HELPERS.count >= threads and not registered()
    if not wanted or not _pickled([item.scene for item in finished]):
        return [here(k) for k in range(len(finished))]

    def data(k: int) -> bytes:
        return pickle.dumps((_to_tell(finished[k]), before[k]), protocol=5)

    return HELPERS.carry_out(tell_one, len(finished), data, here, threads)


def _to_tell(finished: Finished) -> Finished:
    """A scene without the rows of which nothing is told: they are most of its bytes."""
    ledger = copy(finished.ledger)
    ledger.kept = replace(ledger.kept, path_stress=[], sensors=[])
    return replace(finished, ledger=ledger)


def tell_one(finished: Finished, before: Sequence[str]) -> tuple[str, ...]:
    """What a helper does: all that a scene says of itself."""
    with unchanged():
        return told_at_the_end(finished, before)
