"""Formulas as symbols: what a Lagrangian sees when it is called once to be traced.

Arithmetic, the functions of this module, and NumPy's ufuncs on symbols give further symbols.  On numbers and arrays the
functions of this module are NumPy's.
"""

from __future__ import annotations

import math
import numbers
from typing import Any, Callable, Iterable

import numpy as np

__all__ = ["Expression", "Column", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh",
           "atanh", "exp", "log", "sign", "sqrt", "atan2", "minimum", "maximum", "pi"]

pi = math.pi

_ATOM, _POWER, _PRODUCT, _SUM = 4, 3, 2, 1  # how strongly the outermost operator binds
_LONGEST = 20000  # characters of a formula, below the limit of scene files


def _number(value: Any) -> str:
    """A number as the scene's language writes it, with all of its digits."""
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{value!r} in a formula; finite numbers only")
    text = repr(int(value)) if isinstance(value, numbers.Integral) and abs(number) < 2.0**53 else repr(number)
    return f"({text})" if text.startswith("-") else text


class Expression:
    """A formula in coordinates, velocities, time and parameters.

    It has no value, so that no branch can depend on it: use ``ds.minimum``, ``ds.maximum`` and ``abs``.
    """

    __slots__ = ("form", "arguments", "binding")
    __array_priority__ = 1000.0

    def __init__(self, form: str, arguments: tuple[Any, ...] = (), binding: int = _ATOM) -> None:
        self.form = form  # with a {} for each argument
        self.arguments = arguments
        self.binding = binding

    # ---- arithmetic ----
    def __add__(self, other: Any) -> Any:
        return _binary("{} + {}", self, other, _SUM, _SUM, _SUM)

    def __radd__(self, other: Any) -> Any:
        return _binary("{} + {}", other, self, _SUM, _SUM, _SUM)

    def __sub__(self, other: Any) -> Any:
        return _binary("{} - {}", self, other, _SUM, _SUM, _PRODUCT)

    def __rsub__(self, other: Any) -> Any:
        return _binary("{} - {}", other, self, _SUM, _SUM, _PRODUCT)

    def __mul__(self, other: Any) -> Any:
        return _binary("{}*{}", self, other, _PRODUCT, _PRODUCT, _POWER)

    def __rmul__(self, other: Any) -> Any:
        return _binary("{}*{}", other, self, _PRODUCT, _PRODUCT, _POWER)

    def __truediv__(self, other: Any) -> Any:
        return _binary("{}/{}", self, other, _PRODUCT, _PRODUCT, _POWER)

    def __rtruediv__(self, other: Any) -> Any:
        return _binary("{}/{}", other, self, _PRODUCT, _PRODUCT, _POWER)

    def __pow__(self, other: Any) -> Any:
        return _binary("{}^{}", self, other, _POWER, _ATOM, _ATOM)

    def __rpow__(self, other: Any) -> Any:
        return _binary("{}^{}", other, self, _POWER, _ATOM, _ATOM)

    def __neg__(self) -> Expression:
        return Expression("(-{})", (_at_least(self, _POWER),))

    def __pos__(self) -> Expression:
        return self

    def __abs__(self) -> Expression:
        return Expression("abs({})", (self,))

    # ---- NumPy ----
    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            return NotImplemented
        known = _UFUNCS.get(ufunc.__name__)
        if known is None:
            raise TypeError(f"numpy.{ufunc.__name__} cannot be traced into a formula; there are: " + ", ".join(sorted(_UFUNCS)))
        if any(isinstance(entry, np.ndarray) and entry.ndim > 0 for entry in inputs):
            arrays = np.broadcast_arrays(*(_boxed(entry) for entry in inputs))
            results = np.empty(arrays[0].shape, dtype=object)
            for place in np.ndindex(results.shape):
                results[place] = known(*(array[place] for array in arrays))
            return results
        return known(*(entry.item() if isinstance(entry, (np.ndarray, np.generic)) else entry for entry in inputs))

    def __getattr__(self, name: str) -> Callable[..., Any]:
        # NumPy's ufuncs on arrays of objects look for a method of their name.
        if name in _UFUNCS:
            return lambda *others: _UFUNCS[name](self, *others)
        raise AttributeError(f"a formula has no attribute {name!r}")

    # ---- what a formula cannot do ----
    def __bool__(self) -> bool:
        raise TypeError("a formula has no truth value: the function is called once, with symbols. Use ds.minimum, ds.maximum or "
                        "abs in place of a branch, or callback=True for a real Python function")

    def _compared(self, _: Any) -> Any:
        raise TypeError("formulas are not compared: the function is called once, with symbols. Use ds.minimum, ds.maximum or abs in "
                        "place of a branch, or callback=True for a real Python function; a row is written as an expression "
                        "that is zero")

    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _compared  # type: ignore[assignment]
    __hash__ = object.__hash__

    def __float__(self) -> float:
        raise TypeError("a formula is no number: use ds.sin, numpy.sin, … in place of math.sin, …")

    __int__ = __index__ = __complex__ = __float__  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<formula {text_of(self)}>"


