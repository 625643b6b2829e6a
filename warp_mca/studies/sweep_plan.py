"""Owns what a sweep is: its grid, how its runs are carried out, which of them run in one model, what identifies it."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.geometry import Cad, MeshFile
from warp_mca.geometry.mesh import Mesh
from warp_mca.scene import Contact, ContactAll, Controller, RigidPlane, Scene
from warp_mca.scene.materials import Elastic

if TYPE_CHECKING:
    from warp_mca.phases.rate_groups import MultiRate
    from warp_mca.scene import Body, Contact

ALIKE = 0.1  # by which lengths and angles of meshes in a batch differ: its step is the least that one of them needs
# Elements of a batch on a GPU: each batch takes half a second besides, and a GPU without one waits for another's end.
FULL = 250_000

_Group = tuple[list[float], list[int]]  # sizes of the first scene, numbers of all


@dataclass(frozen=True)
class RunOptions:
    """How each run of a sweep is carried out.

    Attributes:
        device: "cpu", a CUDA device as "cuda:0", or "cuda" for all of the machine.
        precision, threads, multi_rate, duration: as in `warp_mca.run`.
    """

    device: str = "cpu"
    precision: str = "mixed"
    threads: int | None = None
    multi_rate: MultiRate = None
    duration: float | None = None


@dataclass(frozen=True)
class Plan:
    """A sweep, before anything of it is run.

    Attributes:
        scenes: one for each run.
        parameters: what is listed of each run beside its figures: the values that its scene was made from.
        options: how each is run.
        model: model file that has the meshes of the scenes, or None.
        out: folder of the table, or None.
        folders: whether each run's files are kept in a folder of its own in `out`.
        batch: number of runs at most that are computed in one model; None for as many as fill a GPU, one on a CPU.
    """

    scenes: tuple[Scene, ...]
    parameters: tuple[Mapping[str, object], ...]
    options: RunOptions
    model: Path | None = None
    out: Path | None = None
    folders: bool = False
    batch: int | None = None

    def identity(self) -> dict[str, object]:
        """What decides the rows, as JSON holds it; a folder goes on with a sweep of equal identity only."""
        digest = hashlib.sha256()
        for scene in self.scenes:
            _feed(digest, scene)
        grid = {key: _distinct(item.get(key) for item in self.parameters) for key in _keys(self.parameters)}
        options = self.options
        return {
            "runs": len(self.scenes),
            "grid": grid,
            "device": options.device.partition(":")[0],
            "precision": options.precision,
            "duration": options.duration,
            "multi_rate": options.multi_rate,
            "batch": self.batch,
            "folders": self.folders,
            "scenes": digest.hexdigest(),
        }

    def run_folder(self, number: int) -> Path | None:
        """The folder of a run's files, numbered so that names sort; None if they are not kept."""
        return self.out / run_name(number, len(self.scenes)) if self.out and self.folders else None


def run_name(number: int, count: int) -> str:
    """Name of the folder for the files of a run, in a sweep of `count` runs."""
    return f"{number:0{len(str(count - 1))}d}"


def parse_grid(option: str, texts: Iterable[str], given: Collection[str] = ()) -> list[dict[str, str]]:
    """Settings of each run, from texts `KEY=VALUE,VALUE,…`: every combination, the last key's values fastest.

    Args:
        option: of the command line that has the texts, for messages.
        texts: as the command line has them.
        given: keys that are set for all runs.

    Raises:
        RequestError: a text is not of that form, or a key occurs twice.
    """
    values: dict[str, list[str]] = {}
    for text in texts:
        key, equals, listed = (part.strip() for part in text.partition("="))
        found = [value.strip() for value in listed.split(",")]
        if not (key and equals and all(found)):
            raise bad_value(option, text, "write it as KEY=VALUE,VALUE,… without spaces")
        if key in given:
            raise bad_value(option, text, f"{key} is set for all scenes as well; leave one of the two out")
        if key in values:
            raise bad_value(option, text, f"list all values of {key} at once")
        values[key] = found
    return [dict(zip(values, chosen, strict=True)) for chosen in itertools.product(*values.values())]


def differing(scenes: Sequence[Scene]) -> tuple[dict[str, object], ...]:
    """Of each scene, the parameters that are not the same in all of them."""
    keys = _keys([scene.parameters for scene in scenes])
    changed = [key for key in keys if len(_distinct(scene.parameters.get(key) for scene in scenes)) > 1]
    return tuple({key: plain(scene.parameters.get(key)) for key in changed} for scene in scenes)


