"""Owns how the progress of a long task is shown: a bar where someone watches, lines where output is piped."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec

Tell = Callable[[str, float], None]  # stage, share of it that is done

LINE_TIME, LINE_SHARE, LONGEST = 10.0, 0.05, 600.0  # between two lines at least [s] and [-]; at most [s]


@contextmanager
def progress_bar() -> Iterator[Tell]:
    """A function that shows a stage and the share done: a bar with the time left in a terminal or a notebook, lines on
    standard error elsewhere."""
    from rich.console import Console

    console = Console(stderr=True)
    notebook = console.is_jupyter and find_spec("ipywidgets") is not None
    if not notebook and not (sys.stdout.isatty() and sys.stderr.isatty()):
        yield Lines()
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description:8}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=not notebook) as bar:
        task, shown = bar.add_task("", total=None), ""

        def tell(stage: str, done: float) -> None:
            nonlocal shown
            if stage != shown:
                bar.reset(task, description=stage, total=None)
                shown = stage
            if done > 0.0:
                bar.update(task, total=1.0, completed=done)

        yield tell


class Lines:
    """Writes a line now and then: every LINE_TIME at most, and none in a task that is done by then."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.clock, self.stage, self.begun, self.written, self.share = clock, "", clock(), clock(), 0.0

    def __call__(self, stage: str, done: float) -> None:
        """Take in a share, and write it if it is time."""
        now = self.clock()
        if stage != self.stage:
            self.stage, self.begun, self.share = stage, now, 0.0
        waited = now - self.written
        if done <= 0.0 or waited < LINE_TIME or (done < self.share + LINE_SHARE and waited < LONGEST):
            return
        self.written, self.share = now, done
        left = (now - self.begun) * (1.0 - done) / done
        with suppress(OSError):  # a closed standard error does not stop the run
            print(f"{stage}: {done:.0%} done, {duration_words(left)} left", file=sys.stderr, flush=True)


def duration_words(seconds: float) -> str:
    """A time as people say it: 0.4 s, 12 s, 3.5 min, 2.1 h."""
    if seconds < 1.0:
        return f"{max(seconds, 0.0):.1g} s"
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
