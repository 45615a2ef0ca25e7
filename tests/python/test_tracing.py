"""Traced formulas against Python's own evaluation of the same functions."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import diracstep as ds
from diracstep.symbols import _UFUNCS

LEAVES = st.one_of(
    st.sampled_from(["x", "y", "k", "v_x", "t"]).map(lambda name: ("name", name)),
    st.floats(-8.0, 8.0).map(lambda value: ("number", value)),
    st.integers(-5, 5).map(lambda value: ("number", value)),
    st.floats(-2.0, 2.0).map(lambda value: ("number", np.float64(value))),
)
# Each of NumPy's ufuncs that tracing knows, of arguments in its domain: any formula is brought there first.
DOMAINS = {"arccosh": lambda a: 1.5 + np.abs(a), "arcsin": np.tanh, "arccos": np.tanh, "arctanh": lambda a: 0.9 * np.tanh(a),
           "exp": np.sin, "exp2": np.sin, "sinh": np.tanh, "cosh": np.tanh, "tan": np.tanh, "log10": lambda a: 2 + np.cos(a),
           "log": lambda a: 2 + np.cos(a), "log2": lambda a: 2 + np.cos(a), "sqrt": lambda a: 1 + a * a, "reciprocal": lambda a: 1.5 + a * a, "sign": lambda a: 1.5 + np.cos(a)}
SECOND = {"divide": lambda a: 1.5 + a * a, "true_divide": lambda a: 1.5 + a * a, "power": np.tanh, "float_power": np.tanh,
          "arctan2": lambda a: 3 + a * a}
FIRST = {"power": lambda a: 1 + a * a, "float_power": lambda a: 1 + a * a}


def same(a):
    return a


def ufunc_in_its_domain(name):
    ufunc, first, second = getattr(np, name), DOMAINS.get(name, FIRST.get(name, same)), SECOND.get(name, same)
    return (lambda a: ufunc(first(a))) if ufunc.nin == 1 else (lambda a, b: ufunc(first(a), second(b)))


UFUNCS = {"np." + name: ufunc_in_its_domain(name) for name in _UFUNCS}
ONE = {"neg": lambda a: -a, "pos": lambda a: +a, "abs": abs, "square_power": lambda a: a**2, "cube": lambda a: a**3,
       "power_of_number": lambda a: 1.5**ds.tanh(a), "from_number": lambda a: 1 - a, "over": lambda a: 2 / (1.5 + a * a),
       "twice": lambda a: a + a, "hypot_one": lambda a: np.hypot(a, 1.0), "array": lambda a: (np.array([1, 2]) * a) @ np.array([3, 0.5]),
       **{name: function for name, function in UFUNCS.items() if getattr(np, name[3:]).nin == 1},
       "ds.sin": ds.sin, "ds.cos": ds.cos, "ds.tanh": ds.tanh, "ds.atan": ds.atan, "ds.asinh": ds.asinh,
       "ds.exp": lambda a: ds.exp(ds.sin(a)), "ds.log": lambda a: ds.log(2 + ds.cos(a)), "ds.sqrt": lambda a: ds.sqrt(1 + a * a)}
TWO = {"add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b,
       "div": lambda a, b: a / (1.5 + b * b), "div_sum": lambda a, b: a / (2 + abs(b)), "min": ds.minimum, "max": ds.maximum,
       "atan2": lambda a, b: ds.atan2(a, 3 + b * b), "power": lambda a, b: (1 + a * a) ** ds.tanh(b),
       **{name: function for name, function in UFUNCS.items() if getattr(np, name[3:]).nin == 2}}
TREES = st.recursive(LEAVES, lambda inner: st.one_of(st.tuples(st.sampled_from(sorted(ONE)), inner),
                                                     st.tuples(st.sampled_from(sorted(TWO)), inner, inner)), max_leaves=12)


def evaluate(tree, names):
    kind, *arguments = tree
    if kind == "name":
        return names[arguments[0]]
    if kind == "number":
        return arguments[0]
    return (ONE.get(kind) or TWO[kind])(*(evaluate(argument, names) for argument in arguments))


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(tree=TREES, q=st.tuples(st.floats(-3, 3), st.floats(-3, 3)), v=st.floats(-2, 2), k=st.floats(0.1, 4), t=st.floats(0, 2))
def test_a_traced_formula_has_the_value_that_python_computes(tree, q, v, k, t):
    with np.errstate(all="ignore"):
        try:
            expected = float(evaluate(tree, {"x": q[0], "y": q[1], "v_x": v, "k": k, "t": t}))
        except OverflowError:
            assume(False)
    assume(math.isfinite(expected) and abs(expected) < 1e60)
    scene = ds.Scene(["x", "y"], lambda v: (v @ v) / 2, parameters={"k": k}, q=q, v=[v, 0.0], t=t, until=t + 1.0,
                     invariants={"f": lambda q, v, t, k: evaluate(tree, {"x": q.x, "y": q[1], "v_x": v["x"], "k": k, "t": t}) + 0 * q.x})
    got = scene.run(steps=1, step=1e-3)["f"][0]
    # errors of intermediate results may cancel in what is compared: their size is not known here
    assert got == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_sign_is_a_function_of_formulas():
    scene = ds.Scene(["a", "b"], lambda v: v @ v / 2, q=[0.3, -0.4], invariants={"f": lambda q: np.sign(q.a) + 3 * ds.sign(q.b)})
    assert scene.run(steps=1, step=0.1)["f"][0] == 1 - 3


def test_numpys_arrays_of_symbols_work_as_arrays():
    mass = np.array([[2.0, 0.5], [0.5, 1.0]])
    scene = ds.Scene(["a", "b"], lambda q, v: v @ mass @ v / 2 - np.sum(np.sin(q[:2]) * np.array([1.0, 2.0])), q=[0.3, 0.4],
                     v=[1.0, -1.0])
    assert scene.run(steps=1).energy[0] == pytest.approx(1.0 + math.sin(0.3) + 2 * math.sin(0.4), rel=1e-14)


def test_every_ufunc_that_is_known_agrees_with_numpy():
    from diracstep.symbols import Expression, text_of

    for name in _UFUNCS:
        ufunc = getattr(np, name)
        symbols = [Expression(letter) for letter in "xy"[:ufunc.nin]]
        assert text_of(ufunc(*symbols))
        scene = ds.Scene(["x", "y"], lambda v: v @ v / 2, q=[0.7 if name != "arccosh" else 1.7, 0.3],
                         invariants={"f": lambda q: ufunc(*list(q)[:ufunc.nin])})
        at = scene.start_q[:ufunc.nin]
        assert scene.run(steps=1, step=1e-6)["f"][0] == pytest.approx(float(ufunc(*at)), rel=1e-14), name


def test_the_function_is_called_once():
    calls = []
    ds.Scene(["x"], lambda q, v: calls.append(1) or v.x**2 / 2).run(steps=5)
    assert len(calls) == 1


def test_parts_that_repeat_are_written_once_and_long_sums_are_taken():
    def tower(q):
        part = q.x
        for _ in range(40):
            part = 0.5 * part * part / (1 + part * part) + 0.1
        return part

    def long_sum(q):
        return sum((ds.sin(q.x / (k + 1)) for k in range(3000)), 0.0)

    scene = ds.Scene(["x"], lambda v: v.x**2 / 2, q=[0.5], invariants={"tower": tower, "long_sum": long_sum})
    assert len(scene.text) < 100_000  # 2^40 without
    run = scene.run(steps=1, step=1e-3)

    class At:
        x = 0.5

    assert run["tower"][0] == pytest.approx(tower(At), rel=1e-13)
    assert run["long_sum"][0] == pytest.approx(long_sum(At), rel=1e-12)


def test_formulas_deeper_than_the_library_takes_are_refused():
    def deep(q):
        part = q.x
        for _ in range(200):
            part = ds.sin(part) + q.x
        return part

    with pytest.raises(ds.Misuse, match="nested deeper"):
        ds.Scene(["x"], lambda v: v.x**2 / 2, invariants={"deep": deep})


@pytest.mark.parametrize("function, words", [
    (lambda q, v: v.x**2 if q.x > 0 else 0, "not compared"),
    (lambda q, v: v.x**2 if q.x else 0, "no truth value"),
    (lambda q, v: math.sin(q.x), "use ds.sin"),
    (lambda q, v: np.floor(q.x), "floor cannot be traced"),
])
def test_what_cannot_be_traced_is_said(function, words):
    with pytest.raises(TypeError, match=words):
        ds.Scene(["x"], function)


@pytest.mark.parametrize("function, words", [
    (lambda q, w: q.x, "'w'"),
    (lambda q: [q.x, q.x], "one formula"),
    (3.0, "a function is needed"),
])
def test_misuse_of_functions_is_named(function, words):
    with pytest.raises(ds.Misuse, match=words):
        ds.Scene(["x"], function)


def test_a_number_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="finite"):
        ds.Scene(["x"], lambda q, v: v.x**2 * float("inf"))


def test_greek_names_are_kept_outside_and_spelled_inside():
    scene = ds.Scene(["θ"], lambda v: v["θ"] ** 2 / 2, v={"θ": 2.0}, until=1.0)
    assert "v_theta" in scene.text
    assert scene.run()["θ"][-1] == pytest.approx(2.0)


def test_a_column_knows_names_and_places():
    def lagrangian(q, v):
        assert q.x is q[0] is q["x"] and len(q) == 2
        with pytest.raises(AttributeError, match="there are: x, y"):
            q.z
        with pytest.raises(KeyError, match="there are: x, y"):
            q["z"]
        return v @ v

    ds.Scene(["x", "y"], lagrangian)