def _at_least(value: Any, binding: int) -> Any:
    """The value, in parentheses where its outermost operator binds less."""
    if isinstance(value, Expression) and value.binding < binding:
        return Expression("({})", (value,))
    return value


def _checked(value: Any) -> Any:
    if isinstance(value, Expression):
        return value
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, numbers.Real):
        return Expression(_number(value))
    raise TypeError(f"{type(value).__name__} in a formula; numbers and formulas only")


def _binary(form: str, left: Any, right: Any, binding: int, left_needs: int, right_needs: int) -> Any:
    if isinstance(left, np.ndarray) and left.ndim > 0 or isinstance(right, np.ndarray) and right.ndim > 0:
        return NotImplemented
    try:
        operands = (_at_least(_checked(left), left_needs), _at_least(_checked(right), right_needs))
    except TypeError:
        return NotImplemented
    return Expression(form, operands, binding)


def _boxed(value: Any) -> np.ndarray:
    if isinstance(value, np.ndarray):
        return value.astype(object)
    box = np.empty((), dtype=object)
    box[()] = value
    return box


def _function(name: str, on_numbers: Callable[..., Any]) -> Callable[..., Any]:
    def function(*arguments: Any) -> Any:
        if any(isinstance(argument, np.ndarray) and argument.dtype == object for argument in arguments):
            arrays = np.broadcast_arrays(*(_boxed(argument) for argument in arguments))
            results = np.empty(arrays[0].shape, dtype=object)
            for place in np.ndindex(results.shape):
                results[place] = function(*(array[place] for array in arrays))
            return results
        if not any(isinstance(argument, Expression) for argument in arguments):
            return on_numbers(*arguments)
        return Expression(f"{name}({', '.join(['{}'] * len(arguments))})", tuple(_checked(entry) for entry in arguments))

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"{name} of a formula, or of numbers as NumPy computes it."
    return function


sin = _function("sin", np.sin)
cos = _function("cos", np.cos)
tan = _function("tan", np.tan)
asin = _function("asin", np.arcsin)
acos = _function("acos", np.arccos)
atan = _function("atan", np.arctan)
sinh = _function("sinh", np.sinh)
cosh = _function("cosh", np.cosh)
tanh = _function("tanh", np.tanh)
asinh = _function("asinh", np.arcsinh)
acosh = _function("acosh", np.arccosh)
atanh = _function("atanh", np.arctanh)
exp = _function("exp", np.exp)
log = _function("log", np.log)
sqrt = _function("sqrt", np.sqrt)
sign = _function("sign", np.sign)
atan2 = _function("atan2", np.arctan2)
minimum = _function("min", np.minimum)
maximum = _function("max", np.maximum)

