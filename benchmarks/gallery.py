"""Owns gallery.md of docs/measurements/: runs and pictures each built-in scene, with its figure beside the known one.

python -m benchmarks.gallery                 run all scenes, then all with hex8 and with hex8i; write gallery.json,
                                             gallery.elements.json, gallery.md and the pictures
python -m benchmarks.gallery two_link        run one again; the others stay
python -m benchmarks.gallery --render        write gallery.md from gallery.json again
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import warp_mca as mca
from benchmarks import gallery_elements
from benchmarks.gallery_scenes import SCENES
from benchmarks.measurements import FOLDER, measured, note
from benchmarks.pictures import shrink
from warp_mca.recorders import SnapshotFile
from warp_mca.scene.catalogue import load_source

PICTURES = FOLDER / "images" / "gallery"


def run_scene(name: str, folder: Path = PICTURES) -> dict[str, Any]:
    """Run one scene, and picture it in a folder: its row of gallery.json."""
    item = SCENES[name]
    scene = mca.make_scene(name)
    picture = folder / f"{name}.png"
    instant = item.at * scene.impact.duration
    begun = time.process_time()
    result = mca.run(scene, device="cpu", recorders=[SnapshotFile(picture, time=instant, **item.look)])
    spent = time.process_time() - begun
    shrink(picture)
    known = item.known(result.summary["parameters"]) if item.known else None
    measured = item.measured(result, result.summary["parameters"])
    row: dict[str, Any] = {"scene": name, "quantity": item.quantity, "unit": item.unit, "measured": measured}
    row |= {"known": known, "theory": item.theory, "pictured_at": instant, "warnings": result.warnings}
    return row | {key: result.summary[key] for key in ("n_elements", "n_steps", "version")} | {"cpu_time": spent}


def render(rows: list[dict[str, Any]]) -> str:
    """The page."""
    text = (FOLDER / "gallery.template.md").read_text(encoding="utf-8").replace("{measured}", measured("gallery"))
    return text + "".join(_section(row) for row in rows) + gallery_elements.section(rows)


def figure(value: float, unit: str) -> str:
    """A number of four digits with its unit."""
    return f"{value:.4g}" if unit == "-" else f"{value:.4g} {unit}"


def _section(row: dict[str, Any]) -> str:
    name, unit = row["scene"], row["unit"]
    source = load_source(name)
    number = f"{row['quantity'].capitalize()}: **{figure(row['measured'], unit)}**"
    if row["known"] is not None:
        off = abs(row["measured"] - row["known"]) / abs(row["known"]) if row["known"] else None
        number += f"; {row['theory']}: {figure(row['known'], unit)}"
        number += f", {100.0 * off:.2g} % apart" if off is not None else ""
    instant = f"{row['pictured_at'] * 1e6:.3g} µs" if row["pictured_at"] < 1e-3 else f"{row['pictured_at']:.3g} s"
    return f"""
## {name}

{source.description}

![{name}, {instant} after the start of the impact phase](images/gallery/{name}.png)

```bash
warp-mca run {name}
```

{number}. {row["n_elements"]} elements, {row["n_steps"]} steps. Code: [scenes/{name}.py](../../scenes/{name}.py).
"""


def main() -> None:
    """Read the command line and do what it asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", choices=[[], *SCENES], help="which; all without a name")
    parser.add_argument("--render", action="store_true", help="write the page again, without any run")
    asked = parser.parse_args()
    stored = FOLDER / "gallery.json"
    rows = {row["scene"]: row for row in json.loads(stored.read_text(encoding="utf-8"))} if stored.exists() else {}
    names = [] if asked.render else asked.scenes or SCENES
    for name in names:
        rows[name] = run_scene(name)
        print(f"{name}: {rows[name]['measured']:.6g} {rows[name]['unit']}, known {rows[name]['known']}", flush=True)
        ordered = [rows[scene] for scene in SCENES if scene in rows]
        stored.write_text(json.dumps(ordered, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        note(stored, "cpu")
    gallery_elements.measure(names)
    ordered = [rows[scene] for scene in SCENES if scene in rows]
    (FOLDER / "gallery.md").write_text(render(ordered), encoding="utf-8")


if __name__ == "__main__":
    main()
