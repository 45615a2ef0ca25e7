"""Arguments of a wrong kind: each is refused, and the message names it and says what is allowed."""

import fractions

import numpy as np
import pytest

import diracstep as ds


def lagrangian(v):
    return v @ v / 2


LOAD = [
    (lambda: ds.load(3), "name is 3; a text or a path"),
    (lambda: ds.load("knife_edge", g_sin_alpha="a"), "parameter g_sin_alpha is 'a'; a number"),
    (lambda: ds.load("knife_edge", g_sin_alpha=None), "parameter g_sin_alpha is None; a number"),
    (lambda: ds.load("knife_edge", g_sin_alpha=np.ones(2)), "parameter g_sin_alpha is array.*; a number"),
    (lambda: ds.load("knife_edge", g_sin_alpha=np.nan), "parameter g_sin_alpha is nan; a finite number"),
    (lambda: ds.load("knife_edge", drop_redundant="yes"), "drop_redundant is 'yes'; True or False"),
    (lambda: ds.load("knife_edge", plugins="a.so"), "plugins is 'a.so'; a list of paths"),
    (lambda: ds.load("knife_edge", plugins=[3]), r"plugins\[0\] is 3; a text or a path"),
    (lambda: ds.load("knife_edge", methods=["type1/mine"]), r"methods\[0\] is 'type1/mine'; a ds.GeneratingFunction"),
    (lambda: ds.load("knife_edge", tolerances=1e-9), "tolerances is 1e-09; a dictionary of numbers by name"),
    (lambda: ds.load("knife_edge", tolerances={"x": "a"}), "x of tolerances is 'a'; a number"),
    (lambda: ds.load("knife_edge").with_parameters(m=[1.0]), r"parameter m is \[1.0\]; a number"),
    (lambda: ds.parse(b"name"), "text is b'name'; a text"),
    (lambda: ds.methods("a.so"), "plugins is 'a.so'; a list of paths"),
]
SCENE = [
    ({"coordinates": "theta"}, "coordinates is 'theta'; a list of texts"),
    ({"coordinates": ["x", 3]}, r"coordinates\[1\] is 3; a text"),
    ({"coordinates": ["x", "x"]}, "'x' stands twice"),
    ({"coordinates": []}, "needs coordinates"),
    ({"coordinates": ["my x"]}, "'my x' is no name"),
    ({"parameters": {"2g": 1.0}}, "'2g' is no name"),
    ({"lagrangian": np.sin}, "does not tell its arguments"),
    ({"lagrangian": "v^2"}, "lagrangian is str; a function"),
    ({"lagrangian": lambda v: None}, "lagrangian returned NoneType; one formula is needed, written with return"),
    ({"lagrangian": lambda v: "v"}, "lagrangian returned str; one formula"),
    ({"lagrangian": lambda v: v}, "lagrangian returned Column; one formula"),
    ({"lagrangian": None}, "a lagrangian or a hamiltonian"),
    ({"q": "a"}, "start q is str; 1 entries"),
    ({"q": ["a"]}, "x is 'a'; a number"),
    ({"parameters": {"k": "a"}}, "k of parameters is 'a'; a number"),
    ({"parameters": [1.0]}, r"parameters is \[1.0\]; a dictionary"),
    ({"invariants": lagrangian}, "invariants is function; a dictionary"),
    ({"start": [1.0]}, r"start is \[1.0\]; a dictionary"),
    ({"until": "a"}, "until is 'a'; a number"),
    ({"step": np.inf}, "step is inf; a finite number"),
    ({"name": 3}, "name is 3; a text"),
    ({"callback": 1}, "callback is 1; True or False"),
    ({"force": lambda q: 1.0}, "force is float; 1 entries"),
]
RUN = [
    ({"step": "a"}, "step is 'a'; a number"),
    ({"step": np.nan}, "step is nan; a finite number"),
    ({"eps": "a"}, "eps is 'a'; a number"),
    ({"eps": 0.0}, "eps is 0.0; a number of radians above 0"),
    ({"adaptive": "yes"}, "adaptive is 'yes'; True or False"),
    ({"adaptive": 1, "error": 1e-6}, "adaptive is 1; True or False"),
    ({"adaptive": False, "eps": 0.2}, "no adaptive=False"),
    ({"error": 1e-6, "eps": 0.2}, "eps goes with no error"),
    ({"project_start": "no"}, "project_start is 'no'; True or False"),
    ({"method": 3}, "method is 3; a text"),
    ({"order": 2.5}, "order is 2.5; a whole number"),
    ({"errror": 1e-6}, "no argument 'errror'"),
    ({"max_time": 3.0}, "go with error"),
    ({"progress": 3}, "progress is 3; True or False"),
    ({"tolerances": 3}, "tolerances is 3; a dictionary"),
    ({"at": "abc"}, "at is of type"),
]


