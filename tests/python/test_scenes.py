"""Scenes from files, from text, from the catalogue and from functions."""

import copy
import pickle
import warnings

import numpy as np
import pytest

import diracstep as ds


def test_the_catalogue_is_a_mapping():
    assert "knife_edge" in ds.catalogue and len(list(ds.catalogue)) == len(ds.catalogue) > 20
    assert ds.catalogue["knife_edge"].coordinates == ["x", "y", "ph"]
    with pytest.raises(KeyError, match="knife_edge"):
        ds.catalogue["no_such_scene"]
    assert "Skate" in ds.catalogue._repr_html_()


def test_a_file_is_loaded_with_parameters(tmp_path, spring):
    file = tmp_path / "spring.toml"
    file.write_text(spring.text)
    scene = ds.load(file, k=4.0)
    assert scene.parameters == {"k": 4.0}
    assert scene.run(until=1.0)["x"][-1] == pytest.approx(np.cos(2.0), abs=1e-6)
    with pytest.raises(ds.Misuse, match="no parameter 'm'.*are k"):
        ds.load(file, m=1.0)
    with pytest.raises(ds.Misuse, match="missing.toml"):
        ds.load("missing.toml")


def test_text_is_parsed_and_its_faults_have_a_place():
    with pytest.raises(ds.Misuse, match="mine:2:.*'z'"):
        ds.parse('name = "a"\nlagrangian = "v_x^2 + z"\n[coordinates]\nx = {}\n[span]\nend = 1\nstep = 0.1\n', name="mine")


def test_parameters_change_without_tracing_again(spring):
    stiff = spring.with_parameters(k=4.0)
    assert stiff.run(until=1.0)["x"][-1] == pytest.approx(np.cos(2.0), abs=1e-6)
    assert spring.parameters == {"k": 1.0}
    assert stiff.with_parameters(k=9.0).parameters == {"k": 9.0}


def test_traced_rows_are_those_of_the_catalogue(skate):
    g = skate.parameters["g_sin_alpha"]
    mine = ds.Scene(["x", "y", "a"], lambda q, v: v @ v / 2 + g * q.x, rows=lambda q, v: {"blade": v.x * ds.sin(q.a) - v.y * ds.cos(q.a)},
                    v=[0, 0, 1.0], until=10.0)
    assert mine.rows == ["blade"]
    one, other = (scene.run(method="type1/gl:3", step=0.1, until=10.0) for scene in (mine, skate))
    assert np.allclose(one.q, other.q, atol=1e-12) and np.allclose(one["blade"], other["blade"], atol=1e-10)


def test_holonomic_rows_forces_and_dissipation():
    pendulum = ds.Scene(["x", "y"], lambda q, v: v @ v / 2 - 9.81 * q.y, rows=lambda q: [q.x**2 + q.y**2 - 1.0], q=[1.0, 0.0],
                        until=2.0, step=0.02)
    run = pendulum.run()
    assert np.abs(np.hypot(run["x"], run["y"]) - 1.0).max() < 1e-12
    damped = ds.Scene(["x"], lambda v: v.x**2 / 2, dissipation=lambda v, c: c * v.x**2 / 2, parameters={"c": 0.5}, v=[1.0], until=2.0)
    assert damped.run()["v_x"][-1] == pytest.approx(np.exp(-1.0), abs=1e-7)
    driven = ds.Scene(["x"], lambda v: v.x**2 / 2, force=lambda t: {"x": ds.cos(t)}, until=2.0)
    assert driven.run()["x"][-1] == pytest.approx(1 - np.cos(2.0), abs=1e-7)


def test_a_hamiltonian_will_do():
    scene = ds.Scene(["x"], hamiltonian=lambda q, p: p.x**2 / 2 + q.x**2 / 2, q=[1.0], p=[0.0], until=1.0)
    assert scene.run()["p_x"][-1] == pytest.approx(-np.sin(1.0), abs=1e-8)


@pytest.mark.parametrize("arguments, words", [
    ({"q": [1.0, 2.0]}, "2 entries.*1 coordinates"),
    ({"q": {"y": 1.0}}, "no coordinate 'y'"),
    ({"force": lambda q: {"y": q.x}}, "no coordinate 'y'"),
    ({"q": [float("nan")]}, "finite"),
    ({"parameters": {"q": 1.0}}, "cannot be named 'q'"),
    ({"plugins": ["missing.so"]}, "missing.so"),
])
def test_misuse_is_named(arguments, words):
    with pytest.raises(ds.Misuse, match=words):
        ds.Scene(["x"], lambda v: v.x**2 / 2, **arguments)


def test_the_plan_is_a_table(skate):
    plan = skate.plan
    assert plan.heading == ("item", "decision", "reason") and len(plan) > 5
    assert "KINSOL" in str(plan)
    assert plan._repr_html_().count("<tr>") == len(plan) + 1
    assert "KINSOL" in skate._repr_html_()


