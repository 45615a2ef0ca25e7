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
    ({"max_steps": 0}, "max_steps is 0; at least 1"),
    ({"max_steps": 3, "until": 2.0}, "20 steps of 0.1 lead to t = 2; max_steps allows 3"),
    ({"max_steps": 3, "steps": 4}, "4 steps of 0.1; max_steps allows 3"),
    ({"max_steps": 3, "at": [0.5, 1.0]}, "max_steps allows 3"),
    ({"control": "in-step"}, "control is 'in-step'; it is for steps that vary; adaptive=True or eps makes"),
    ({"control": "in-step", "adaptive": False}, "control is 'in-step'; it is for steps that vary"),
    ({"control": "in-step", "adaptive": False, "error": 1e-6}, "control is 'in-step'.*which adaptive=False excludes"),
    ({"smallest_step": 1e-3}, "smallest_step is 0.001; it is for steps that vary"),
    ({"smallest_step": -1e-3, "eps": 0.2}, "smallest_step is -0.001; 0 or more"),
    ({"at": [0.5, 2.0], "until": 1.0}, "at: t = 2 lies behind t = 1, the end; until moves it"),
    ({"at": [-0.5], "until": 1.0}, "at: t = -0.5 lies behind t = 1"),
    ({"at": [0.5, 2.0], "until": 1.0, "adaptive": True}, "at: t = 2 lies behind t = 1"),
    ({"at": [0.5], "every": 2}, "every is 2; it counts steps"),
    ({"every_time": 0.5, "every": 2}, "every is 2; it counts steps"),
    ({"error": 1e-6, "max_time": -1.0}, "max_time is -1.0; a number of seconds above 0"),
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


def test_steps_of_a_size_are_as_few_as_is_asked_for(spring):
    assert len(spring.run(max_steps=20, until=2.0)) == 21
    run = spring.run(max_steps=4, steps=4)
    assert run.jacobian().q.shape == (1, 2)  # which goes on without the limit
    with pytest.raises(ds.Failure, match="3 steps did not reach the end"):
        spring.run(adaptive=True, max_steps=3)


VARYING = {"eps": 0.2, "control": "in-step", "smallest_step": 1e-3, "max_steps": 9}


@pytest.mark.parametrize("what", [*VARYING, "adaptive"])
def test_what_takes_steps_of_one_size_refuses_the_others(spring, what):
    option = {what: VARYING.get(what, True)}
    for call, told in ((lambda: spring.boundary({"x": 0.5}, until=1.0, **option), "a motion between two ends"),
                       (lambda: spring.control({"x": 0.5}, until=1.0, **option), "optimal control"),
                       (lambda: spring.fit({"t": [0.1], "x": [0.9]}, ["k"], **option), "a fit"),
                       (lambda: spring.ensemble([[1.0]], until=1.0, **option), "an ensemble")):
        with pytest.raises(ds.Misuse, match=f"^{what} is .*; {told} takes steps of one size"):
            call()
    if what not in ("eps", "adaptive"):
        with pytest.raises(ds.Misuse, match=f"^{what} is .*; it is for steps that vary"):
            spring.integrator(**option)


def test_what_nothing_would_read_is_refused(spring):
    for call, words in ((lambda: spring.ensemble([[1.0]], until=1.0, steps=3), "until is 1.0; steps goes with no until"),
                        (lambda: spring.sweep({"k": [1.0]}, ["x"], count=3), "count is 3; it is of draws"),
                        (lambda: spring.sweep({"k": [1.0]}, ["x"], seed=3), "seed is 3; it is of draws"),
                        (lambda: spring.study(rtols=[1e-6], ida=False, erk=False), r"rtols is \[1e-06\].*leave out")):
        with pytest.raises(ds.Misuse, match=words):
            call()


LATIN = "f\udcff"  # a path with the byte ff


