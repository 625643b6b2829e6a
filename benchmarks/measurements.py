"""Owns docs/measurements/, the folder of generated pages, and the note of when and on what each file was measured."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "measurements"
NOTES = "measured.json"  # date and device of each file, by its name without .json


def device_name(device: str) -> str:
    """Name of the hardware behind a Warp device, or behind several with commas between them."""
    import warp as wp

    names = dict.fromkeys(processor_name() if item == "cpu" else wp.get_device(item).name for item in device.split(","))
    return ", ".join(names)


def processor_name() -> str:
    """Name of this machine's processor, `CPU` where the system does not tell."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "CPU")


def note(file: Path, device: str) -> None:
    """Keep today's date and the device of a file of FOLDER that was just measured; other files are left alone.

    Args:
        file: JSON file of measurements.
        device: Warp's name of the device, such as `cuda:0`.
    """
    if file.resolve().parent != FOLDER:
        return
    notes = json.loads((FOLDER / NOTES).read_text(encoding="utf-8"))
    notes[file.stem] = {"date": datetime.now(UTC).date().isoformat(), "device": device_name(device)}
    (FOLDER / NOTES).write_text(json.dumps(notes, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def measured(name: str) -> str:
    """The line of a page that says when and on what the file of that name, without .json, was measured."""
    found = json.loads((FOLDER / NOTES).read_text(encoding="utf-8"))[name]
    return f"Measured on {found['date']}, {found['device']}."