def test_methods_are_listed_with_those_of_plugins(plugin):
    assert "type1/midpoint" in {row[0] for row in ds.methods()}
    assert "type1/galerkin2" in {row[0] for row in ds.methods([plugin])} - {row[0] for row in ds.methods()}
    assert ds.load("knife_edge", plugins=[plugin]).run(steps=3, step=0.1, method="type1/galerkin2").statistics.order == 4


def test_names_are_not_changed_through_what_is_given():
    scene = ds.load("knife_edge")
    scene.coordinates.pop()
    assert scene.coordinates == ["x", "y", "ph"] and scene.run(steps=2, step=0.1).q.shape == (3, 3)
    with pytest.raises(AttributeError):
        scene.coordinates = ["x"]


def pickled(thing):
    return pickle.loads(pickle.dumps(thing))


def test_scenes_are_copied_as_what_they_were_made_from(spring, plugin, tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text(spring.text)
    monkeypatch.chdir(tmp_path)
    made = [spring.with_parameters(k=4.0), ds.load("knife_edge", g_sin_alpha=0.5), ds.load("mine.toml", k=4.0),
            ds.parse(spring.text, tolerances={"x": 1e-12}), ds.load("knife_edge", plugins=[plugin])]
    dumped = [pickle.dumps(scene) for scene in made]
    monkeypatch.chdir("/")  # another process may stand elsewhere
    for scene, bytes_of in zip(made, dumped):
        for again in (copy.copy(scene) if scene is not made[2] else scene, pickle.loads(bytes_of)):
            assert again.parameters == scene.parameters and again._tolerances == scene._tolerances
            assert np.array_equal(again.run(steps=5, step=0.1).q, scene.run(steps=5, step=0.1).q)


def test_runs_are_pickled_with_their_scene(spring):
    for run in (spring.run(step=0.1), spring.run(error=1e-8), spring.run(at=[0.5, 1.0])):
        again = pickled(run)
        assert np.array_equal(again["v_x"], run["v_x"]) and again.search == run.search and again.statistics == run.statistics
        assert again.scene.coordinates == ["x"] and again.names == run.names and copy.deepcopy(run).t is not run.t
    run = pickled(spring.run(step=0.1))
    assert run.gradient({"q": [1.0]}).q == pytest.approx(np.cos(6.0), abs=1e-6)
    ends = pickled(spring.ensemble([[1.0], [2.0]], until=1.0))
    assert ends.q[:, 0] == pytest.approx(np.cos(1.0) * np.array([1, 2]), abs=1e-6)


def test_integrators_and_what_holds_functions_are_not_copied():
    scene = ds.load("knife_edge")
    with pytest.warns(ds.CallbackCost):
        called = ds.Scene(["x"], lambda q, v: v[0] ** 2 / 2, callback=True)
    for thing in (called, scene.integrator(step=0.1)):
        for how in (copy.copy, copy.deepcopy, pickle.dumps):
            with pytest.raises(TypeError, match="not copied"):
                how(thing)
    with pytest.raises(ds.Misuse, match="made once"):
        scene.__init__(["x"], lambda q, v: v.x**2 / 2)


def test_comparisons_of_formulas_are_refused():
    for branch in (lambda q, v: v.x**2 if q.x == 0 else v.x**2 / 2, lambda q, v: v.x**2 if q.x in (0, 1) else v.x**2 / 2):
        with pytest.raises(TypeError, match="not compared"):
            ds.Scene(["x"], branch)


def test_an_ensemble_that_is_refused_says_why():
    with pytest.raises(ds.Error, match="substeps|adaptive|steps"):
        ds.load("knife_edge").ensemble(np.zeros((2, 3)), adaptive=True, until=1.0)
    with pytest.raises(ds.Misuse, match="at most 2147483647"):
        ds.load("knife_edge").run(order=2**32 + 4)


def test_a_tolerance_of_a_small_coordinate_is_kept():
    def scene(**more):
        return ds.Scene(["x", "y"], lambda q, v, a: v @ v / 2 + a**2 * ds.cos(q.x / a), parameters={"a": 1e-9}, q=[1e-9, 0.0],
                        until=10.0, step=0.1, **more)

    def end_of_x(made, **more):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ds.Doubt)
            return made.run(**more)["x"][-1]

    alone, beside = end_of_x(scene()), {"v": [0.0, 1e9]}
    assert abs(end_of_x(scene(**beside)) - alone) > 1e-10
    small = {"x": 1e-24}
    for end in (end_of_x(scene(**beside, tolerances=small)), end_of_x(scene(**beside), tolerances=small),
                end_of_x(scene(**beside, tolerances=small).with_parameters(a=1e-9))):
        assert end == pytest.approx(alone, abs=1e-18)
    with pytest.raises(ds.Misuse, match="no coordinate 'z'"):
        scene(tolerances={"z": 1.0})
    with pytest.raises(ds.Misuse, match="above 0"):
        scene().with_tolerances({"x": 0.0})
