"""Numbers that nobody means are refused by the name that they were given under, before anything is computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import warp_mca as mca
from warp_mca.cli.main import main

BLOCK = mca.Body(
    name="block",
    geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2)),
    material=mca.Elastic(E=1e9, nu=0.3, rho=1e3),
)
FLOOR = mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane(), mu=0.2)
SCENE = mca.Scene(name="block", bodies=(BLOCK,), contacts=(FLOOR,), impact=mca.ImpactPhase(duration=4e-5))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--duration", "1e-320"], "duration = 1e-320: give a finite time from 1e-15 to 1e+09 s"),
        (["--duration", "1e-30"], "duration = 1e-30: give"),
        (["--duration", "1e300"], "duration = 1e+300: give"),
        (["--checkpoint", "1e-40s"], "checkpoint = '1e-40s': write it as"),
        (["--checkpoint", "1e40w"], "checkpoint = '1e40w': write it as"),
        (["--threads", "10000000000"], "threads = 10000000000: give a whole number of threads from 1 to 4,096"),
        (["--refine", "1e9"], "refine = 1000000000.0: give a number from 0.001 to 1000"),
        (["--refine", "1e-9"], "refine = 1e-09: give a number"),
        (["--refine", "900"], "refine = 900.0: Box.divisions = (36000, 3600, 3600): more than 200,000,000 elements"),
        (["--mass-scaling", "1e-30s"], "mass_scaling = '1e-30s': give a factor of 1 or above"),
        (["--set", "v=1e300"], "v = 1e+300: give a finite number [m/s], above 0; of a size from 1e-30 to 1e+30"),
        (["--set", "length=1e-300"], "length = 1e-300: give"),
        (["--set", "rho=1e31"], "rho = 1e+31: give"),
        (["--set", "v=1", "--set", "v=2"], "--set = 'v=2': v is given twice, also as 1"),
    ],
)
def test_what_is_typed_is_named(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "rod_on_wall", *words]) == 2
    err = capsys.readouterr().err
    assert said in err and err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [1e-320, 1e-30, 1e10, 1e300])
@pytest.mark.parametrize(
    ("field", "make"),
    [
        ("ImpactPhase.duration", lambda x: mca.ImpactPhase(duration=x)),
        ("ImpactPhase.output_interval", lambda x: mca.ImpactPhase(duration=1.0, output_interval=x)),
        ("ImpactPhase.open_time", lambda x: mca.ImpactPhase(duration=1.0, open_time=x)),
        ("Scene.refine", lambda x: replace(SCENE, refine=x)),
        ("Cad.size", lambda x: mca.Cad("part.step", size=x)),
        ("Cad.scale", lambda x: mca.Cad("part.step", size=0.01, scale=x)),
        ("duration", lambda x: mca.run(SCENE, duration=x)),
        ("duration", lambda x: mca.sweep([SCENE], duration=x)),
    ],
)
def test_what_python_gives_is_named(field: str, make: Callable[[float], object], value: float):
    with pytest.raises(mca.RequestError, match=rf"^{field} = .*: give a"):
        make(value)


@pytest.mark.parametrize("mu", [1.1e6, 1e300])
def test_a_friction_with_which_nothing_slides_needs_no_more(mu: float):
    with pytest.raises(mca.RequestError, match=r"^Contact\.mu = .*: give a coefficient of friction from 0 to 1e\+06"):
        replace(FLOOR, mu=mu)
    assert replace(FLOOR, mu=1e6).mu == 1e6


def test_a_value_of_the_recipe_that_is_wrong_by_itself_is_not_blamed_on_refine(tmp_path: Path):
    """Whatever refine is, the file is missing, and a box is too fine."""
    part = replace(BLOCK, geometry=mca.Cad(tmp_path / "none.step", size=0.01))
    with pytest.raises(mca.RequestError, match=r"^Cad\.path = .*No such file"):
        mca.mesh(replace(SCENE, bodies=(part,), refine=2.0))
    (tmp_path / "a.step").write_text("")
    finer = replace(BLOCK, geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 500)))
    with pytest.raises(mca.RequestError, match=r"^refine = 500\.0: Box\.divisions = \(1000, 1000, 250000\): more than"):
        mca.mesh(replace(SCENE, bodies=(finer,), refine=500.0))
