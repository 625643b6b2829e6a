"""Reads rerun recordings back with rerun's own reader."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path


def rows(file: Path, entity: str, column: str) -> Iterator[tuple[bool, int | None, list]]:
    """Whether static, step and value of each row that a recording holds for a component."""
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a killed run's file has no table of contents
        chunks = list(RrdReader(str(file)).stream())
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and column in batch.schema.names:
            steps = batch.column("step").to_pylist() if "step" in batch.schema.names else [None] * batch.num_rows
            for step, value in zip(steps, batch.column(column).to_pylist(), strict=True):
                yield chunk.is_static, step, value
