"""Runs: their arrays, their ends, searches, ensembles."""

import numpy as np
import pytest

import diracstep as ds


def test_arrays_own_their_memory_and_have_a_row_for_each_point(skate):
    run = skate.run(step=0.1, until=1.0)
    assert len(run) == 11 and run.t[-1] == 1.0
    for array, shape in ((run.q, (11, 3)), (run.v, (11, 3)), (run.p, (11, 3)), (run.lambda_, (11, 1)), (run.energy, (11,))):
        assert array.shape == shape and array.flags.owndata and array.flags.c_contiguous
    assert np.shares_memory(run["x"], run.q) and run["v_ph"][0] == 1.0
    with pytest.raises(KeyError, match="blade"):
        run["z"]


def test_a_run_is_the_one_of_the_command(skate, tmp_path):
    import os
    import subprocess

    file = tmp_path / "run.csv"
    subprocess.run([os.environ["DIRACSTEP_COMMAND"], "run", "knife_edge", "--method", "type1/gl:2", "--step", "0.03", "--end", "2",
                    "--every", "5", "--out", str(file)], check=True, capture_output=True)
    names = [line for line in file.read_text().splitlines() if not line.startswith("#")][0].split(",")
    theirs = np.loadtxt(file, delimiter=",", skiprows=1, comments="#")
    ours = skate.run(method="type1/gl:2", step=0.03, until=2.0, every=5)
    assert np.array_equal(theirs[:, names.index("t")], ours.t)
    for name in ("x", "ph", "v_x", "p_y", "energy"):
        assert np.array_equal(theirs[:, names.index(name)], ours[name]), name


def test_every_steps_and_times(skate):
    run = skate.run(steps=25, every=10, step=0.1)
    assert np.allclose(run.t, [0, 1, 2, 2.5])
    run = skate.run(at=[0.0, 0.33, 1.0], step=0.1)
    assert list(run.t) == [0.0, 0.33, 1.0]
    back = skate.run(until=-1.0, step=-0.1)
    assert back.t[-1] == -1.0 and len(back) == 11


def test_steps_that_vary(spring):
    kepler = ds.load("kepler_e06")
    run = kepler.run(adaptive=True, method="type1/gl:3", until=20.0)
    assert run.t[-1] == 20.0 and 0 < run.statistics.smallest < 0.5 * run.statistics.largest
    assert len(run) == run.statistics.steps + 2 or len(run) == run.statistics.steps + 1
    many = kepler.run(eps=0.01, method="type1/gl:2", until=20.0)
    assert len(many) > 1100 and many.q.flags.owndata  # more than there was room for at first


def test_steps_that_vary_are_damped_where_the_motion_is():
    load = ds.parse("""
name = "load"
lagrangian = "1e-3*v_q^2/2"
[coordinates]
q = {}
[force]
q = "5 + sin(100*pi*t) - 1000*v_q"
[span]
end = 0.013
step = 5e-4
""")
    run = load.run(adaptive=True, until=0.013)
    assert run.statistics.method == "damped/radau:3"
    w, r, inductance = 100 * np.pi, 1000.0, 1e-3
    current = 5 / r + (r * np.sin(w * 0.013) - w * inductance * np.cos(w * 0.013)) / (r * r + (w * inductance) ** 2)
    assert run["v_q"][-1] == pytest.approx(current, abs=1e-8)
    assert "damped" not in ds.load("kepler_e06").run(adaptive=True, until=2.0).statistics.method


def test_an_error_is_asked_for(spring):
    run = spring.run(error=1e-9)
    assert run["x"][-1] == pytest.approx(np.cos(6.0), abs=1e-9)
    assert run.search.estimate < 1e-9 and len(run.search.runs) >= 2 and run.search.method.startswith("type1/")
    with pytest.raises(ds.Failure) as refusal:
        spring.run(error=1e-12, max_solves=5)
    assert refusal.value.run is not None
    with pytest.raises(ds.Misuse, match="error"):
        spring.run(error=-1.0)


def test_invariants_and_momenta(spring):
    run = spring.run(step=0.1)
    assert np.ptp(run["total"]) < 1e-8
    assert spring.run(steps=3, momentum="minus").p.shape == (4, 1)
    with pytest.raises(ds.Misuse, match="not one of projected"):
        spring.run(momentum="other")


def test_doubts_are_warnings():
    stiff = ds.Scene(["x"], lambda q, v: v.x**2 / 2 - 1e4 * q.x**4 / 4, q=[1.0], until=10.0)
    with pytest.warns(ds.Doubt, match="scene"):
        run = stiff.run(step=0.025)
    assert run.doubt


def test_a_failure_has_the_librarys_text_and_what_was_computed():
    falling = ds.Scene(["x"], lambda q, v: v.x**2 / 2 - 1 / q.x**2 * -1.0, q=[1.0], until=100.0, step=0.05)
    with pytest.raises(ds.Failure, match="t = ") as failure:
        falling.run()
    run = failure.value.run
    assert 0 < len(run) and np.isfinite(run.q).all()


@pytest.mark.parametrize("arguments, words", [
    ({"step": 0.0}, "step is 0"), ({"step": "a"}, "a number"), ({"step": [0.1]}, "a number"), ({"until": np.nan}, "finite"),
    ({"every": 0}, "at least 1"), ({"every": 1.5}, "whole number"), ({"steps": 3, "until": 1.0}, "exclude"),
    ({"method": "type9/none"}, "type1/midpoint"), ({"metod": "a"}, "no argument 'metod'.*method"), ({"at": []}, "no times"),
    ({"at": [1.0, 0.5]}, "ahead"), ({"rule": "none"}, "midpoint"), ({"eps": -1.0}, "above 0"), ({"order": 3}, "order"),
    ({"method": 3}, "a text"), ({"solver": "mine"}, "newton"), ({"control": "mine", "adaptive": True}, "integrating"),
])
def test_misuse_is_named(skate, arguments, words):
    with pytest.raises(ds.Misuse, match=words):
        skate.run(**arguments)


