"""Owns how the bash blocks of the pages run in tests: at what scale, which commands not at all, and why.

Bash runs the blocks of a page in turn, in a folder of the page. Commands run on the CPU and keep their words; words are
added to make a model smaller or a run shorter.
"""

from __future__ import annotations

import contextlib
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from command_server import write_stand_ins

from benchmarks.pages import DOCS, Block, blocks, page_blocks

ROOT = DOCS.parent
PAGES = {
    str(path.relative_to(ROOT)): path
    for path in [*sorted(ROOT.glob("*.md")), *sorted(DOCS.rglob("*.md"))]
    if not path.name.endswith(".template.md")
}
LIMIT = 120  # for a block [s]
NO_GPU = {"CUDA_VISIBLE_DEVICES": ""}  # a fork could not use one
# Blocks that are not run as a whole, by how they begin.
LISTED = {
    "$(command -v sudo) apt-get update": ".ci/run runs it, in a copy of the repository",
    ".venv/bin/python -m pytest": "these tests; .ci/run runs them",
    "pip install -e '.[docs]' && mkdocs build": "tests/test_site.py builds the site",
}
# Commands that are not run, by how they begin.
NOT_RUN = {
    "warp-mca view": "opens a window until it is closed",
    "pip install bpy": "tests install nothing",
    "python -m benchmarks.blender": "needs Blender's module; tests/test_blender.py has it where that is installed",
}
# Words that are added to commands, by how these begin: the longest that fits. Of an option that is given twice the last
# one counts. --force: lines of a page are alternatives, with one folder. Behind #: time of a core without these words.
SMALL = "--refine 0.35 --duration 5e-5"  # quick: 248 elements
NEAR = "--set theta_OA=19.05 --set theta_AB=36.45"  # released 2 ms before contact, not 0.25 s
ADDED = {
    "warp-mca run": "--force",
    "warp-mca run taylor_bar": "--duration 5e-6 --force",  # all of it: 24 s of a core
    "warp-mca run hertz_sphere": "--duration 1e-5 --force",  # 4 s
    "warp-mca run three_link": "--duration 5e-5 --force",  # 14 s
    "warp-mca run single_link": "--duration 5e-5 --force",  # 7 s
    "warp-mca run two_link": f"{SMALL} --force",  # 16 s
    "warp-mca run two_link --refine": "--duration 2e-6 --force",
    "warp-mca run two_link --animate": f"{SMALL} --frames 4 --force",
    "warp-mca run two_link --method pure-fem": f"{NEAR} --refine 0.35 --duration 5e-6 --force",
    "warp-mca run two_link --set hinge=lug": "--duration 1e-5 --force",  # its holes need the cells of quick
    "warp-mca run two_link --preset paper --set hinge=lug": "--preset quick --duration 1e-5 --force",
    "warp-mca run two_link --set joint_nodes=pin --set penalty=1 --mass-scaling 2": "--duration 5e-6 --force",
    "warp-mca run two_link --set joint_nodes=pin --accuracy": "--accuracy 50% --duration 1e-5 --force",
    "warp-mca run my_scene.py --accuracy": "--accuracy 50% --force",
    "warp-mca run paper.mca": "--duration 1e-5 --force",
    "warp-mca run bracket.step --height": "--duration 1e-6 --set across=0.5 --set struck=off --force",  # 25 s
    "warp-mca build two_link --preset paper": "--refine 0.25",
    "warp-mca sweep two_link": f"{SMALL} --workers 1",
    "warp-mca tradeoff two_link": "--budget 30 --refine 0.35 --duration 1e-5 --force",
    "warp-mca tradeoff my_scene.py": "--budget 30 --force",
    "warp-mca tradeoff hertz_sphere": "--budget 30 --duration 2e-6 --force",
    "warp-mca tradeoff rolling_sphere": "--budget 30 --duration 2e-6 --force",
    "warp-mca tradeoff single_link": "--budget 30 --refine 0.35 --duration 1e-5 --force",
    "warp-mca paper": "--deadline 0",  # begins none of its runs, which take minutes
    "python -m benchmarks.batch": "--scenes 1,2 --duration 1e-6",
    "python -m benchmarks.recording": "--preset quick --pairs 1 --frames 2 --duration 2e-6",
}
# Commands that run with other words: those that nothing added makes shorter.
REPLACED = {
    "warp-mca verify hertz_sphere rod_on_wall": "warp-mca verify rod_on_wall"
}  # 17 s, as in tests/test_verify.py
# Those that do not end with 0.
STATUS = {"warp-mca paper": 1}  # runs are missing
TABLES: dict[str, dict[str, Any]] = {"NOT_RUN": NOT_RUN, "ADDED": ADDED, "REPLACED": REPLACED, "STATUS": STATUS}