_UFUNCS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "true_divide": lambda a, b: a / b,
    "power": lambda a, b: a**b,
    "float_power": lambda a, b: a**b,
    "negative": lambda a: -a,
    "positive": lambda a: a,
    "absolute": abs,
    "fabs": abs,
    "square": lambda a: a * a,
    "reciprocal": lambda a: 1 / a,
    "hypot": lambda a, b: sqrt(a * a + b * b),
    "deg2rad": lambda a: a * (math.pi / 180.0),
    "radians": lambda a: a * (math.pi / 180.0),
    "rad2deg": lambda a: a * (180.0 / math.pi),
    "degrees": lambda a: a * (180.0 / math.pi),
    "log2": lambda a: log(a) / math.log(2.0),
    "log10": lambda a: log(a) / math.log(10.0),
    "exp2": lambda a: 2**a,
    "sin": sin, "cos": cos, "tan": tan, "arcsin": asin, "arccos": acos, "arctan": atan, "sinh": sinh, "cosh": cosh,
    "tanh": tanh, "arcsinh": asinh, "arccosh": acosh, "arctanh": atanh, "exp": exp, "log": log, "sqrt": sqrt, "sign": sign,
    "arctan2": atan2, "minimum": minimum, "maximum": maximum, "fmin": minimum, "fmax": maximum,
}


class Column(np.ndarray):
    """The coordinates, or their velocities, as an array of symbols that also knows them by name: q[0], q["x"], q.x.

    q["T"], not q.T, is a coordinate that has the name of an attribute of arrays."""

    _names: dict[str, int]

    def __new__(cls, symbols: Iterable[Any], names: dict[str, int]) -> Column:
        symbols = list(symbols)
        made = np.empty(len(symbols), dtype=object).view(cls)
        made[:] = symbols
        made._names = names
        return made

    def __array_finalize__(self, other: Any) -> None:
        if "_names" not in self.__dict__:
            self._names = {}  # of a part or a result: places, but no names

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            if key not in self._names:
                raise KeyError(f"no coordinate {key!r}; there are: " + ", ".join(self._names))
            key = self._names[key]
        return super().__getitem__(key)

    def __getattr__(self, name: str) -> Any:
        names = self.__dict__.get("_names", {})
        if name in names:
            return super().__getitem__(names[name])
        raise AttributeError(f"no coordinate {name!r}; there are: " + ", ".join(names))


def text_of(expression: Any, shared: dict[int, str] | None = None) -> str:
    """A formula in the language of scene files; ``shared`` names the parts that stand elsewhere."""
    return _texts([_checked(expression)], shared or {})[0]


def _reached(roots: list[Expression]) -> list[Expression]:
    """All parts, arguments before what they are in, each once."""
    order: list[Expression] = []
    seen: set[int] = set()
    stack: list[tuple[Expression, bool]] = [(root, False) for root in reversed(roots)]
    while stack:
        part, done = stack.pop()
        if done:
            order.append(part)
        elif id(part) not in seen:
            seen.add(id(part))
            stack.append((part, True))
            stack.extend((argument, False) for argument in part.arguments)
    return order


def _texts(roots: list[Expression], shared: dict[int, str]) -> list[str]:
    texts: dict[int, str] = {}
    for part in _reached(roots):
        own = part.form.format(*(shared.get(id(entry)) or texts[id(entry)] for entry in part.arguments))
        texts[id(part)] = own
    return [texts[id(root)] for root in roots]


def formulas(roots: list[Any], prefix: str = "part") -> tuple[dict[str, str], list[str]]:
    """Definitions of the parts that occur more than once, in their order, and the formulas that use them."""
    wanted = [_checked(root) for root in roots]
    order = _reached(wanted)
    uses: dict[int, int] = {}
    for part in order:
        for argument in part.arguments:
            uses[id(argument)] = uses.get(id(argument), 0) + 1
    names: dict[int, str] = {}
    texts: dict[int, str] = {}
    definitions: dict[str, str] = {}
    for part in order:
        text = part.form.format(*(names.get(id(entry)) or texts[id(entry)] for entry in part.arguments))
        texts[id(part)] = text
        repeated = uses.get(id(part), 0) > 1 and part.arguments and part.form != "({})"
        if repeated or len(text) > _LONGEST:
            name = f"{prefix}_{len(definitions) + 1}"
            definitions[name] = text
            names[id(part)] = name
    return definitions, [names.get(id(root)) or texts[id(root)] for root in wanted]