def test_tables(skate):
    table = skate.run(step=0.5, until=2.0).table()
    names = table.dtype.names if isinstance(table, np.ndarray) else list(table.columns)
    assert names[0] == "t" and "blade" in names and table["x"][0] == 0.0


def test_an_ensemble_is_its_members(spring):
    starts = np.linspace(-2, 2, 21)[:, None]
    ends = spring.ensemble(starts, until=1.0, step=0.1)
    assert len(ends) == 21 and not ends.failures
    for k in (0, 10, 20):
        integrator = spring.integrator(until=1.0, step=0.1)
        integrator.reset(q=starts[k])
        integrator.step(10)
        assert integrator.state().q[0] == ends.q[k, 0]
    assert np.array_equal(ends.q, spring.ensemble(starts, until=1.0, step=0.1, threads=3).q)
    assert len(spring.ensemble(np.empty((0, 1)), until=1.0)) == 0
    later = spring.ensemble(starts, t=np.full(len(starts), 0.5), until=1.0, step=0.1)
    assert np.allclose(later.t, 1.0)
    assert np.allclose(later.q, spring.ensemble(starts, until=0.5, step=0.1).q, atol=1e-12)
    with pytest.raises(ds.Misuse, match="give the number of steps"):
        spring.ensemble(starts, t=np.arange(len(starts)), until=1.0, step=0.1)
    with pytest.raises(ds.Misuse, match="shape"):
        spring.ensemble(np.zeros((3, 2)))
    with pytest.raises(ds.Misuse, match="finite"):
        spring.ensemble([[np.inf]])


def test_an_ensemble_has_its_quantities_by_name(skate):
    ends = skate.ensemble(np.zeros((3, 3)), until=1.0, step=0.1)
    assert np.array_equal(ends["v_x"], ends.v[:, 0]) and np.array_equal(ends["blade"], ends.lambda_[:, 0])
    assert "blade" in ends and len(ends.table()) == 3
    with pytest.raises(KeyError, match="no quantity 'z'"):
        ends["z"]


def test_an_ensemble_names_the_members_that_fail():
    falling = ds.Scene(["x"], lambda q, v: v.x**2 / 2 + 1 / q.x**2, q=[1.0], until=3.0, step=0.05)
    ends = falling.ensemble([[1.0], [50.0]])
    assert set(ends.failures) == {0} and "t = " in ends.failures[0]
    assert ends.t[1] == pytest.approx(3.0)


def test_a_study_by_the_command(spring):
    study = spring.study(orders=[2, 4], steps=[0.1, 0.05], rtols=[1e-6], until=2.0, budget=0.02)
    assert len(study.rows) >= 5 and all(len(seconds) == len(error) for seconds, error in study.curves().values())
    assert study.plot().get_xlabel().startswith("CPU")


def test_drawing(skate, tmp_path):
    run = skate.run(step=0.1, until=2.0)
    assert len(run.plot().lines) == 3
    axes = run.plot("y", x="x")
    assert axes.get_xlabel() == "x [m]" and axes.get_ylabel() == "y [m]"
    animation = run.animate("x", "y", frames=3)
    animation.save(tmp_path / "skate.gif", writer="pillow")
    assert (tmp_path / "skate.gif").stat().st_size > 0


def test_rows_that_a_circuit_hides_are_not_written(tmp_path):
    """An integrator knows the voltage law of a source across a capacitor as a further row; the arrays have no room for it."""
    file = tmp_path / "across.toml"
    file.write_text("""
name = "across"
[[source_voltage]]
name = "V"
nodes = ["ground", "a"]
value = "sin(1000*t)"
[[capacitor]]
name = "C"
nodes = ["a", "ground"]
value = 1e-6
[span]
end = 1e-2
step = 1e-4
""")
    scene = ds.load(file)
    run = scene.run()
    assert run.lambda_.shape == (101, len(scene.rows)) and np.all(np.isfinite(run.lambda_))
    assert abs(run["qC"][-1]) == pytest.approx(1e-6 * abs(np.sin(10.0)), rel=1e-9)
    integrator = scene.integrator()
    integrator.step()
    assert integrator.state().lambda_.shape == (len(scene.rows),)


def test_a_body_that_is_held_still_is_not_doubted():
    # What pulls at it acts for 1e-5 of the first step, until the brake has taken it up: v = −g/c.
    held = ds.Scene(["y"], lambda q, v: v.y**2 / 2 - 9.81 * q.y, force=lambda v: {"y": -1e5 * v.y}, until=1.0, step=0.01)
    run = held.run(method="damped/radau:3", adaptive=False)
    assert run.doubt == "" and run["v_y"][-1] == pytest.approx(-9.81e-5, rel=1e-12)


def test_a_lag_too_fast_for_the_steps_is_told_where_it_runs():
    lag = ds.parse('name = "lag"\nlagrangian = "v_x^2/2"\n[coordinates]\nx = {}\n[states]\ny = { rate = "(sin(t) - y)/1e-9" }\n[span]\n'
                   'end = 1\nstep = 0.01\n')
    with pytest.raises(ds.Failure, match='by damped/radau:3, .*method="damped/radau:3", adaptive=True'):
        lag.run(method="type1/gl:3")
    assert lag.run(method="damped/radau:3", adaptive=True)["y"][-1] == pytest.approx(np.sin(1.0), rel=1e-6)
