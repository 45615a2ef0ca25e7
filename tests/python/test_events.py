"""Events, outputs, inputs, states, and times of one's own."""

import json
import os
import subprocess
import warnings

import numpy as np
import pytest

import diracstep as ds

BALL = """
name = "ball"
lagrangian = "v_y^2/2 - 9.81*y"
[coordinates]
y = { unit = "m" }
[states]
n = {}
[start]
y = 1
[span]
end = 1.5
step = 0.01
[outputs]
count = "n"
twice = "2*y"
[[events]]
name = "floor"
when = "y"
restitution = 0.5
set = { n = "n + 1" }
[[events]]
name = "top"
when = "v_y"
direction = "falling"
if = "n > 0.5"
action = "stop"
"""
FIRST = np.sqrt(2 / 9.81)  # when it is at the floor; at e = 1/2 it takes half of that up again


@pytest.fixture
def ball():
    return ds.parse(BALL)


def test_events_act_in_runs_and_are_told(ball):
    assert ball.events == {"floor": "act", "top": "stop"} and ball.outputs == ["count", "twice"]
    run = ball.run()
    assert [event.name for event in run.events] == ["floor", "top"]
    first, last = run.events[0], run.events[-1]
    assert first.t == pytest.approx(FIRST, abs=1e-12) and first.impulse == pytest.approx(1.5 * 9.81 * FIRST, rel=1e-10)
    assert first.after_v[0] == pytest.approx(-0.5 * first.v[0], rel=1e-10) and first.after_q[1] == first.q[1] + 1
    assert last.after_q is None and np.isnan(last.impulse)
    assert run.stopped and run.t[-1] == last.t == pytest.approx(1.5 * FIRST, abs=1e-12)
    assert np.array_equal(run["twice"], 2 * run["y"]) and set(run["count"]) == {0.0, 1.0}
    assert run.outputs.shape == (len(run), 2)
    table = run.table()
    names = table.dtype.names if isinstance(table, np.ndarray) else list(table.columns)
    assert {"count", "twice"} <= set(names)


def test_events_act_where_steps_vary(ball):
    run = ball.run(adaptive=True)
    assert [event.name for event in run.events] == ["floor", "top"]
    assert run.t[-1] == pytest.approx(1.5 * FIRST, abs=1e-8) and run.statistics.step == 0.0


def test_events_act_in_steps_by_hand(ball):
    integrator = ball.integrator()
    integrator.step(60)
    assert [event.name for event in integrator.events] == ["floor"] and integrator.state().outputs[0] == 1.0
    saved, at = integrator.save(), integrator.state()
    integrator.step(1000)
    assert integrator.stopped and integrator.time == pytest.approx(1.5 * FIRST, abs=1e-12)
    with pytest.raises(ds.Misuse, match="ended the motion"):
        integrator.step()
    integrator.restore(saved)
    assert not integrator.stopped and np.array_equal(integrator.state().q, at.q)
    integrator.reset(q={"y": 2.0}, v={})
    assert integrator.events == []
    integrator.step(70)
    assert integrator.events[0].t == pytest.approx(np.sqrt(2) * FIRST, abs=1e-12)


def test_events_act_in_ensembles(ball):
    ends = ball.ensemble([[1.0, 0.0], [2.0, 0.0], [1e4, 0.0]], np.zeros((3, 2)))
    assert ends.t[:2] == pytest.approx([1.5 * FIRST, 1.5 * np.sqrt(2) * FIRST], abs=1e-12) and ends.t[2] == pytest.approx(1.5)
    assert list(ends.outputs[:, 0]) == [1.0, 1.0, 0.0]


