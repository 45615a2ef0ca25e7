"""Scenes on groups and spheres: q has more numbers than v."""

import numpy as np
import pytest

import diracstep as ds


@pytest.fixture
def top():
    return ds.load("heavy_top_so3")


def test_shapes_and_names(top):
    assert top.coordinates == ["R_1", "R_2", "R_3"] and top.positions == ["R_w", "R_x", "R_y", "R_z"]
    assert top.start_q.shape == (4,) and top.start_v.shape == (3,)
    run = top.run(until=0.1)
    assert run.q.shape == (len(run), 4) and run.v.shape == run.p.shape == (len(run), 3)
    assert np.abs(np.linalg.norm(run.q, axis=1) - 1.0).max() < 1e-14
    assert np.array_equal(run["R_x"], run.q[:, 1]) and np.array_equal(run["v_R_2"], run.v[:, 1])
    assert run.table() is not None and len(run.plot().lines) == 4
    flat = ds.load("knife_edge")
    assert flat.positions == flat.coordinates


def test_steps_by_hand_starts_and_snapshots(top):
    integrator = top.integrator(step=0.002)
    integrator.step(5)
    state, saved = integrator.state(), integrator.save()
    assert state.q.shape == (4,) and state.v.shape == (3,)
    integrator.step(5)
    later = integrator.state().q
    integrator.restore(saved)
    integrator.step(5)
    assert np.array_equal(integrator.state().q, later)
    turned = np.array([np.cos(0.3), 0.0, 0.0, np.sin(0.3)])  # about the vertical, which changes nothing but the picture
    integrator.reset(q=turned, v=top.start_v)
    integrator.step(5)
    assert integrator.state().v == pytest.approx(state.v, rel=1e-10)
    integrator.reset(q=dict(zip(top.positions, turned)))
    with pytest.raises(ds.Misuse, match=r"\(4,\) is needed"):
        integrator.reset(q=[0.0, 0.0, 0.0])
    with pytest.raises(ds.Misuse, match="no coordinate 'R_1'"):
        integrator.reset(q={"R_1": 1.0})


def test_ensembles_times_and_variable_steps(top):
    ends = top.ensemble(np.tile(top.start_q, (3, 1)), until=0.05)
    run = top.run(until=0.05)
    assert ends.q.shape == (3, 4) and np.array_equal(ends.q, np.tile(run.q[-1], (3, 1)))
    with pytest.raises(ds.Misuse, match=r"\(3, 4\) is needed"):
        top.ensemble(np.zeros((3, 3)))
    assert top.run(at=[0.01, 0.0234], step=0.005).q.shape == (2, 4)


def test_a_sphere_beside_its_closed_form():
    pendulum = ds.load("conical_pendulum_s2")
    run = pendulum.run(until=1.0)
    turn = np.sqrt(-pendulum.parameters["g"] / (pendulum.parameters["l"] * np.cos(pendulum.parameters["polar"])))
    w, x, y, z = run.q.T
    place = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])  # R e3
    polar = pendulum.parameters["polar"]
    exact = np.array([np.sin(polar) * np.cos(turn * run.t), np.sin(polar) * np.sin(turn * run.t), np.cos(polar) + 0 * run.t])
    assert np.abs(place - exact).max() < 1e-8


def test_what_knows_flat_scenes_only_says_so(top):
    for call in (lambda: top.run(until=0.01).gradient({"q": [1, 0, 0, 0]}), lambda: top.run(until=0.01).jvp(q=[1, 0, 0, 0]),
                 lambda: top.boundary({"R_w": 1.0}), lambda: top.boundary([1.0, 0.0, 0.0, 0.0]),
                 lambda: top.fit({"t": [0.1], "R_1": [1.0]}, ["m"])):
        with pytest.raises(ds.Misuse, match="R\\^n"):
            call()


@pytest.mark.parametrize("q, words", [([2.0, 0, 0, 0], "is not on SO3, by 1: .* length 1$"), ([0.0, 0, 0, 0], "one here has none"),
                                      ([np.nan, 0, 0, 0], "finite numbers")])
def test_a_start_that_is_no_rotation_is_refused(top, q, words):
    with pytest.raises(ds.Misuse, match=words):
        top.integrator(step=0.001).reset(q=q)
    with pytest.raises(ds.Misuse, match=words):
        top.ensemble([q], steps=1)


def turning(rows=""):
    return ('name = "turning"\nlagrangian = "(w_R[1]^2 + w_R[2]^2 + w_R[3]^2 + v_x^2)/2 - R[3,3]"\n'
            '[coordinates]\nR = "SO3"\nx = {}\n[start]\nR = { axis = [1, 0, 0], angle = 0.3 }\nv_x = 1\n[span]\nend = 0.5\nstep = 0.05\n' + rows)


def row(equation, name="r"):
    return f'[[rows]]\nname = "{name}"\nequation = "{equation} = 0"\n'


@pytest.mark.parametrize("equation, words", [
    ("w_R[1]*v_x", r"row 'r' is not linear in w_R\[1\] \(v_R_1, in the body frame of R\)"), ("v_x^2", "row 'r' is not linear in v_x;"),
    ("v_R_w", r"unknown name 'v_R_w' in row 'r'; the velocity of R, in its body frame, is w_R\[1\], w_R\[2\], w_R\[3\]"),
    ("v_R[1]", r"unknown name 'v_R' in row 'r'; the velocity of R"),
])
def test_messages_name_velocities_as_files_write_them(equation, words):
    with pytest.raises(ds.Misuse, match=words):
        ds.parse(turning(row(equation)))


def test_redundant_rows_are_left_out_where_they_stay_so():
    tilted = row("R[3,3] - cos(0.3)")
    once, twice = ds.parse(turning(tilted)).run(), ds.parse(turning(tilted + row("2*R[3,3] - 2*cos(0.3)", "r2"))).run()
    assert np.allclose(once.q, twice.q, atol=1e-12) and twice.lambda_.shape == (len(twice), 2)
    # Turned about the first axis alone, R[1,1] = 1 is where all its derivatives vanish.
    with pytest.raises(ds.Misuse, match="'r'; not so at poses near it: the start is singular"):
        ds.parse(turning(row("R[1,1] - 1"))).run()
