"""A recorder from outside the package, in this file alone: `--recorder MODULE:NAME` writes what a run shows it."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base import outside
from warp_mca.cli.main import main
from warp_mca.recorders import Cadence
from warp_mca.results.storage import load

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]


class Peak:
    """Writes time [s] and greatest von Mises stress on the skins [Pa], one line for each frame."""

    needs = frozenset({"surface"})

    def __init__(self, file: str = "peak.csv", unit: float = 1.0, cadence: Cadence | None = None) -> None:
        self.path, self.unit, self.cadence = Path(file), unit, cadence or Cadence(frames=5)
        self.name, self.files = str(self.path), (self.path,)

    def start(self, info: object) -> None:
        """Open the file."""
        self.file = self.path.open("w")

    def frame(self, frame: object) -> None:
        """Write one line."""
        peak = max(float(value.max()) for value in frame.von_mises.values())  # pyright: ignore
        print(repr(frame.time), repr(peak / self.unit), sep=",", file=self.file)  # pyright: ignore

    def history(self, rows: object) -> None:
        """Is not written."""

    def finish(self, ok: bool) -> None:
        """Close the file."""
        self.file.close()


SCENE = '''"""A block lands, beside a rigid one."""
import warp_mca as mca

def build(rates: bool = False) -> mca.Scene:
    steel = mca.Elastic(E=1e9, nu=0.3, rho=1e3)
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(4, 4, 4))
    bodies, contacts = [], []
    for k, name in enumerate(("soft", "hard")):
        place = (0.02 * k, 0.0, 0.0)
        bodies.append(mca.Body(name=name, geometry=box, material=steel, position=place, velocity=(0.0, -1.0, 0.0),
                               rigid=name == "hard"))
        contacts.append(mca.Contact(slave=mca.Surface(body=name, nodes="ymin"), master=mca.RigidPlane()))
    return mca.Scene(name="block", bodies=tuple(bodies), contacts=tuple(contacts),
                     impact=mca.ImpactPhase(duration=4e-5, time_step_scale=0.4))
'''


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_figures: None) -> None:
    """A folder with the recorder as the module `mine`, and a scene file."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(outside, "_IMPORTED", {})
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    shutil.copy(__file__, "mine.py")
    Path("block.py").write_text(SCENE)


def table(file: str) -> np.ndarray:
    return np.loadtxt(file, delimiter=",", ndmin=2)


@pytest.mark.parametrize("device", DEVICES)
def test_its_file_has_the_peaks_of_the_run_and_changes_no_bit(device: str):
    command = ["run", "block.py", "--device", device]
    assert main([*command, "--out", "plain"]) == 0
    recorders = ["--recorder", "mine:Peak", "--recorder", "mine:Peak,file=b.csv,unit=1e6", "--frames", "9"]
    assert main([*command, "--out", "shown", *recorders]) == 0
    found = table("peak.csv")
    assert found.shape == (9, 2) and found[-1, 0] == pytest.approx(4e-5, rel=1e-12)
    assert found[0, 1] == 0.0 and found[:, 1].max() > 1e5
    np.testing.assert_allclose(table("b.csv") * [1.0, 1e6], found, rtol=1e-15)
    result = mca.run(mca.make_scene("block.py"), device=device, recorders=[Peak("c.csv", cadence=Cadence(frames=9))])
    np.testing.assert_array_equal(table("c.csv"), found)
    for name, column in load("plain").history.items():
        np.testing.assert_array_equal(load("shown").history[name], column)
        np.testing.assert_array_equal(result.history[name], column)
    assert result.summary["energy_error"] < 1e-4


def test_it_sees_a_model_file_with_steps_of_several_rates():
    assert main(["build", "block.py", "-o", "block.mca"]) == 0
    assert main(["run", "block.mca", "--multi-rate", "2", "--out", "a", "--recorder", "mine:Peak"]) == 0
    assert table("peak.csv")[:, 1].max() > 1e5


def test_a_registered_one_goes_by_its_name(register: Callable[..., object]):
    register(Peak)
    assert main(["run", "block.py", "--out", "a", "--recorder", "Peak"]) == 0
    assert len(table("peak.csv")) > 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--recorder", "mine"], "--recorder = 'mine': write it as MODULE:NAME or MODULE:NAME,KEY=VALUE"),
        (["--recorder", "mine:Nope"], "--recorder = 'mine:Nope': the module mine has no Nope"),
        (["--recorder", "nope:Peak"], "--recorder = 'nope': there is no such module in "),
        (
            ["--recorder", "mine:Peak,unit=1,unit=2"],
            "--recorder = 'mine:Peak,unit=1,unit=2': write it as",
        ),
        (["--recorder", "mine:Peak,file"], "--recorder = 'mine:Peak,file': write it as"),
        (["--recorder", "mine:Path"], "--recorder = 'mine:Path': name a class with start, frame, history, finish"),
        (["--recorder", "mine:Peak,unit=a,no=1"], "--recorder = 'mine:Peak,unit=a,no=1': Peak() failed with TypeError"),
        (
            ["--recorder", "mine:Peak", "--sweep", "rates=yes"],
            "--sweep = 'rates=yes': recorders show single runs",
        ),
    ],
)
def test_what_cannot_be_is_refused_by_name_and_leaves_nothing(
    options: list[str], words: str, capsys: pytest.CaptureFixture[str]
):
    assert main(["run", "block.py", "--out", "a", *options]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith(f"warp-mca: error: {words}")
    assert not Path("a").exists() and not Path("peak.csv").exists()