def test_bytes_that_are_no_text(tmp_path, spring):
    file = tmp_path / (LATIN + ".toml")
    file.write_text(spring.text)
    assert len(ds.load(file).run(steps=2)) == 3
    file.write_text(spring.text + "zz = 1")
    other = tmp_path / "latin.toml"
    other.write_bytes(spring.text.replace("spring", "fêler").encode("latin-1"))
    data = tmp_path / (LATIN + ".csv")
    data.write_bytes(b"t,x\xfc\n0.1,2\n")
    for call, words in ((lambda: ds.load(file), r"f\\xff.toml:\d+:1: unknown key 'zz'"),
                        (lambda: ds.load(other), "latin.toml:1:9: .*utf-8"),
                        (lambda: ds.load(tmp_path / (LATIN + "g.toml")), r"f\\xffg.toml' cannot be read"),
                        (lambda: ds.load(LATIN), r"unknown scene 'f\\xff'"),
                        (lambda: spring.run(method=LATIN), r"unknown method 'f\\xff'"),
                        (lambda: spring.fit(data, ["k"]), r"f\\xff.csv': the column 'x\\xfc'"),
                        (lambda: spring.with_tolerances({LATIN: 1.0}), r"no coordinate 'f\\xff'"),
                        (lambda: spring.boundary({LATIN: 1.0}), r"'f\\xff' is no coordinate"),
                        (lambda: ds.load("knife_edge", plugins=[LATIN + ".so"]), r"plugin 'f\\xff.so'"),
                        (lambda: spring.study(methods=[LATIN]), r"unknown method 'f\\xff'"),
                        (lambda: ds.sweep(LATIN + ".toml"), r"f\\xff.toml' cannot be read")):
        with pytest.raises(ds.Misuse, match=words):
            call()


def test_a_text_with_an_end_in_its_midst_is_refused(spring):
    for call in (lambda name: ds.load(name), lambda name: ds.load("knife_edge", **{name: 1.0}), lambda name: ds.parse(name),
                 lambda name: ds.load("knife_edge", plugins=[name]), lambda name: spring.run(method="type1/gl:3" + name),
                 lambda name: spring.with_tolerances({"x" + name: 1.0}), lambda name: spring.boundary({"x" + name: 1.0}),
                 lambda name: spring.fit({"t": [0.1], "x" + name: [0.9]}, ["k"]), lambda name: spring.fit(name, ["k"]),
                 lambda name: spring.run(steps=2).jacobian(["k" + name]), lambda name: spring.study(methods=[name]),
                 lambda name: spring.sweep({"k" + name: [1.0]}, ["x"]), lambda name: spring.sweep({"k": [1.0]}, ["x"], out=name),
                 lambda name: ds.sweep(name), lambda name: ds.Scene(["x"], lagrangian, name=name),
                 lambda name: ds.GeneratingFunction("type1/" + name, 1, lambda L, q0, q1, h, t: 0.0)):
        for name in ("\0zz", "\ud800"):
            with pytest.raises(ds.Misuse, match=r"\\x00zz|\\ud800"):
                call(name)


@pytest.mark.parametrize("name", ["", "  ", "x\ny", "\u202ex", "x\udcff", 3])
def test_names_are_of_letters_that_print(name):
    for scene in ({"coordinates": [name]}, {"name": name}, {"name": name, "callback": True},
                  {"rows": lambda v: {name: v.x}}, {"invariants": {name: lagrangian}}, {"parameters": {name: 1.0}}):
        with pytest.raises(ds.Misuse) as told:
            ds.Scene(**{"coordinates": ["x"], "lagrangian": lagrangian, **scene})
        assert str(told.value).isprintable()


def test_messages_are_fit_to_be_shown(spring):
    for name, shown in (("\x1b[31m", r"'\\u001b\[31m'"), ("a\u202eb", r"'a\\u202eb'"), ("a" * 5000, r"'a{99}… \(5002 characters\)")):
        with pytest.raises(ds.Misuse, match="unknown scene " + shown):
            ds.load(name)
