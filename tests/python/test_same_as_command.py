"""Runs of the whole catalogue beside those of the command: the same method, steps, bits, doubts and events."""

import json
import os
import subprocess
import warnings
from pathlib import Path

import numpy as np
import pytest

import diracstep as ds

SCENES = sorted((Path(__file__).parents[2] / "examples" / "scenes").glob("*.toml"))


def of_verb(verb, scene, *options):
    done = subprocess.run([os.environ["DIRACSTEP_COMMAND"], verb, str(scene), "--json", *options], capture_output=True, text=True)
    assert done.stdout, done.stderr
    return json.loads(done.stdout)


def of_command(scene, *options):
    return of_verb("run", scene, "--out", "run.csv", "--every", "7", *options)


# A rectifier: the charge of its capacitor, whose ripple is slow beside what the diode damps.
RECTIFIER = """
name = "rectifier"
[[source_voltage]]
name = "V"
nodes = ["ground", "in"]
value = "5*sin(100*pi*t)"
[[diode]]
name = "D"
nodes = ["in", "out"]
on = 0.1
off = 1e6
[[capacitor]]
name = "C"
nodes = ["out", "ground"]
value = 1e-4
[[resistor]]
name = "R"
nodes = ["out", "ground"]
value = 1000
[outputs]
kept = "V(out)"
[span]
end = 0.03
step = 5e-4
"""


