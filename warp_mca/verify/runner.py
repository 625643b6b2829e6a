"""Owns running verification cases one after the other."""

from __future__ import annotations

import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from warp_mca.base.errors import GuardError, McaError
from warp_mca.base.files import check_folder
from warp_mca.step.device import check_device
from warp_mca.verify import cases
from warp_mca.verify.case import Case, Level, Setup
from warp_mca.verify.report import Outcome, lines, write


def outcome(case: Case, setup: Setup) -> Outcome:
    """Run one case; what it raises is its failure. One that needs a module which is not installed is skipped.

    An engine in error can give histories that nothing can be read off: that, too, is the case's failure.
    """
    if case.needs and find_spec(case.needs) is None:
        skipped = f"skipped, it needs {case.needs} (pip install {case.needs})"
        return Outcome(case=case, setup=setup, rows=(), failure=None, wall=0.0, skipped=skipped)
    begun = time.perf_counter()
    failure, rows = None, ()
    try:
        rows = tuple(case.measure(setup))
    except McaError as error:
        failure = f"stopped: {error}"
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        failure = f"gave nothing to read: {type(error).__name__}: {error}"
    return Outcome(case=case, setup=setup, rows=rows, failure=failure, wall=time.perf_counter() - begun)


def verify(
    names: Sequence[str] = (),
    *,
    device: str = "cpu",
    precision: str = "mixed",
    element: str | None = None,
    level: Level = "quick",
    out: Path | None = None,
) -> list[Outcome]:
    """Run cases, print what they give, and write the report into `out` where one is named.

    Args:
        names: of cases or groups; all by default.
        device, precision: as in `warp_mca.run`.
        element: formulation of every body; each that a case is for in turn if None.
        level: of the meshes.
        out: folder for verification.md and its figure.

    Raises:
        RequestError: there is no such case or device, or `out` takes no file.
        GuardError: a case was not met.
    """
    chosen = cases(names)
    device = check_device(device)
    if out is not None:
        check_folder("out", out)
    outcomes = []
    for case in chosen:
        for item in case.taken(element):
            found = outcome(case, Setup(device=device, precision=precision, element=item, level=level))
            print("\n".join(lines(found)), flush=True)
            outcomes.append(found)
    failed = [f"{o.case.name} ({o.element})" for o in outcomes if not o.met and not o.skipped]
    done = [o for o in outcomes if not o.skipped]
    rows = sum(len(o.rows) for o in outcomes)
    wall = sum(o.wall for o in outcomes)
    left_out = f", {len(outcomes) - len(done)} skipped" if len(done) < len(outcomes) else ""
    unsettled = sum(row.verdict == "OPEN" for o in outcomes for row in o.rows)
    left_out += f", {unsettled} quantities open" if unsettled else ""
    print(f"{len(done) - len(failed)} of {len(done)} cases met{left_out}, {rows} quantities, {wall:.0f} s")
    if out is not None:
        command = f"warp-mca verify --level {level} --device {device} --precision {precision}"
        for file in write(out, outcomes, f"Written by `{command}`."):
            print(f"wrote {file}")
    if failed:
        raise GuardError(f"not met: {', '.join(failed)}")
    return outcomes