def test_a_clock_samples_and_holds():
    scene = ds.parse("""
name = "sampled"
lagrangian = "v_x^2"
[coordinates]
x = {}
[states]
u = {}
[force]
x = "u"
[span]
end = 1
step = 0.02
[[events]]
name = "sample"
every = 0.25
set = { u = "4*(1 - x) - 3*v_x" }
""")
    run = scene.run()
    assert [event.t for event in run.events] == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])
    x, v, times = 0.0, 0.0, [0.0]
    for k in range(4):  # 2 x'' = u, u constant between two times of the clock
        u = 4 * (1 - x) - 3 * v
        x, v = x + v / 4 + u / 64, v + u / 8
        times.append(x)
    assert [event.q[0] for event in run.events] == pytest.approx(times, abs=1e-12)


def test_an_error_asked_for_goes_through_events():
    text = BALL.replace('9.81*y"', '9.81*y - y^2/2"')
    run = ds.parse(text).run(error=1e-9)
    down = np.arccos(9.81 / 10.81)  # y = 10.81 cos t - 9.81, then up with half of the speed
    up = 10.81 * np.sin(down) / 2
    assert [event.name for event in run.events] == ["floor", "top"] and run.search.estimate < 1e-9
    assert run.events[0].t == pytest.approx(down, abs=1e-8) and run.events[0].after_v[0] == pytest.approx(up, abs=1e-7)
    assert run.stopped and run.t[-1] == run.events[-1].t == pytest.approx(down + np.arctan(up / 9.81), abs=1e-8)
    assert set(run["count"]) == {0.0, 1.0} and "stopped=True" in repr(run.search)
    with pytest.raises(ds.Misuse, match="steps of fixed size"):
        run.jacobian()
    with pytest.raises(ds.Failure) as refused:
        ds.parse(text).run(error=1e-9, max_solves=300)
    assert len(refused.value.run) == 1 and not refused.value.run.events


def test_what_does_not_go_with_events_is_refused(ball):
    with pytest.raises(ds.Misuse, match="events"):
        ball.run(error=1e-6, adaptive=True)
    with pytest.raises(ds.Misuse, match="events"):
        ball.run(steps=3).gradient({"q": [1.0, 0.0]})
    with pytest.raises(ds.Misuse, match="events"):
        ball.integrator().jacobian(3)


def test_rows_that_are_off_have_no_force():
    scene = ds.load(os.path.join(os.path.dirname(__file__), "../../scenes/rocking_block.toml"))
    run = scene.run()
    assert scene.rows == ["left_pin", "left_floor", "right_pin", "right_floor"] and run.lambda_.shape == (len(run), 4)
    assert np.array_equal(run["carried"], run["left_floor"] + run["right_floor"])
    left = run.t < run.events[0].t
    assert not run["right_floor"][left].any() and run["left_floor"][left].all()


CART = """
name = "cart"
lagrangian = "v_x^2"
[coordinates]
x = {}
[inputs]
wanted = { times = [0, 1, 3, 4], values = [0, 0, 2, 2] }
[states]
lag = { rate = "(x - lag)/0.2" }
[force]
x = "10*(wanted - x) - 4*v_x"
[outputs]
off = "wanted - x"
[span]
end = 4.0
step = 0.02
"""


def test_inputs_states_and_outputs():
    scene = ds.parse(CART)
    assert scene.inputs == {"wanted": (0.0, 4.0)} and scene.coordinates == ["x", "lag"]
    run = scene.run()
    assert np.allclose(run["off"], np.interp(run.t, [0, 1, 3, 4], [0, 0, 2, 2]) - run["x"], atol=1e-13)
    with pytest.raises(ds.Misuse, match="wanted"):
        scene.run(until=5.0)


def test_circuits_tell_powers_and_voltages():
    scene = ds.parse("""
name = "divider"
[[source_voltage]]
name = "V"
nodes = ["ground", "a"]
value = 6
[[resistor]]
name = "R"
nodes = ["a", "b"]
value = 2
[[inductor]]
name = "L"
nodes = ["b", "ground"]
value = 1e-3
[outputs]
across = "V(b)"
lost = "P(R)"
[span]
end = 5e-3
step = 1e-4
""")
    run = scene.run()
    current = 3 * (1 - np.exp(-2000 * run.t))
    assert np.allclose(run["across"], 6 - 2 * current, atol=1e-6) and np.allclose(run["lost"], 2 * current**2, atol=1e-6)


