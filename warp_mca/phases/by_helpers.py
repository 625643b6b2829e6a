"""Owns what helpers do for the scenes of a batch, or this process in turn: all until the impact, and what is told."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import count

from warp_mca.base.errors import RequestError
from warp_mca.base.helpers import Helper, Helpers, travel
from warp_mca.base.kept import unchanged
from warp_mca.base.outside import registered
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.meshing import Shared
from warp_mca.phases.prepare import Prepared, Request, prepare
from warp_mca.phases.settings import Settings
from warp_mca.phases.stress_rows import Room
from warp_mca.scene import Scene
from warp_mca.watch.held import MOST_CELLS as MOST_HELD
from warp_mca.watch.held import Home, Question, hold, looked_at, parted, tell
from warp_mca.watch.mass_report import body_report
from warp_mca.watch.passing import skins_of
from warp_mca.watch.row import Context, Finished
from warp_mca.watch.table import told_at_the_end

MOST_CELLS = 200_000  # of a scene for a helper: larger ones fill memory, and a batch has few of them
STARTING = 3.0  # least work left for which helpers are started; they take a second to begin [s]
SENDING = 0.3  # the same where they are there [s]
MANY = 64  # scenes whose work is more than that, so that helpers begin with the first
HELPERS = Helpers(__name__)
_BATCHES = count()  # numbers of those that helpers hold

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
    room: Room | None = None
    helped = _may_help(request.settings, meshes)
    if helped:
        begin_for(len(scenes), request.settings.threads)

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
        if k == 0 and helped and request.paths and len(scenes) >= MANY:
            rows = round(request.span / scenes[0].impact.output_interval) + 1
            room = Room(len(scenes), rows, len(ready[0].probes.corner))
        if k == 1 and _worth_it(ready, (time.perf_counter() - begun) * (len(scenes) - 2), request.settings, meshes):
            ready += _by_helpers(scenes[2:], Shared(scenes[:2], made), request, lambda k: here(k + 2))
            break
    return [replace(item, room=room) for item in ready] if room else ready


def begin_for(scenes: int, threads: int) -> None:
    """Begin helpers for the threads of a run, if so many scenes are to come that they are worth their start."""
    if scenes >= MANY and threads > 2:
        HELPERS.begin(threads)


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
    scenes: Sequence[Scene], shared: Shared, request: Request, here: Callable[[int], Prepared]
) -> list[Prepared]:
    """Scenes, prepared by helpers where they know all classes of it, or `here`."""
    pickled = _pickled(scenes)
    if not pickled:
        return [here(k) for k in range(len(scenes))]
    wall: Wall = {}
    batch = next(_BATCHES)

    def data(k: int) -> bytes:
        own = (pickled[k], shared.of(scenes[k]), request.span, request.settings, (batch, k), MOST_HELD)
        return pickle.dumps(own, protocol=5)

    def told(k: int, answer: Answer) -> None:
        ready, own = answer
        if own:
            request.begun(scenes[k], ready.model, ready.meshes)
            request.tell("mesh", (k + 2) / (len(scenes) + 2))
            wall.update({stage: wall.get(stage, 0.0) + took for stage, took in own.items()})

    answers = HELPERS.carry_out(prepare_one, len(scenes), data, lambda k: (here(k), {}), request.settings.threads, told)
    if any(wall.values()):
        request.clock.share(wall)
    found = [replace(ready, scene=scene) for (ready, _), scene in zip(answers, scenes, strict=True)]
    for k, helper in HELPERS.by.items():
        if home := found[k].home:
            found[k] = replace(found[k], home=replace(home, helper=helper))
    return found


def _pickled(scenes: Sequence[Scene]) -> list[bytes]:
    """Scenes for helpers; none where they do not know all classes of them."""
    try:
        found = [pickle.dumps(scene, protocol=pickle.HIGHEST_PROTOCOL) for scene in scenes]
    except Exception:  # what functions and classes of the user's own raise
        return []
    return found if all(map(travel, found)) else []


def prepare_one(
    scene: bytes,
    made: dict[object, Mesh],
    span: float,
    settings: Settings,
    home: tuple[int, int] = (0, 0),
    most: int = 0,
) -> Answer:
    """What a helper does: a pickled scene at the start of its impact phase, and wall time by stage [s].

    It holds one of no more elements than `most`, where `home` says: number of the batch, and of the scene in it.
    """
    request = Request(span=span, settings=settings)
    with unchanged():
        ready = prepare(pickle.loads(scene), None, request, made)
        if ready.model.element_count <= most:
            own = Context(scene=ready.scene, meshes=ready.meshes, model=ready.model)
            ready = replace(ready, masses=body_report(ready.scene.bodies, ready.meshes, ready.scene.masses))
            return replace(ready, home=hold(*home, own, ready.start)), request.clock.wall
        return replace(ready, skins=skins_of(ready.scene, ready.meshes, ready.model)), request.clock.wall


class Telling:
    """What scenes of a batch say of themselves, as `told_at_the_end`, by helpers where they are there.

    Attributes:
        order: numbers of the scenes, those that one helper holds after each other, so that it begins with them while
            this process computes what comes of the next.
    """

    def __init__(self, before: Sequence[Sequence[str]], homes: Sequence[Home | None], threads: int) -> None:
        """What was told of each scene before, where helpers hold them, and threads of the run."""
        self._before, self._homes, self._threads = before, homes, threads
        self._left: dict[Helper | None, list[int]] = {}
        for k, home in enumerate(homes):
            self._left.setdefault(home.helper if home else None, []).append(k)
        last = self._left.pop(None, [])
        self.order = [k for own in self._left.values() for k in own] + last
        self._finished: dict[int, Finished] = {}
        self._asked: list[tuple[list[int], Question]] = []

    def take(self, k: int, finished: Finished) -> None:
        """Take a scene, and ask its helper if it was the last of those there."""
        self._finished[k], home = finished, self._homes[k]
        if not home:
            return
        own = self._left[home.helper]
        if own[-1] == k:
            parts = [(parted(self._finished[i]), self._before[i]) for i in own]
            self._asked.append((own, Question(tell, [item for i in own if (item := self._homes[i])], parts)))

    def told(self) -> list[tuple[str, ...]]:
        """Of all scenes, which were taken."""
        if not self._asked:
            return self._by_any()
        found = {k: self._here(k) for k, home in enumerate(self._homes) if not home}
        for own, question in self._asked:
            found |= {k: answer for k, answer in zip(own, question.answers(), strict=True) if answer is not None}
        return [found[k] if k in found else self._here(k) for k in range(len(self._homes))]

    def _here(self, k: int) -> tuple[str, ...]:
        own = self._finished[k]
        return told_at_the_end(looked_at(own) if self._homes[k] else own, self._before[k])

    def _by_any(self) -> list[tuple[str, ...]]:
        """By helpers that hold none, or this process in turn."""
        finished = [self._finished[k] for k in range(len(self._homes))]
        wanted = len(finished) > self._threads > 2 and HELPERS.count >= self._threads and not registered()
        if not wanted or not _pickled([item.scene for item in finished]):
            return [self._here(k) for k in range(len(finished))]

        def data(k: int) -> bytes:
            return pickle.dumps((parted(finished[k], at_home=False), self._before[k]), protocol=5)

        return HELPERS.carry_out(tell_one, len(finished), data, self._here, self._threads)


def tell_one(finished: Finished, before: Sequence[str]) -> tuple[str, ...]:
    """What a helper does: all that a scene says of itself."""
    with unchanged():
        return told_at_the_end(finished, before)