def batches(plan: Plan, meshes: Mapping[str, Mesh] | None = None) -> list[list[int]]:
    """Numbers of the runs that are computed in one model, in the order in which they begin.

    They depend on the sweep alone, never on what is left of it or on the number of workers: scenes of a batch share
    their time step, and so rows of a sweep that was interrupted equal those of one that was not. Scenes of a batch have
    as many cells, lengths within `ALIKE`, the same stiffness and density, and so nearly the same step by themselves.

    Args:
        plan: of the sweep.
        meshes: finished meshes by body, of all its scenes, or None.
    """
    kinds: dict[object, list[_Group]] = {}
    for k, scene in enumerate(plan.scenes):
        sizes: list[float] = []
        groups = kinds.setdefault(_step_key(scene, plan.options, k, sizes), [])
        near = (numbers for first, numbers in groups if _alike(first, sizes))
        if (group := next(near, None)) is not None:
            group.append(k)
        else:
            groups.append((sizes, [k]))
    found = []
    for _, group in itertools.chain(*kinds.values()):
        limit = plan.batch or _limit(plan.scenes[group[0]], plan.options.device, meshes)
        count = -(-len(group) // limit)
        ends = [len(group) * k // count for k in range(count + 1)]
        found += [group[start:end] for start, end in itertools.pairwise(ends)]
    return sorted(found)


def _limit(scene: Scene, device: str, meshes: Mapping[str, Mesh] | None) -> int:
    """How many scenes like this one are run at once; one on a CPU, which a single scene keeps busy."""
    from warp_mca.phases.meshing import mesh

    if device == "cpu":
        return 1
    try:
        meshed = mesh(scene, given=meshes)
    except RequestError:  # the run itself will say why
        return 1
    return max(1, FULL // sum(item.cell_count for item in meshed.values()))


def _alike(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether lengths and angles of recipes are, so that their cells are nearly as large."""
    pairs = zip(one, other, strict=True)
    return all(a == b or abs(a - b) <= ALIKE * max(abs(a), abs(b)) for a, b in pairs)


def _without_sizes(value: object, sizes: list[float]) -> object:
    """What a recipe has beside its floating-point numbers, which are added to `sizes`."""
    if isinstance(value, float):
        sizes.append(value)
        return float
    if isinstance(value, tuple | list):
        return [_without_sizes(part, sizes) for part in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type | Cad | MeshFile | Mesh):
        fields = [(f.name, getattr(value, f.name)) for f in dataclasses.fields(value)]
        return type(value), [(name, _without_sizes(part, sizes)) for name, part in fields]
    return value


def _step_key(scene: Scene, options: RunOptions, number: int, sizes: list[float]) -> object:
    """Equal for scenes that may share a batch if the `sizes` of their recipes, which are added, are alike.

    They have one duration, nearly one step, and contacts of one kind.
    """
    whole = [(joint.name, found) for joint in scene.acting_joints if (found := joint.whole())]
    asked = any(isinstance(freedom.motor, Controller) for _, joint in whole for freedom in joint.freedoms)
    if scene.t_end is not None or options.multi_rate is not None or asked:
        return number
    impact = scene.impact
    span = impact.duration if options.duration is None else options.duration
    digest = hashlib.sha256()
    for body in scene.bodies:
        key = (
            body.name,
            _without_sizes(body.geometry, sizes),
            _elastic(body),
            body.element,
            body.kinematics,
            body.rigid,
            body.exact_mass,
        )
        _feed(digest, (*key, body.across, body.mass, body.centre, body.inertia))
    _feed(digest, whole)
    for contact in scene.contacts:
        _feed(digest, _contact_key(contact))
    _feed(digest, (scene.refine, impact.time_step_scale, impact.mass_scaling))
    # computed from other parameters, equal times differ by rounding
    return f"{span:.9e}", f"{impact.output_interval:.9e}", digest.hexdigest()


def _elastic(body: Body) -> object:
    """What the material has to do with the stable step: stiffness and density, not strength."""
    materials = body.material.values() if isinstance(body.material, Mapping) else (body.material,)
    return [
        (item.bulk_modulus, item.shear_modulus, item.rho) if isinstance(item, Elastic) else item for item in materials
    ]


def _contact_key(contact: Contact | ContactAll) -> object:
    laws = [type(law).__name__ for law in (contact.law, *contact.friction_laws)]
    if isinstance(contact, ContactAll):
        return contact.exclude, contact.self_contact, laws, contact.penalty
    return isinstance(contact.master, RigidPlane), contact.two_way, laws, contact.penalty


def _keys(mappings: Iterable[Mapping[str, object]]) -> list[str]:
    """Keys of all mappings, in the order in which they occur."""
    return list(dict.fromkeys(key for item in mappings for key in item))


def plain(value: object) -> str | bool | int | float | None:
    """The value as the table has it: a number, True or False, None, or else a text of one line."""
    if isinstance(value, np.generic):
        value = value.item()
    return value if value is None or isinstance(value, bool | int | float) else one_line(str(value))


def one_line(text: str) -> str:
    """The text without line breaks."""
    return " ".join(text.split())


def _distinct(values: Iterable[object]) -> list[object]:
    """Values that differ, in the order in which they occur, as the table has them."""
    return list({(type(value), value): value for value in map(plain, values)}.values())


def _content(path: Path) -> bytes:
    """Digest of a file; empty where there is none, of which a run tells."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError:
        return b""


def _feed(digest: hashlib._Hash, value: object) -> None:
    """Add a value to a digest: dataclasses by their fields, arrays by their bytes, others by their attributes.

    A mesh or CAD file counts by what it holds, too.
    """
    if isinstance(value, Cad | MeshFile):
        digest.update(_content(Path(value.path)))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts: Iterable[object] = (part for f in dataclasses.fields(value) for part in (f.name, getattr(value, f.name)))
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
        return
    elif isinstance(value, Mapping):
        parts = (part for item in value.items() for part in item)
    elif isinstance(value, tuple | list):
        parts = value
    elif value is None or isinstance(value, str | bytes | int | float | complex | Path | np.generic):
        digest.update(f"{value!r};".encode())
        return
    elif callable(value):
        digest.update(f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', type(value))};".encode())
        return
    else:
        parts = vars(value).values() if hasattr(value, "__dict__") else (repr(value),)
    digest.update(f"{type(value).__qualname__}(".encode())
    for part in parts:
        _feed(digest, part)
    digest.update(b")")
