"""Owns `State`: everything that changes while a model is advanced, with unit, shape and dtype of each array.

The model's own arrays never change, and neither the solver nor its stages keep anything from one step to the next. So a
state can be copied, compared, stored and read back on another device, and a run that goes on from it gives the same
bits as one that was never interrupted.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.base.files import write_atomically
from warp_mca.base.validate import DAMAGE, MAX_COUNT
from warp_mca.system.records import SceneRecords

if TYPE_CHECKING:
    from warp_mca.system.model import Model

FORMAT = "warp_mca state 1"


@dataclass(eq=False)
class State:
    """Everything that changes during a phase of finite elements.

    Attributes:
        u: displacement since the start of the phase [m], shape (node_count,), vec3d.
        v: velocity at the latest half step [m/s], shape (node_count,), vec3d.
        speed_square: greatest square of each node's speed, of all nodes for one scene on a GPU [m^2/s^2], shape
            (node_count,) or (1,), float32.
        normal_force: greatest sum of the normal forces of each scene in any step, then sums of the present step, zero
            between steps, in units of `extremes.NormalForce` [-], shape (1 + range_count, column_count), int64.
        recent_force: contact force on each node, of one pass, the greatest of late [N], shape (node_count,), vec3d;
            empty where no master has several sides.
        flag: guards that kernels raised, by scene, `kernels.contact.search.FLAGS` [-], shape (scene_count, 4), int32.
        parts: what changes of each actor, by its name in `step.actors.ACTORS`; attributes of the State, too.
        steps: steps taken since the start of the phase [-].
        scenes: what each scene has recorded so far, `records.SceneRecords`.
    """

    u: wp.array
    v: wp.array
    speed_square: wp.array
    normal_force: wp.array
    recent_force: wp.array
    flag: wp.array
    parts: dict[str, Any]
    steps: int = 0
    scenes: list[SceneRecords] = field(default_factory=list)

    def __getattr__(self, name: str) -> Any:
        """The part of an actor."""
        if name in (parts := self.__dict__.get("parts", {})):
            return parts[name]
        raise AttributeError(name)

    @property
    def _scalar(self) -> str:
        """Type of the numbers that elements compute with; that of all others where there are none."""
        return str(self.elements[0].extreme.dtype.__name__) if self.elements else "float64"

    def arrays(self) -> dict[str, Any]:
        """Device arrays by name, as `elements/0/history`; of `normal_force` what lasts."""
        return {name: a[:1] if name == "normal_force" and len(a) else a for name, a in _arrays(self, "")}

    def copy(self) -> State:
        """A copy on the same device."""
        found = _copied(replace(self, scenes=[]))
        found.scenes = [records.copy() for records in self.scenes]
        return found

    def assign(self, other: State) -> None:
        """Take over all of another state of the same model, which may be on another device."""
        others = other.arrays()
        for name, to in self.arrays().items():
            if to.shape == others[name].shape and to.dtype == others[name].dtype:
                wp.copy(to, others[name])
            else:
                _fill(name, to, others[name].numpy())
        self.steps = other.steps
        self.scenes = [records.copy() for records in other.scenes]

    def differences(self, other: State) -> list[str]:
        """Names of what is not the same bit for bit."""
        mine, others = self.arrays(), other.arrays()
        found = [name for name in mine if not _same(mine[name].numpy(), others[name].numpy())]
        found += ["steps"] if self.steps != other.steps else []
        pairs = zip(self.scenes, other.scenes, strict=True)
        return found + [f"scenes/{k}/{name}" for k, (a, b) in enumerate(pairs) for name in a.differences(b)]

    def save(
        self, path: str | os.PathLike[str], model: Model, dt: float, more: Mapping[str, NDArray] | None = None
    ) -> None:
        """Store the state in one file, whole or not at all.

        Args:
            path: of the file.
            model: that the state belongs to.
            dt: time step [s].
            more: arrays that are stored with it; `load` leaves them alone.

        Raises:
            OSError: the file cannot be written.
        """
        head = {"format": FORMAT, "model": digest(model), "dt": dt, "steps": self.steps}
        head |= {"scalar": self._scalar, "scenes": len(self.scenes)}
        arrays: dict[str, Any] = {**(more or {})}
        arrays |= {name: array.numpy() for name, array in self.arrays().items()}
        for k, records in enumerate(self.scenes):
            arrays |= {f"scenes/{k}/{name}": array for name, array in records.arrays().items()}
        arrays["header"] = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
        write_atomically(Path(path), lambda file: np.savez(file, **arrays))

    def load(self, path: str | os.PathLike[str], model: Model, dt: float) -> None:
        """Take over what `save` stored of a state of the same model, on whichever device.

        Raises:
            RequestError: there is no such file, it is damaged, or of another model, precision or time step; nothing has
                changed.
        """
        if not Path(path).is_file():
            raise bad_value("state", str(path), "there is no such file")
        try:
            with np.load(path, allow_pickle=False) as archive:
                stored = {name: archive[name] for name in archive.files}
            head = json.loads(stored.pop("header").tobytes())
            if head["format"] != FORMAT:
                raise ValueError(head["format"])
            alike = (head["model"], head["dt"], head["scalar"]) == (digest(model), dt, self._scalar)
            mine = {name: _fitting(name, to, stored.pop(name)) for name, to in self.arrays().items()} if alike else {}
            if not (type(head["steps"]) is int and 0 <= head["steps"] <= MAX_COUNT):
                raise ValueError(head["steps"])
            scenes = [SceneRecords.of(_part(stored, f"scenes/{k}/")) for k in range(head["scenes"])]
        except DAMAGE as error:
            raise bad_value(
                "state", str(path), "it is damaged or of another version; remove it and run again"
            ) from error
        if not alike:
            raise bad_value("state", str(path), "it is of another model, precision or time step; use the run's own")
        for name, to in self.arrays().items():
            _fill(name, to, mine[name])
        self.steps, self.scenes = head["steps"], scenes


def _fitting(name: str, to: wp.array, array: NDArray) -> NDArray:
    """The array, if `to` can take it over.

    Raises:
        ValueError: it has another shape or dtype.
    """
    own = to.numpy()
    if array.dtype != own.dtype or (array.shape != own.shape and name != "speed_square"):
        raise ValueError(name)
    return array


def _fill(name: str, to: wp.array, array: NDArray) -> None:
    """Copy an array that may come from another device."""
    if name == "speed_square" and len(array) != len(to):  # of each node on one device, of all nodes on another
        most = array.max(initial=0.0)
        array = np.zeros(len(to), array.dtype)
        array[:1] = most
    if to.size:
        to.assign(array)


def _copied(part: Any) -> Any:
    """A copy of a dataclass, struct or list of arrays; other values are shared."""
    if isinstance(part, wp.array):
        return wp.clone(part) if part.is_contiguous else wp.clone(part.transpose()).transpose()
    if isinstance(part, list):
        return [_copied(item) for item in part]
    if isinstance(part, dict):
        return {name: _copied(item) for name, item in part.items()}
    if hasattr(part, "__dataclass_fields__"):
        return type(part)(**{name: _copied(getattr(part, name)) for name in _names(part)})
    if hasattr(part, "_cls"):
        found = part._cls()
        for name in _names(part):
            setattr(found, name, _copied(getattr(part, name)))
        return found
    return part


def _names(part: Any) -> list[str]:
    return [f.name for f in fields(part)] if hasattr(part, "__dataclass_fields__") else list(part._cls.vars)


def _arrays(owner: Any, prefix: str) -> Iterator[tuple[str, wp.array]]:
    """Device arrays of a dataclass, of its parts and lists of parts, with their names."""
    for name in owner if isinstance(owner, dict) else _names(owner):
        value = owner[name] if isinstance(owner, dict) else getattr(owner, name)
        if isinstance(value, wp.array):
            yield prefix + name, value
        elif isinstance(value, dict):
            yield from _arrays(value, prefix)
        elif isinstance(value, list) and name != "scenes":
            for k, part in enumerate(value):
                yield from _arrays(part, f"{prefix}{name}/{k}/")
        elif hasattr(value, "__dataclass_fields__") or hasattr(value, "_cls"):
            yield from _arrays(value, f"{prefix}{name}/")


def _same(a: NDArray, b: NDArray) -> bool:
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def _part(stored: dict[str, NDArray], prefix: str) -> dict[str, NDArray]:
    return {name.removeprefix(prefix): array for name, array in stored.items() if name.startswith(prefix)}


def digest(model: object) -> str:
    """SHA-256 of all that a model, or another dataclass, is made of: equal for the same scene and meshes."""
    found = hashlib.sha256()
    for part in _parts(model):
        found.update(part)
    return found.hexdigest()


def _parts(value: Any) -> Iterator[bytes]:
    """A value of a model as bytes: arrays with their dtype and shape, dataclasses field by field."""
    if isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}".encode()
        yield value.tobytes()
    elif hasattr(value, "__dataclass_fields__"):
        for name in _names(value):
            yield from _parts(getattr(value, name))
    elif isinstance(value, Mapping):
        yield from _parts(tuple(value.items()))
    elif isinstance(value, tuple | list):
        yield f"{len(value)}".encode()
        for item in value:
            yield from _parts(item)
    else:
        yield repr(value).encode()
