"""Elements fail and are removed: momentum, contact with new surfaces, batches, stored runs, criteria from outside."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from impacts import begun

import warp_mca as mca
from warp_mca.base.errors import GuardError, RequestError
from warp_mca.scene.failure import FAILURES, StrainFailure
from warp_mca.scene.model_file import load, save
from warp_mca.verify.failure import LENGTH, pulled

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
ALUMINIUM = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=200e6, E_t=500e6, beta=1.0)
SOFT = replace(ALUMINIUM, failure=mca.PlasticStrainFailure(strain=0.3))


def pierced(speed: float = 300.0, duration: float = 2e-5, **more: object) -> mca.Scene:
    """A block of steel on its way through a plate of aluminium of two layers of cells, which fails."""
    plate = mca.Box(size=(0.03, 0.03, 0.002), divisions=(12, 12, 2), origin=(-0.015, -0.015, -0.002))
    block = mca.Box(size=(0.006, 0.006, 0.006), divisions=(6, 6, 6), origin=(-0.003, -0.003, 0.0))
    sides = mca.Surface(body="block", nodes="boundary"), mca.Surface(body="plate", nodes="boundary")
    return mca.Scene(
        name="pierced",
        bodies=(
            mca.Body(name="plate", geometry=plate, material=SOFT, kinematics="finite", element="hex8"),
            mca.Body(
                name="block", geometry=block, material=STEEL, element="hex8", position=(0.0006, 0.0003, 1e-5),
                velocity=(0.0, 0.0, -speed),
            ),
        ),
        contacts=(mca.Contact(slave=sides[0], master=sides[1], two_way=True),),
        impact=mca.ImpactPhase(duration=duration, output_interval=5e-7),
        **more,
    )  # fmt: skip


@pytest.fixture(scope="module")
def through() -> mca.Result:
    return mca.run(pierced())


def test_contact_follows_the_new_surface_and_the_ledger_closes(through):
    energy, failed = through.summary["energy"], through.summary["failure"]["plate"]
    assert failed["elements"] > 8  # both layers
    assert failed["mass"] == pytest.approx(failed["elements"] * 2700.0 * 0.0025**2 * 0.001)
    assert through.summary["energy_error"] < 2e-3
    assert energy["failure"] > 0.0
    np.testing.assert_allclose(through["E_failure"][-1], energy["failure"])
    late = through.time > failed["time"] + 2e-6
    assert through.F_n[late].max() > 0.1 * through.F_n.max()  # the layer below, after the first element failed


def test_recorders_show_the_hole(tmp_path):
    """The surface that VTK, USD and meshio get has as many faces as the cells that are left have free ones."""
    h5py, meshio = pytest.importorskip("h5py"), pytest.importorskip("meshio")
    usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom

    from warp_mca.recorders import FinalState, RerunStream, UsdFile, VtkHdfFile
    from warp_mca.recorders.recorder import Cadence

    files = {name: tmp_path / f"o.{name}" for name in ("vtkhdf", "usdc", "rrd", "vtu")}
    cadence = Cadence(frames=3)
    recorders = [make(files[name], cadence=cadence) for name, make in (("vtkhdf", VtkHdfFile), ("usdc", UsdFile))]
    recorders += [FinalState(files["vtu"]), RerunStream(files["rrd"], cadence=cadence)]
    result = mca.run(pierced(duration=1e-5), recorders=recorders)
    assert result.failed == ()
    failed = result.summary["failure"]["plate"]["elements"]
    root = h5py.File(files["vtkhdf"])["VTKHDF"]
    hidden = root["CellData/vtkGhostType"][:].reshape(3, -1)
    assert (hidden != 0).sum(axis=1)[[0, -1]].tolist() == [0, failed]
    (cells,) = (block.data for block in meshio.read(files["vtu"]).cells)
    assert len(cells) == hidden.shape[1] - failed
    plate = cells[(cells < 13 * 13 * 3).all(axis=1)]
    free = mca.Mesh(np.zeros((13 * 13 * 3, 3)), plate.astype(np.int32)).boundary[0]
    stage = usd.Stage.Open(str(files["usdc"]))
    skin = UsdGeom.Mesh(stage.GetPrimAtPath("/World/plate"))
    counts = [len(skin.GetFaceVertexCountsAttr().Get(time)) for time in range(3)]
    assert counts[0] == 2 * 144 + 4 * 24
    assert counts[-1] == len(free) != counts[0]


def test_momentum_is_kept_as_elements_fail():
    impact = begun(pierced(), duration=1e-5)
    model = impact.solver.model
    before = model.mass @ model.V
    impact.advance()
    assert impact.exposed
    assert len(impact.exposed.passes[0].face) > len(model.passes[0].face)
    after = model.mass @ impact.state.v.numpy()
    np.testing.assert_allclose(after, before, atol=1e-6 * abs(before[2]))


def test_nodes_without_elements_fly_on():
    impact = begun(pulled(replace(STEEL, failure=mca.PrincipalStressFailure(stress=5e8)), 20.0, 3e-6))
    impact.advance()
    (own,) = (item.failing for item in impact.state.elements)
    block = impact.solver.model.blocks[0]
    failed = own.age.numpy() < 0
    loose = np.setdiff1d(block.conn[:, failed], block.conn[:, ~failed])
    free = np.setdiff1d(loose, impact.solver.model.prescribed_node)
    assert failed.any() and len(free)
    v = impact.state.v.numpy()[free]
    impact.solver.step(impact.state, 5)
    np.testing.assert_array_equal(impact.state.v.numpy()[free], v)


def test_a_run_goes_on_from_a_stored_state_with_equal_bits(tmp_path):
    whole, other = begun(pierced(), duration=8e-6), begun(pierced(), duration=8e-6)
    half = whole.steps.per_interval * (whole.steps.intervals * 3 // 4)
    whole.advance(until=half)
    assert sum(int(item.failing.left.numpy().sum()) for item in whole.state.elements if item.failing)
    whole.save(tmp_path / "state.npz")
    whole.advance()
    other.load(tmp_path / "state.npz")
    other.advance()
    assert whole.state.differences(other.state) == []


def test_threads_do_not_change_bits(monkeypatch):
    from impacts import SHORT_RANGES

    for name, value in SHORT_RANGES.items():
        monkeypatch.setattr(name, value)
    one, two = (begun(pierced(), duration=4e-6, threads=n) for n in (1, 2))
    for impact in (one, two):
        impact.advance()
    assert two.solver.threads == 2
    assert [name for name in one.state.differences(two.state) if name != "normal_force"] == []


def test_scenes_of_a_batch_fail_as_alone():
    scenes = [pulled(replace(SOFT, failure=mca.PlasticStrainFailure(strain=s)), 20.0, 2e-5) for s in (0.01, 0.02)]
    together = mca.run_batch(scenes)
    for scene, found in zip(scenes, together, strict=True):
        alone = mca.run(scene)
        assert found.summary["energy"] == alone.summary["energy"]
        assert found.summary["failure"] == alone.summary["failure"]
        assert alone.summary["failure"]["bar"]["elements"]
    plain = replace(scenes[0], bodies=(replace(scenes[0].bodies[0], material=ALUMINIUM),))
    with pytest.raises(RequestError, match="batches apart"):
        mca.run_batch([scenes[0], plain])
    with pytest.raises(RequestError, match="run in place of run_batch"):
        mca.run_batch([pierced(), pierced(200.0)])


def test_every_criterion_is_kept_in_model_files(tmp_path):
    criteria = (
        mca.PlasticStrainFailure(strain=0.2, reference_length=1e-3),
        mca.JohnsonCookFailure(D1=0.1, D2=0.2, D3=-1.5, length_exponent=1.0),
        mca.PrincipalStressFailure(stress=1e9),
        mca.PrincipalStrainFailure(strain=0.1),
    )
    for failure in criteria:
        scene = pulled(replace(SOFT, failure=failure), 1.0, 1e-6)
        save(tmp_path / "a.mca", scene, mca.mesh(scene))
        assert load(tmp_path / "a.mca").scene.bodies == scene.bodies


def test_principal_strain_fails_at_its_strain():
    result = mca.run(pulled(replace(STEEL, failure=mca.PrincipalStrainFailure(strain=0.004)), 1.0, 5e-5, (4, 1, 1)))
    way = result.summary["failure"]["bar"]["time"] - 0.5 * 0.05 * 5e-5
    assert np.log1p(way / LENGTH) == pytest.approx(0.004, rel=0.02)


def test_what_does_not_go_with_failure_is_refused():
    scene = pierced()
    for more, words in (
        ({"contacts": (mca.ContactAll(),)}, "ContactAll.*list their pairs"),
        ({"contacts": (replace(scene.contacts[0], bond=mca.Bond(), two_way=None),)}, "Bond"),
        ({"contacts": (replace(scene.contacts[0], initial_overlap="press"),)}, "press"),
        ({"phases": (mca.Settle(),), "gravity": (0.0, 0.0, -9.81)}, "may fail in an impact alone"),
    ):
        with pytest.raises(RequestError, match=words):
            replace(scene, **more)
    with pytest.raises(RequestError, match=r"multi_rate.*may fail"):
        mca.run(scene, multi_rate=2)
    link = mca.make_scene("single_link")
    weak = replace(STEEL, failure=mca.PrincipalStressFailure(stress=1e9))
    link = replace(link, bodies=tuple(replace(body, material=weak) for body in link.bodies))
    with pytest.raises(RequestError, match=r"pure-fem.*may fail"):
        mca.run(link, method="pure-fem")
    with pytest.raises(RequestError, match=r"t_end.*cannot become rigid again"):
        replace(link, t_end=1.0)
    tets = tuple(replace(body, element="tet4") for body in scene.bodies)
    with pytest.raises(RequestError, match=r"tet4.*cannot fail"):
        mca.run(replace(scene, bodies=tets))
    with pytest.raises(RequestError, match=r"Elastic.failure.*needs plastic strain"):
        replace(STEEL, failure=mca.PlasticStrainFailure(strain=0.1))
    with pytest.raises(RequestError, match=r"Elastic.failure.*PlasticStrainFailure"):
        replace(STEEL, failure=0.1)
    for make in (
        lambda: mca.PlasticStrainFailure(strain=0.0),
        lambda: mca.PlasticStrainFailure(strain=0.1, reference_length=0.0),
        lambda: mca.PlasticStrainFailure(strain=0.1, length_exponent=2.0),
        lambda: mca.PrincipalStressFailure(stress=float("nan")),
        lambda: mca.JohnsonCookFailure(D1=-1.0, D2=0.5, D3=0.0),
        lambda: mca.JohnsonCookFailure(D1=1.0, D2=0.5, D3=0.0, rate_0=0.0),
        lambda: mca.JohnsonCookFailure(D1=1.0, D2=0.5, D3=0.0, least_strain=0.0),
    ):
        with pytest.raises(RequestError, match=r"Failure\.\w+ = "):
            make()


def test_a_strain_at_failure_below_the_least_one_counts_as_this():
    """In tension D1 + D2 exp(D3 / 3) is below 0: a bar breaks when another does that fails at the least strain."""
    floor = mca.JohnsonCookFailure(D1=-0.3, D2=0.31, D3=-1.0, least_strain=0.02)
    kinds = floor, mca.PlasticStrainFailure(strain=0.02), replace(floor, least_strain=1e-6)
    found = [mca.run(pulled(replace(ALUMINIUM, failure=kind), 20.0, 2e-5)).summary["failure"]["bar"] for kind in kinds]
    times = [own["time"] for own in found]
    assert times[0] == pytest.approx(times[1], abs=2e-7)
    assert times[2] < 0.5 * times[0]


@dataclass(frozen=True, kw_only=True)
class OwnFailure(StrainFailure):
    """Fails at a mean stress."""

    stress: float
    law = "spall"
    plastic = False

    @property
    def parameters(self) -> tuple[float, ...]:
        return (self.stress,)


def test_a_criterion_from_outside():
    """Waves of about 0.4 GPa from both ends meet."""
    mca.register(OwnFailure)
    try:
        for stress, fails in ((0.1e9, True), (3e9, False)):
            result = mca.run(pulled(replace(STEEL, failure=OwnFailure(stress=stress)), 20.0, 3e-6))
            assert bool(result.summary["failure"]["bar"]["elements"]) == fails
    finally:
        del FAILURES["OwnFailure"]


def test_a_run_stops_where_nothing_is_left_of_a_surface():
    """A brittle block bursts as a whole on a wall."""
    block = mca.Box(size=(2e-3, 2e-3, 2e-3), divisions=(1, 1, 1))
    glass = replace(STEEL, failure=mca.PrincipalStressFailure(stress=1e6))
    wall = mca.RigidPlane(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    body = mca.Body(name="block", geometry=block, material=glass, velocity=(0.0, 0.0, -20.0))
    contact = mca.Contact(slave=mca.Surface(body="block", nodes="boundary"), master=wall)
    impact = mca.ImpactPhase(duration=1e-5, output_interval=1e-7)
    with pytest.raises(GuardError, match=r"the surface boundary of body block have failed by t = \de-0[67] s; "):
        mca.run(mca.Scene(name="burst", bodies=(body,), contacts=(contact,), impact=impact))


def test_the_watch_looks_at_parts_that_holes_have_made():
    """A cube has no case of its own before a hole opens in it; what was seen of others stays."""
    scene = pierced(600.0)
    cube = mca.Box(size=(0.012, 0.012, 0.006), divisions=(6, 6, 3), origin=(-0.006, -0.006, -0.006))
    scene = replace(scene, bodies=(replace(scene.bodies[0], geometry=cube), scene.bodies[1]))
    impact = begun(scene, duration=8e-6)
    (watch,) = impact._watches
    before = [case.key for case in watch.cases]
    impact.advance()
    assert impact.stopped == [None]
    assert {case.key for case in watch.cases} > set(before)
    assert len(impact.state.scenes[0].passed) == len(watch.cases)


@pytest.mark.gpu
def test_a_gpu_pierces_the_plate_alike(through):
    found = mca.run(pierced(), device="cuda:0")
    assert found.summary["energy_error"] < 2e-3
    assert found.summary["failure"]["plate"]["elements"] == pytest.approx(
        through.summary["failure"]["plate"]["elements"], rel=0.1
    )
