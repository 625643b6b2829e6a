"""Owns `progress=True`: runs that show how far they are."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from warp_mca.base.progress import progress_bar

P = ParamSpec("P")
T = TypeVar("T")


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
