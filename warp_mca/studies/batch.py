"""Owns batches: independent scenes side by side in one model, so that small ones fill a device."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from warp_mca.base import validate
from warp_mca.base.errors import McaError, bad_value
from warp_mca.base.folder import held
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.arguments import Progress, check_scene, one_at_a_time, shows_progress, span_of, teller
from warp_mca.phases.prepare import Request
from warp_mca.phases.settings import settings_of
from warp_mca.phases.simulate import simulate
from warp_mca.results.criteria import with_verdict
from warp_mca.results.result import Result
from warp_mca.results.storage import ALL_FILES, check_output, folder_path, save
from warp_mca.scene import Contact, ContactAll, Scene
from warp_mca.scene.options import with_options

Meshes = Mapping[str, Mesh]


@one_at_a_time
@shows_progress
def run_batch(
    scenes: Iterable[Scene],
    *,
    device: str = "cpu",
    precision: str = "mixed",
    threads: int | None = None,
    duration: float | None = None,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    refine: float | None = None,
    mass_scaling: float | str | None = None,
    meshes: Sequence[Meshes] | None = None,
    progress: Progress | bool | None = None,
) -> list[Result]:
    """Run independent scenes at once, each with its own parameters: their elements share every launch.

    The scenes take the same steps: the smallest that one of them needs, so that the result of each is that of the scene
    alone with this step. They must have the same duration and output interval, and contacts of the same kinds, in the
    same order; all else may differ. Parts that scenes have in common are meshed once. Runs of several threads wait for
    each other.

    Args:
        scenes: what to run.
        device, precision, threads, force: as in `warp_mca.run`.
        duration: of the impact phase [s]; the scenes' own if None.
        out: folder that gets a folder for each scene, named by its number from 0, with the files of `warp_mca.run`;
            with `force`, results of a larger batch before it are removed.
        refine, mass_scaling: as in `warp_mca.run`, for all scenes.
        meshes: finished meshes by body, for each scene, to save making them again.
        progress: called with a stage and the share of it that is done; True shows a bar, or lines if piped.

    Returns:
        The result of each scene. Where a guard stopped one, `Result.stopped` says so, its rows end there, and nothing
        of it is written; the others go on. Wall times are those of the batch.

    Raises:
        RequestError: the request cannot be carried out; nothing was written.
    """
    if isinstance(scenes, str) or not isinstance(scenes, Iterable):
        raise bad_value("scenes", validate.brief(scenes), "give a list of scenes; mca.run runs a single one")
    scenes = list(scenes)
    tell = teller(progress)
    span = check_alike(scenes, duration)
    scenes = [with_options(scene, refine, mass_scaling, meshes) for scene in scenes]
    settings = settings_of(device, precision, threads)
    _check_meshes(meshes, len(scenes))
    with hold_scenes(out, len(scenes), force) as folders:
        return save_scenes(judged(scenes, meshes, Request(span=span, settings=settings, tell=tell)), folders, force)


@one_at_a_time
def judged(scenes: Sequence[Scene], meshes: Sequence[Meshes] | None, request: Request) -> list[Result]:
    """The result of each scene, held to its criteria; arguments and errors as in `simulate`."""
    found = simulate(scenes, meshes, request)
    return [with_verdict(result, scene.criteria) for result, scene in zip(found, scenes, strict=True)]


def _check_meshes(meshes: object, count: int) -> None:
    """Refuse meshes that are not a list with an entry for each of the scenes.

    Raises:
        RequestError: so it is.
    """
    if meshes is None:
        return
    validate.kind_of("meshes", meshes, (tuple, list), "give a list with the meshes by body of each scene")
    assert isinstance(meshes, Sequence)
    if len(meshes) != count:
        raise bad_value("number of meshes", len(meshes), f"give the meshes of each of the {count} scenes")


def save_scenes(results: Sequence[Result], folders: Sequence[Path | None], force: bool) -> list[Result]:
    """Results, those that no guard stopped written to the folders of `hold_scenes`.

    With `force`, old files go: those of scenes that were stopped now, and of a larger batch's other scenes.

    Raises:
        McaError: as in `save`; or old files cannot be removed.
    """
    written = {folder for folder, result in zip(folders, results, strict=True) if folder and not result.stopped}
    if force:
        own = {folder for folder in folders if folder}
        beside = {path for out in {folder.parent for folder in own} for path in out.glob("[0-9]*")}
        _remove(own - written)
        _remove(path for path in beside - own if _of_batch(path))
    return [
        save(result, folder, force=force) if folder in written else result
        for result, folder in zip(results, folders, strict=True)
    ]


def _of_batch(folder: Path) -> bool:
    """Whether it holds a scene of a batch, under the number that it had there."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        return summary["batch"]["scene"] == int(folder.name)
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return False