def _longest(words: list[str], table: dict[str, Any]) -> str | None:
    """The entry of a table with which a command begins, the longest one."""
    found = [key for key in table if words[: len(shlex.split(key))] == shlex.split(key)]
    return max(found, key=len, default=None)


def plan(words: list[str]) -> tuple[list[str] | None, int]:
    """The words to carry out for a command of a page, or None, and the exit status that counts as success."""
    used = {name: _longest(words, table) for name, table in TABLES.items()}
    asked: list[str] | None = None
    if used["NOT_RUN"] is None:
        asked = list(words)
        if (replaced := used["REPLACED"]) is not None:
            asked[: len(shlex.split(replaced))] = shlex.split(REPLACED[replaced])
        asked += shlex.split(ADDED[used["ADDED"]]) if used["ADDED"] else []
        if "--device" in asked:
            asked[asked.index("--device") + 1] = "cpu"
    with Path(os.environ["PAGE_LOG"]).open("a", encoding="utf-8") as log:
        log.write(json.dumps({"words": words, "asked": asked, "used": used}) + "\n")
    return asked, STATUS.get(used["STATUS"] or "", 0)


@dataclass(frozen=True)
class Done:
    """What became of the bash blocks of a page.

    Attributes:
        failed: the first block that failed, and what it printed; empty if all ended well.
        commands: of each command its words, those carried out or None, and the entries of TABLES used for it.
    """

    failed: str
    commands: list[dict[str, Any]]


def bash_blocks(page: str) -> list[Block]:
    """The blocks of a page that bash runs, those of LISTED left out."""
    found = [block for block in blocks(PAGES[page].read_text(encoding="utf-8")) if block.language == "bash"]
    return [block for block in found if listed(block) is None]


def listed(block: Block) -> str | None:
    """The entry of LISTED that a block is, or None."""
    return next((key for key in LISTED if block.text.startswith(key)), None)


def run_blocks(texts: Sequence[str], folder: Path, programs: Path) -> Done:
    """Run bash blocks one after the other in `folder`, with the programs of `programs` and of the system."""
    log, said = folder.with_suffix(".log"), folder.with_suffix(".txt")
    log.touch()
    variables = {key: value for key, value in os.environ.items() if "DISPLAY" not in key}  # no windows
    variables |= {"PATH": f"{programs}:/usr/bin:/bin", "PYTHONPATH": str(ROOT), "PAGE_LOG": str(log), **NO_GPU}
    failed = ""
    for text in texts:
        with said.open("w", encoding="utf-8") as to:
            done = subprocess.run(
                ["timeout", str(LIMIT), "bash", "-euxo", "pipefail", "-c", text],
                cwd=folder,
                env=variables,
                stdin=subprocess.DEVNULL,
                stdout=to,
                stderr=subprocess.STDOUT,
                check=False,
            )
        if done.returncode:
            failed = f"exit status {done.returncode}: {text}\n{said.read_text(encoding='utf-8')}"
            break
    return Done(failed, [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()])


def run_pages(folder: Path) -> dict[str, Done]:
    """Run the bash blocks of every page in a folder of its own, those of two pages at the same time."""
    programs, given = folder / "programs", folder / "given"
    address = str(folder / "server")
    write_stand_ins(programs, ("warp-mca", "python", "pip"), address)
    given.mkdir()
    make_files(given)
    pages = sorted(filter(bash_blocks, PAGES), key=lambda page: -len(bash_blocks(page)))  # the longest first
    with server(address), ThreadPoolExecutor(2) as pool:
        found = {}
        for k, page in enumerate(pages):
            shutil.copytree(given, place := folder / str(k))
            texts = [block.text for block in bash_blocks(page)]
            found[page] = pool.submit(run_blocks, texts, place, programs)
        return {page: done.result() for page, done in found.items()}


def make_files(folder: Path) -> None:
    """Write the files that pages name as the reader's own: a part as the tutorial draws it, and a scene."""
    shutil.copy(ROOT / "scenes" / "coaxial_rods.py", folder / "my_scene.py")
    drawing = page_blocks("tutorials/drop.md")[0].text
    assert "bracket.step" in drawing
    with contextlib.chdir(folder):
        exec(drawing, {})


@contextmanager
def server(address: str) -> Iterator[None]:
    """The server of `command_server`, as long as the context lasts."""
    code = f"from command_server import serve; from page_commands import plan; serve({address!r}, plan)"
    path = os.pathsep.join([str(ROOT), str(Path(__file__).parent), *sys.path])
    with subprocess.Popen(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path, **NO_GPU},
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            assert process.stdout is not None and "ready" in process.stdout.readline()
            yield
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # with what commands may have left running
