"""Owns the command `sweep`: a scene for each combination of parameter values, a row of figures a run."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mca.base.errors import CriterionError, GuardError
from warp_mca.cli.request import parameters_given, read_requests
from warp_mca.cli.warp_start import RUN, start_warp

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.studies.sweep_job import Row
    from warp_mca.studies.sweep_plan import Plan, RunOptions

SHOWN, WARNINGS = 40, 10  # rows and warnings that the terminal shows at most; the table has all


def add_options(parser: argparse.ArgumentParser) -> None:
    """Those that a sweep has beside those of a run."""
    parser.add_argument(
        "--grid",
        dest="grids",
        action="append",
        required=True,
        metavar="KEY=VALUE,…",
        help="run the scene for each of these values of a parameter; several times: all combinations",
    )
    parser.add_argument(
        "--executor",
        metavar="process|dask://HOST:PORT",
        help="who carries out the runs: processes on this machine (default), or the workers of a Dask cluster",
    )
    parser.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="processes (default: one for each core, or with --device cuda for each GPU)",
    )
    parser.add_argument(
        "--batch", type=int, metavar="N", help="runs computed in one model (default: as many as fill a GPU, 1 on a CPU)"
    )
    parser.add_argument("--folders", action="store_true", help="keep the files of each run too, in DIR/0, DIR/1, …")
    parser.add_argument("--force", action="store_true", help="start again, in place of going on with what DIR holds")
    parser.set_defaults(command=_carry_out)


def _carry_out(args: argparse.Namespace) -> None:
    sweep(
        args,
        "--grid",
        args.grids,
        folders=args.folders,
        executor=args.executor,
        workers=args.workers,
        batch=args.batch,
    )


def sweep(
    args: argparse.Namespace,
    option: str,
    grids: Sequence[str],
    *,
    folders: bool,
    executor: str | None = None,
    workers: int | None = None,
    batch: int | None = None,
    worst: bool = False,
) -> None:
    """Carry out a sweep, and print its table.

    Args:
        args: that the commands `run` and `sweep` share.
        option: of the command line that has the grid.
        grids: its texts `KEY=VALUE,VALUE,…`.
        folders, executor, workers, batch: as in `warp_mca.sweep`.
        worst: whether a table names the run with the greatest of each figure.

    Raises:
        RequestError: the request cannot be carried out.
        GuardError: not all runs are done; the table has them all.
    """
    from warp_mca.base.progress import progress_bar
    from warp_mca.phases.rate_groups import check_multi_rate
    from warp_mca.studies.sweep_plan import RunOptions, parse_grid
    from warp_mca.studies.sweep_workers import early_worker

    settings = parse_grid(option, grids, parameters_given(args))
    options = RunOptions(args.device, args.precision, args.threads, check_multi_rate(args.multi_rate), args.duration)
    prepare = partial(start_warp, *RUN)
    with early_worker(options, executor, workers, len(settings), prepare) as early, progress_bar() as progress:
        from warp_mca.studies.sweep import carry_out  # which imports what a run needs

        plan, meshes = _planned(args, settings, options, folders, batch)
        if not early:
            start_warp()
        rows = carry_out(
            plan,
            executor=executor,
            workers=workers,
            force=args.force,
            meshes=meshes,
            prepare=prepare,
            early=early,
            progress=progress,
        )
    _print(plan, rows)
    if worst:
        _print_worst(rows)
    _check_done(rows)


def _planned(
    args: argparse.Namespace,
    settings: Sequence[Mapping[str, str]],
    options: RunOptions,
    folders: bool,
    batch: int | None,
) -> tuple[Plan, dict[str, Mesh] | None]:
    """The sweep that a command asks for, and the meshes of its model file."""
    from warp_mca.studies.sweep_plan import Plan, plain

    requests = read_requests(args, settings)
    scenes = tuple(request.scene for request in requests)
    parameters = tuple(
        {key: plain(scene.parameters.get(key, text)) for key, text in chosen.items()}
        for scene, chosen in zip(scenes, settings, strict=True)
    )
    out = args.out or Path(f"{requests[0].label}-sweep")
    model = Path(args.scene).resolve() if requests[0].meshes else None
    return Plan(scenes, parameters, options, model, out, folders, batch), requests[0].meshes


def _check_done(rows: Sequence[Row]) -> None:
    """Raise GuardError or CriterionError where not all runs are done, or meet their criteria."""
    count = {status: sum(row["status"] == status for row in rows) for status in ("stopped", "failed", "criterion")}
    if count["stopped"] or count["failed"]:
        said = [f"guards stopped {count['stopped']}"] if count["stopped"] else []
        said += [f"{count['failed']} failed"] if count["failed"] else []
        raise GuardError(f"{', '.join(said)} of {len(rows)} runs")
    if count["criterion"]:
        raise CriterionError(f"{count['criterion']} of {len(rows)} runs do not meet their criteria")


def _print(plan: Plan, rows: Sequence[Row]) -> None:
    """A line for each run: what was set, the figures that one looks at first, and why it has none.

    Below them, each warning once, the wall time of all runs together, and the files.
    """
    from rich.table import Table

    from warp_mca.base.console import console
    from warp_mca.results.report import REPORT
    from warp_mca.studies.sweep_job import BETWEEN, COMPLETE
    from warp_mca.studies.sweep_table import CSV, PARQUET

    out = console()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for key in plan.parameters[0]:
        table.add_column(key)
    for heading in ("first peak F_n [N]", "F_t [N]", "contact [ms]", "energy error"):
        table.add_column(heading, justify="right")
    table.add_column("")
    for row, chosen in list(zip(rows, plan.parameters, strict=True))[:SHOWN]:
        cells = ["", "", "", "", row["reason"] or ""]
        if row["status"] in COMPLETE:
            folder = plan.run_folder(row["index"])
            peak = row["F_n_first_peak"]
            cells = ["none" if peak is None else f"{peak:.5g}", f"{row['F_t_min']:.5g} to {row['F_t_max']:.5g}"]
            cells += [f"{1e3 * row['contact_duration']:.4g}", f"{100.0 * row['energy_error']:.2g} %"]
            cells += [row["reason"] or (f"wrote {folder}" if folder else "")]
        values = (f"{value:.10g}" if isinstance(value, float) else str(value) for value in chosen.values())
        table.add_row(*values, *cells)
    out.print(table)
    if len(rows) > SHOWN:
        out.print(f"and {len(rows) - SHOWN} more")
    said = dict.fromkeys(text for row in rows for text in (row.get("warnings") or "").split(BETWEEN) if text)
    for warning in list(said)[:WARNINGS]:
        out.print(f"warning: {warning}", soft_wrap=True)
    if len(said) > WARNINGS:
        out.print(f"and {len(said) - WARNINGS} more warnings, in the column warnings of {CSV}")
    wall = sum({row["wall"] for row in rows if row.get("wall")})  # runs of a batch have the same
    out.print(f"wall time of all runs {wall:.1f} s, on {plan.options.device}, {plan.options.precision}")
    for name in (CSV, PARQUET, REPORT):
        if plan.out and (plan.out / name).exists():
            out.print(f"wrote {plan.out / name}", soft_wrap=True)


def _print_worst(rows: Sequence[Row]) -> None:
    """A line for each figure: the greatest of all runs, and which run has it."""
    from rich.table import Table

    from warp_mca.base.console import console
    from warp_mca.studies.worst import worst

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("worst", "value", "unit", "run", "with"):
        table.add_column(heading, justify="right" if heading in ("value", "run") else "left")
    for entry in worst(rows):
        chosen = ", ".join(f"{key}={value}" for key, value in entry["parameters"].items())
        table.add_row(entry["figure"], f"{entry['value']:.5g}", entry["unit"], str(entry["index"]), chosen)
    console().print(table)
