"""Owns a result as tables: one column a quantity with its unit, for pandas, xarray and Parquet."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import McaError, RequestError
from warp_mca.base.files import given_path, write_atomically
from warp_mca.results.sensor_history import sensor_columns
from warp_mca.results.units import unit_of

if TYPE_CHECKING:
    from warp_mca.results.result import Result

Array = NDArray[np.float64]

AXES = ("x", "y", "z")
COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")  # of a stress
FACTS = ("scene", "n_elements", "n_nodes", "n_steps", "dt", "device", "precision", "element", "version")  # of a run


def table(result: Result) -> dict[str, tuple[Array, str]]:
    """Columns of a result and their units, by name: those of the history, contacts, probes and sections.

    Returns:
        Arrays of shape (row_count,), float64. CONTACT.Fx, .Fy, .Fz are the force of a contact on its slave, and
        CONTACT.pressure the sum of its normal forces [N]; those of probes and sections are as in probes.csv.
    """
    found = {name: (column, unit_of(name)) for name, column in result.history.items()}
    for contact in result.contacts:
        found |= {f"{contact.name}.F{axis}": (contact.force[:, k], "N") for k, axis in enumerate(AXES)}
        found[f"{contact.name}.pressure"] = contact.pressure, "N"
        found[f"{contact.name}.closing_speed"] = contact.closing_speed, "m/s"
    return found | sensor_columns(result.probes, result.sections)


def to_pandas(result: Result) -> Any:
    """As `Result.to_pandas`."""
    columns = table(result)
    frame = _module("pandas", "to_pandas").DataFrame({name: column for name, (column, _) in columns.items()})
    frame = frame.set_index("time_s")
    frame.attrs["units"] = {name: unit for name, (_, unit) in columns.items()}
    frame.attrs |= _facts(result)
    return frame


def to_xarray(result: Result) -> Any:
    """As `Result.to_xarray`."""
    xarray = _module("xarray", "to_xarray")
    variables: dict[str, tuple] = {}
    for name, column in result.history.items():
        variables[name] = ("time_s", column, {"units": unit_of(name)})
    coordinates: dict[str, Any] = {"time_s": variables.pop("time_s")}
    for kind, items, parts in _groups(result):
        if items:
            coordinates[kind] = [item.name for item in items]
            coordinates["axis"] = list(AXES)
            for name, unit in parts:
                values = np.stack([getattr(item, name) for item in items], axis=1)
                dims = ("time_s", kind, "axis")[: values.ndim]
                variables[f"{kind}_{name}"] = (dims, values, {"units": unit})
    for path in result.paths:
        along = f"position_{path.name}"
        coordinates[along] = (along, path.position, {"units": "m"})
        coordinates["component"] = list(COMPONENTS)
        variables[f"stress_{path.name}"] = (("time_s", along, "component"), path.stress, {"units": "Pa"})
    return xarray.Dataset(variables, coordinates, _facts(result))


def _groups(result: Result) -> Iterator[tuple[str, tuple[Any, ...], tuple[tuple[str, str], ...]]]:
    """Kinds of what a run records beside its history: (kind, items, attributes with their units)."""
    speeds = ("closing_speed", "m/s")
    yield "contact", result.contacts, (("force", "N"), ("pressure", "N"), ("normal_force", "N"), speeds)
    yield "probe", result.probes, (("position", "m"), ("velocity", "m/s"), ("acceleration", "m/s^2"))
    yield "section", result.sections, (("force", "N"), ("moment", "N m"))


def to_parquet(result: Result, file: str | os.PathLike[str]) -> Path:
    """As `Result.to_parquet`."""
    path = given_path("file", file, "name the Parquet file to write")
    arrow, parquet = _module("pyarrow", "to_parquet"), _module("pyarrow.parquet", "to_parquet")
    columns = table(result)
    fields = [arrow.field(name, arrow.float64(), metadata={"unit": unit}) for name, (_, unit) in columns.items()]
    attributes = {"units": {name: unit for name, (_, unit) in columns.items()}, **_facts(result)}
    schema = arrow.schema(fields, metadata={"PANDAS_ATTRS": json.dumps(attributes)})  # where pandas looks for `attrs`
    rows = arrow.table([np.asarray(column, np.float64) for column, _ in columns.values()], schema=schema)
    try:
        write_atomically(path, lambda stream: parquet.write_table(rows, stream))
    except OSError as error:
        raise McaError(f"the table could not be written to {path}: {error.strerror or error}") from error
    return path


def _facts(result: Result) -> dict[str, Any]:
    """What the summary says of the run as a whole."""
    return {name: result.summary[name] for name in FACTS if result.summary.get(name) is not None}


def _module(name: str, method: str) -> Any:
    """An optional package.

    Raises:
        RequestError: it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        raise RequestError(f"{method} needs the package {package}: pip install 'warp_mca[data]'") from error