def _remove(folders: Iterable[Path]) -> None:
    """Remove the files of results from folders, and these if nothing else is in them."""
    for folder in folders:
        try:
            for name in ALL_FILES:
                (folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise McaError(f"old results in {folder} could not be removed: {error.strerror or error}") from error
        with suppress(OSError):  # it is not there, or other files are in it
            folder.rmdir()


def check_alike(scenes: Sequence[Scene], duration: float | None = None) -> float:
    """The duration [s] of scenes that one batch can run.

    Raises:
        RequestError: there is none, or what the scenes must share differs.
    """
    if not scenes:
        raise bad_value("scenes", [], "give at least one scene")
    for k, scene in enumerate(scenes):
        check_scene(f"scenes[{k}]", scene)
        if scene.t_end is not None:
            remedy = "the scenes of a batch step together, for one impact each; leave t_end out, or use mca.run"
            raise bad_value(f"scenes[{k}].t_end", scene.t_end, remedy)
        if scene.phases:
            remedy = "the scenes of a batch begin together with the impact; leave phases out, or use mca.run"
            raise bad_value(f"scenes[{k}].phases", scene.phases, remedy)
    first = scenes[0]
    span = span_of(first, duration)
    for k, scene in enumerate(scenes[1:], 1):
        for name in ("duration", "output_interval"):
            value, wanted = getattr(scene.impact, name), getattr(first.impact, name)
            alike = math.isclose(value, wanted, rel_tol=1e-9)  # computed from other parameters, they differ by rounding
            if not alike and not (name == "duration" and duration is not None):
                remedy = f"the batch takes its steps together and scenes[0] has {wanted:g}; give all scenes the same"
                raise bad_value(f"scenes[{k}].impact.{name}", value, remedy)
        if len(scene.contacts) != len(first.contacts):
            remedy = f"scenes[0] has {len(first.contacts)}; batch scenes with as many contacts"
            raise bad_value(f"number of scenes[{k}].contacts", len(scene.contacts), remedy)
        for i, (contact, wanted) in enumerate(zip(scene.contacts, first.contacts, strict=True)):
            for name, value in _kinds(contact).items():
                other = _kinds(wanted)[name]
                if value != other:
                    remedy = f"that of scenes[0] is {other}; batch scenes with contacts of the same kinds"
                    raise bad_value(f"scenes[{k}].contacts[{i}].{name}", value, remedy)
    return span


def _kinds(contact: Contact | ContactAll) -> dict[str, object]:
    """What contacts must have in common, by the name of the field."""
    return {
        "master": "of ContactAll" if isinstance(contact, ContactAll) else type(contact.master).__name__,
        "two_way": contact.two_way,
        "law": type(contact.law).__name__,
        "friction_laws": ", ".join(type(law).__name__ for law in contact.friction_laws) or "mu alone",
    }


@contextmanager
def hold_scenes(out: str | os.PathLike[str] | None, count: int, force: bool) -> Iterator[list[Path | None]]:
    """A folder for each scene, numbered so that names sort, in the folder `out` that is held meanwhile.

    Raises:
        RequestError: as in `check_output`; or another run holds `out`.
    """
    if out is None:
        yield [None] * count
        return
    path, digits = folder_path("out", out), len(str(count - 1))
    folders: list[Path | None] = [check_output(path / f"{k:0{digits}d}", force=force) for k in range(count)]
    with held(path):
        yield folders
