"""Command line of the table of extremes.

    python -m benchmarks.stability                              the table, minutes on one core; writes stability.*
    python -m benchmarks.stability --level long                 millions of steps: minutes to an hour
    python -m benchmarks.stability --only poisson friction      these axes only
    python -m benchmarks.stability --level quick                a few values of each; prints, stores nothing
    python -m benchmarks.stability --level long --missing       those of them that are not stored yet
    python -m benchmarks.stability --render                     write the page from what is stored

Cells replace those of the same axis, value, element and precision.
"""

from __future__ import annotations

import argparse
import json
import logging
from pathlib import Path
from typing import Any

from benchmarks.measurements import FOLDER, note

DESCRIPTION = "Run the table of extremes, and write stability.md of docs/measurements/."


def main() -> None:
    """Command line."""
    import warp as wp

    from benchmarks.stability.measure import wrong
    from benchmarks.stability.page import line, write_page
    from benchmarks.stability.table import AXES, merged, tasks

    setattr(wp.config, "quiet", True)  # noqa: B010
    logging.getLogger("warp_mca").setLevel(logging.ERROR)  # warnings are in the result as well
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability", description=DESCRIPTION)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--level", default="full", choices=("quick", "full", "long"))
    parser.add_argument("--only", nargs="*", default=(), choices=tuple(AXES), metavar="AXIS")
    parser.add_argument("--missing", action="store_true", help="only cells that are not stored")
    parser.add_argument("--data", type=Path, default=FOLDER / "stability.json", help="where cells are kept")
    parser.add_argument("--render", action="store_true", help="only write the page from the cells kept")
    args = parser.parse_args()
    stored: list[dict[str, Any]] = json.loads(args.data.read_text(encoding="utf-8")) if args.data.exists() else []
    if not args.render:
        new = []
        for task in tasks(args.only, args.level, stored if args.missing else ()):
            new.append(task(args.device))
            print(line(new[-1]), flush=True)
            if args.level != "quick":
                stored = merged(stored, new[-1:])
                text = ",\n".join(json.dumps(item) for item in stored)
                args.data.write_text(f"[\n{text}\n]\n", encoding="utf-8")
        print(f"{len(new)} cells, {sum(map(wrong, new))} of them wrong without a warning")
        if args.level == "quick":
            return
        note(args.data, args.device)
    write_page(stored, FOLDER / "stability.md")


if __name__ == "__main__":
    main()