def quietly(scene, **options):
    """The run, also where it is doubted or fails."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ds.Doubt)
        try:
            return scene.run(**options)
        except ds.Failure as failure:
            return failure.run


def assert_same(run, theirs):
    assert run.statistics.method == theirs["method"] and run.statistics.order == theirs["order"]
    assert run.statistics.steps == theirs["steps"]
    assert run.t[-1] == theirs["end"]["t"] and run.energy[-1] == theirs["end"]["energy"]
    for what, columns, names in (("q", run.q, run.scene.positions), ("v", run.v, run.scene.coordinates), ("p", run.p, run.scene.coordinates)):
        assert np.array_equal(columns[-1], [theirs["end"][what][name] for name in names], equal_nan=True), what
    assert np.array_equal(run.lambda_[-1], [theirs["end"]["lambda"][name] for name in run.scene.rows])
    assert {name: run[name][-1] for name in run.scene.outputs} == theirs["outputs"]
    assert run.stopped == theirs["stopped"] and run.doubt == (theirs["doubt"] or "")
    assert [(event.name, event.t) for event in run.events] == [(event["name"], event["t"]) for event in theirs["events"]]
    for ours, event in zip(run.events, theirs["events"]):
        assert list(ours.q) == list(event["q"].values()) and list(ours.v) == list(event["v"].values())
        assert (ours.after_q is None) == ("after" not in event)
        if ours.after_q is not None:
            assert list(ours.after_v) == list(event["after"]["v"].values())
        assert event.get("impulse") is None or event["impulse"] == ours.impulse


@pytest.mark.parametrize("name", list(ds.catalogue))
def test_a_run_without_options_is_that_of_the_command(name):
    scene = ds.load(name)
    span = scene.until - scene.start_time
    # large scenes, and long motions, take a part of their time
    until = scene.until if abs(span / scene.step) * len(scene.coordinates) < 3000 else scene.start_time + 0.1 * span
    assert_same(quietly(scene, until=until, every=7), of_command(name, "--end", repr(until)))


@pytest.mark.parametrize("file", SCENES, ids=lambda path: path.stem)
def test_a_run_of_an_example_is_that_of_the_command(file):
    assert_same(quietly(ds.load(file), every=7), of_command(file))


@pytest.fixture
def rectifier(tmp_path):
    file = tmp_path / "rectifier.toml"
    file.write_text(RECTIFIER)
    return file


@pytest.mark.parametrize("options, ours", [
    ([], {}), (["--step", "1e-4"], {"step": 1e-4}), (["--adaptive"], {"adaptive": True}), (["--order", "4"], {"order": 4}),
    (["--adaptive", "--eps", "1e-5"], {"eps": 1e-5}), (["--end", "0.011"], {"until": 0.011}), (["--substeps", "4"], {"substeps": 4}),
])
def test_options_mean_the_same_where_the_motion_is_damped(rectifier, options, ours):
    assert_same(quietly(ds.load(rectifier), every=7, **ours), of_command(rectifier, *options))


@pytest.mark.parametrize("name", ["knife_edge", "pendulum_cartesian", "lc_circuit", "flyball_governor"])
@pytest.mark.parametrize("options, ours", [
    (["--adaptive"], {"adaptive": True}), (["--order", "4"], {"order": 4}), (["--momentum", "minus"], {"momentum": "minus"}),
    (["--method", "type1/midpoint", "--step", "0.0123"], {"method": "type1/midpoint", "step": 0.0123}),
])
def test_options_mean_the_same(name, options, ours):
    until = min(2.0, ds.load(name).until)
    assert_same(quietly(ds.load(name), every=7, until=until, **ours), of_command(name, "--end", repr(until), *options))


@pytest.mark.parametrize("name", ["knife_edge", "kepler_e06"])
def test_a_search_ends_where_that_of_the_command_does(name):
    run, theirs = ds.load(name).run(error=1e-6, until=3.0, every=7), of_command(name, "--error", "1e-6", "--end", "3.0")
    assert run.search.method == theirs["method"] and run.search.order == theirs["order"]
    assert run.search.estimate == theirs["error_control"]["estimate"]
    assert list(run.q[-1]) == list(theirs["end"]["q"].values())


def matrix(document, what, like):
    return np.array(document[what]).reshape(like.shape)


@pytest.mark.parametrize("name, options, ours", [
    ("hanging_chain", ["--set", "N=3"], {}), ("flyball_governor", ["--along"], {"along": True}),
    ("hanging_chain", ["--modes", "3", "--near", "1"], {"modes": 3, "near": 1.0}),
])
def test_an_equilibrium_is_that_of_the_command(name, options, ours):
    scene = ds.load(name, N=3) if "N=3" in options else ds.load(name)
    found, theirs = scene.equilibrium(**ours), of_verb("equilibrium", name, *options)
    assert (found.t, found.iterations, found.doubt) == (theirs["t"], theirs["iterations"], theirs["doubt"] or "")
    for what, values in (("q", found.q), ("v", found.v), ("lambda", found.lambda_)):
        assert list(values) == list(theirs[what].values()), what
    assert [[value.real, value.imag] for value in found.eigenvalues] == [mode["eigenvalue"] for mode in theirs["modes"]]
    assert [[[z.real, z.imag] for z in mode] for mode in found.modes] == [list(mode["mode"].values()) for mode in theirs["modes"]]
    assert (found.zeros, found.stability, found.variation) == (theirs["zero_eigenvalues"], theirs["stability"], theirs["variation"])
    assert found.zeros_below == theirs["zeros_below"]
    assert [list(free) for free in found.free_directions] == [list(free.values()) for free in theirs["free_directions"]]
    assert found.near == theirs.get("near")
    for what in ("positions", "velocities", "drift", "mass", "damping", "stiffness"):
        values = getattr(found, what)
        assert (values is None) == (what not in theirs)
        assert values is None or np.array_equal(values, matrix(theirs, what, values)), what


@pytest.mark.parametrize("name", ["andrews_squeezer", "lotka_volterra_2d", "heavy_top_so3", "lc_circuit"])
def test_a_start_is_that_of_the_command(name):
    found, theirs = ds.load(name).start(), of_verb("start", name)
    for what, values in (("q", found.q), ("v", found.v), ("p", found.p)):
        assert list(values) == list(theirs[what].values()), what
    assert [found.lambda_[k] for k, row in enumerate(ds.load(name).rows)] == [theirs["lambda"][row] for row in ds.load(name).rows]
    assert found.energy == theirs["energy"]
    assert np.array_equal(found.acceleration, list((theirs["acceleration"] or {"": np.nan}).values()), equal_nan=True) \
        or np.isnan(found.acceleration).all() and theirs["acceleration"] is None
    assert list(found.origin.values()) == [*theirs["origin"]["q"].values(), *theirs["origin"]["v"].values()]


def test_a_fit_is_that_of_the_command(tmp_path):
    run = ds.load("chaplygin_sleigh", a=0.22).run(until=4.0)
    file = tmp_path / "data.csv"
    lines = [",".join(["" if k % 5 == 2 else repr(x), repr(v)]) for k, (x, v) in enumerate(zip(run["x"].tolist(), run["v_th"].tolist()))]
    file.write_text("t,x,v_th\n" + "".join(f"{t!r},{line}\n" for t, line in zip(run.t.tolist(), lines)))
    theirs = of_verb("fit", "chaplygin_sleigh", str(file), "--parameters", "a,J", "--from", "a=0.3", "--sigma", "x=0.5")
    x = np.where(np.arange(len(run)) % 5 == 2, np.nan, run["x"])
    for data in (file, {"t": run.t, "x": x, "v_th": run["v_th"]}):
        found = ds.load("chaplygin_sleigh").fit(data, ["a", "J"], start={"a": 0.3}, sigma={"x": 0.5})
        assert found.parameters == {name: entry["value"] for name, entry in theirs["parameters"].items()}
        assert found.intervals == {name: entry["interval"] for name, entry in theirs["parameters"].items()}
        assert found.covariance.tolist() == theirs["covariance"] and found.ending == theirs["ending"]
        assert (found.motions, found.measured, found.residual) == (theirs["motions"], theirs["measured"], theirs["residual"])