@pytest.mark.parametrize("call, words", LOAD, ids=[words for _, words in LOAD])
def test_what_a_scene_is_loaded_with(call, words):
    with pytest.raises(ds.Misuse, match=words):
        call()


@pytest.mark.parametrize("given, words", SCENE, ids=[words for _, words in SCENE])
def test_what_a_scene_is_made_of(given, words):
    with pytest.raises(ds.Misuse, match=words):
        ds.Scene(**{"coordinates": ["x"], "lagrangian": lagrangian, **given})


@pytest.mark.parametrize("options, words", RUN, ids=[words for _, words in RUN])
def test_how_a_scene_is_run(spring, options, words):
    with pytest.raises(ds.Misuse, match=words):
        spring.run(**options)


def test_what_is_asked_of_a_run(spring):
    run = spring.run(steps=3, step=0.1)
    for call, words in ((lambda: run.gradient("q"), "cotangent is 'q'; a dictionary"), (lambda: run.gradient({"x": [1.0]}), "cotangent"),
                        (lambda: run.jacobian("k"), "parameters is 'k'; a list of texts"),
                        (lambda: spring.ensemble([1.0]), r"\(members, 1\) is needed"),
                        (lambda: spring.fit(3, ["k"]), "data is int"), (lambda: spring.fit({"t": [0.0]}, "k"), "parameters is 'k'"),
                        (lambda: spring.study(orders=4), "orders is 4; a list"), (lambda: spring.study(methods="a"), "methods is 'a'")):
        with pytest.raises(ds.Misuse, match=words):
            call()
    assert "x" in run and "z" not in run
    with pytest.raises(TypeError, match="not iterable"):
        list(run)
    with pytest.raises(KeyError, match="no quantity slice"):
        run[0:2]


def test_a_message_of_the_command_begins_with_what_is_wrong(spring):
    with pytest.raises(ds.Misuse) as told:
        spring.study(methods=["type9/none"])
    assert str(told.value).startswith("unknown method 'type9/none'")


def test_options_are_spelled_as_in_python():
    def circle(rows, y, **options):
        return ds.Scene(["x", "y"], lambda q, v: v @ v / 2 - q.y, rows=rows, q=[1.0, y], **options)

    twice = """name = "twice"
redundant = "refuse"
lagrangian = "(v_x^2 + v_y^2)/2 - y"
[coordinates]
x = {}
y = {}
[[rows]]
name = "one"
equation = "x^2 + y^2 = 1"
[[rows]]
name = "two"
equation = "2*x^2 + 2*y^2 = 2"
[start]
x = 1
[span]
end = 1
step = 0.1
"""
    with pytest.raises(ds.Misuse, match='drop them: drop_redundant=True, or redundant = "drop"'):
        ds.parse(twice).run()
    assert len(ds.parse(twice, drop_redundant=True).run(steps=1, step=0.1)) == 2
    with pytest.raises(ds.Misuse, match="or project_start=True$"):
        circle(lambda q: q @ q - 1, 0.1).run()
    with pytest.raises(ds.Failure, match=r"\(max_time|max_solves"):
        ds.load("kepler_e099").run(error=1e-13, max_solves=100)


def test_what_needs_steps_of_one_size_says_so(spring):
    integrator = spring.integrator(adaptive=True)
    for call in (integrator.save, lambda: integrator.reset(q=[1.0]), lambda: integrator.step(size=0.1)):
        with pytest.raises(ds.Misuse, match=r"steps of fixed size \(adaptive=False\)"):
            call()


def test_numbers_of_other_kinds_are_taken():
    for number in (2, np.float32(2), np.int64(2), np.array(2.0), fractions.Fraction(2)):
        assert ds.load("knife_edge", m=number).parameters["m"] == 2.0
    assert ds.load("hanging_chain", N=np.int64(3)).parameters["N"] == 3.0
    assert len(ds.load("knife_edge").run(adaptive=np.bool_(False), steps=2, step=0.1)) == 3


def test_steps_of_another_size_are_counted(spring):
    integrator = spring.integrator(step=0.1)
    integrator.step(3, size=0.05)
    assert integrator.time == pytest.approx(0.15)
