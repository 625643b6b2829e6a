"""How fast a step is, and where its time goes: `python -m benchmarks --device cuda:0 -o FILE.json`.

Rows are added to FILE.json, in place of rows of the same element, size, precision and case, so that a long
measurement can be made in parts (`--elements`, `--sizes`, `--parts`). `python -m benchmarks.report` makes
performance.md of docs/measurements/ of it.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from benchmarks.blocks import RATES, SIZES, assemble
from benchmarks.ceilings import ceilings
from benchmarks.flops import flops
from benchmarks.measurements import device_name, note
from benchmarks.rates import measure_host, measure_rates, measure_savings
from benchmarks.startup import startup
from benchmarks.timing import QUICK, Care
from warp_mca import __version__
from warp_mca.physics.elements import ELEMENTS, of_hexahedra

PARTS = ("ceilings", "flops", "rates", "savings", "host", "startup")
KEY = ("element", "size", "precision", "case")


def facts(device: str) -> dict[str, Any]:
    """Device and versions."""
    found, name = wp.get_device(device), device_name(device)
    versions = {"warp": wp.__version__, "numpy": np.__version__, "python": platform.python_version()}
    versions |= {"warp_mca": __version__}
    if found.is_cuda:
        versions["driver"] = ".".join(str(part) for part in wp.get_cuda_driver_version())
    return {"device": device, "name": name, "threads": None if found.is_cuda else 1, "versions": versions}


def merged(old: list[dict], new: list[dict]) -> list[dict]:
    """Old rows, with new ones in place of those they repeat, in the order of elements, sizes, precisions."""
    rows = {tuple(row.get(k) for k in KEY): row for row in [*old, *new]}
    order = {name: k for names in (ELEMENTS, SIZES, ("mixed", "float64")) for k, name in enumerate(names)}
    return sorted(rows.values(), key=lambda row: [order.get(row.get(k), 0) for k in KEY[:3]])


def main(words: list[str] | None = None) -> dict[str, Any]:
    """Measure, print and store."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--sizes", nargs="+", help=f"out of {' '.join(SIZES)}, or numbers of elements")
    parser.add_argument("--elements", nargs="+", default=of_hexahedra(), choices=of_hexahedra())
    parser.add_argument("--precision", nargs="+", default=["mixed", "float64"], choices=["mixed", "float64"])
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS)
    parser.add_argument("--cases", nargs="+", default=list(RATES), choices=list(RATES), help="of the rates")
    parser.add_argument("--quick", action="store_true", help="shorter timings, fewer repeats")
    parser.add_argument("--seconds", type=float, help="that a timing lasts at least")
    parser.add_argument("-o", "--output", type=Path, help="JSON file that rows are added to")
    args = parser.parse_args(words)
    begun = time.perf_counter()
    wp.config.quiet = True
    wp.init()
    care = QUICK if args.quick else Care()
    care = replace(care, seconds=args.seconds or care.seconds)
    cuda = wp.get_device(args.device).is_cuda
    sizes = args.sizes or (["5k", "50k", "159k", "1M"] if cuda else ["5k", "50k"])
    data: dict[str, Any] = {}
    if args.output and args.output.exists():
        data = json.loads(args.output.read_text(encoding="utf-8"))
    data |= facts(args.device)
    print(data["name"], data["versions"], flush=True)

    def keep(part: str, value: Any) -> None:
        data[part] = merged(data.get(part, []), value) if isinstance(value, list) else value
        if args.output:
            args.output.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")

    if "ceilings" in args.parts:
        keep("ceilings", ceilings(args.device, care, small=args.quick))
    if "flops" in args.parts:
        kinds = [(e, p, b) for e in args.elements for p in args.precision for b in (False, True)]
        rows = [
            {"element": e, "precision": p, "case": "plastic" if b else "elastic"} | flops(e, p, b, cuda)
            for e, p, b in kinds
        ]
        keep("flops", rows)
        print("flops  ", ", ".join(f"{r['element']} {r['precision']} {r['case']} {r['f32']}+{r['f64']}" for r in rows))
    if "startup" in args.parts:
        keep("startup", startup(args.device))
    for element in args.elements if {"rates", "savings", "host"} & set(args.parts) else []:
        for size in sizes:
            start = time.perf_counter()
            model = assemble(element, SIZES.get(size) or int(size))
            where = {"element": element, "size": size}
            print(f"{element} {size}: assembled in {time.perf_counter() - start:.1f} s", flush=True)
            if "rates" in args.parts:
                keep("rates", measure_rates(model, where, args.precision, args.device, care, args.cases))
            if "savings" in args.parts:
                keep("savings", measure_savings(model, where, args.precision, args.device, care))
            if "host" in args.parts and element == "hex8":
                keep("host", [measure_host(model, where, args.device, care)])
    if args.output:
        note(args.output, args.device)
    print(f"{time.perf_counter() - begun:.0f} s")
    return data


if __name__ == "__main__":
    main()