def test_times_of_ones_own_are_those_of_the_command(tmp_path):
    file = tmp_path / "cart.toml"
    file.write_text(CART)
    out = tmp_path / "out.csv"
    for options, ours in ((["--every-time", "0.3"], {"every_time": 0.3}), (["--at", "0.5,1.25,3.999"], {"at": [0.5, 1.25, 3.999]}),
                          (["--at", "0.5,1.25", "--adaptive"], {"at": [0.5, 1.25], "adaptive": True})):
        subprocess.run([os.environ["DIRACSTEP_COMMAND"], "run", str(file), *options, "--out", str(out)], check=True, capture_output=True)
        names = [line for line in out.read_text().splitlines() if not line.startswith("#")][0].split(",")
        theirs = np.loadtxt(out, delimiter=",", skiprows=1, comments="#")
        run = ds.load(file).run(**ours)
        assert np.array_equal(theirs[:, 0], run.t)
        for name in ("x", "lag", "v_x", "p_x", "off"):
            assert np.array_equal(theirs[:, names.index(name)], run[name]), (options, name)
    for wrong in (0.0, -1.0, np.nan, 1e-12):
        with pytest.raises(ds.Misuse):
            ds.load(file).run(every_time=wrong)


def test_times_of_ones_own_go_through_events(tmp_path):
    file = tmp_path / "ball.toml"
    file.write_text(BALL)
    out = tmp_path / "out.csv"
    at = [0.1, 0.3, 0.5, 0.8]  # the last is behind the end
    for options, ours in (([], {}), (["--adaptive"], {"adaptive": True}), (["--error", "1e-8"], {"error": 1e-8})):
        command = [os.environ["DIRACSTEP_COMMAND"], "run", str(file), *options, "--at", ",".join(map(str, at)), "--out", str(out)]
        subprocess.run(command, check=True, capture_output=True)
        theirs = np.loadtxt(out, delimiter=",", skiprows=1, comments="#")
        run = ds.load(file).run(at=at, **ours)
        assert np.array_equal(theirs[:, 0], run.t) and np.array_equal(theirs[:, 1], run["y"]), options
        assert run["y"][0] == pytest.approx(1 - 9.81 * 0.01 / 2, abs=1e-10) and list(run["count"]) == [0.0, 0.0, 1.0]


def test_steps_by_hand_and_ensembles_warn_of_doubts():
    stiff = ds.Scene(["x"], lambda q, v: v.x**2 / 2 - 1e4 * q.x**4 / 4, q=[1.0], until=10.0, step=0.025)
    integrator = stiff.integrator()
    integrator.step(400)
    with pytest.warns(ds.Doubt, match="scene: "):
        integrator.state()
    with warnings.catch_warnings():
        warnings.simplefilter("error", ds.Doubt)
        integrator.state()  # once for each reason
    assert integrator.doubt
    integrator.reset()
    assert not integrator.doubt
    with pytest.warns(ds.Doubt, match="member 0: "):
        ends = stiff.ensemble([[1.0], [1.0]])
    assert 0 in ends.doubts and not ends.failures


def test_steps_that_are_chosen_for_damping_vary():
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
    run = load.run()
    assert run.statistics.method == "damped/radau:3" and run.statistics.step == 0.0
    for fixed in ({"adaptive": False}, {"steps": 26}, {"step": 5e-4}):
        run = load.run(**fixed)
        assert run.statistics.method == "damped/radau:3" and run.statistics.step == pytest.approx(5e-4), fixed
    assert load.integrator().statistics.step == 5e-4
    assert json.loads(subprocess.run([os.environ["DIRACSTEP_COMMAND"], "run", "knife_edge", "--json"], check=True,
                                     capture_output=True, text=True).stdout)["step"] == ds.load("knife_edge").run().statistics.step
