"""How a scene is stepped: keyword arguments as the structs of the library."""

from __future__ import annotations

import ctypes
import math
import reprlib
from typing import Any, Mapping, Sequence

import numpy as np

from . import _library as c
from .arrays import flag, real, table, text, whole
from .errors import Misuse

_LARGEST_INT = 2**31 - 1  # of C
KNOWN = ("method", "order", "step", "rule", "solver", "jacobian", "project_start", "substeps", "compensated_sums", "adaptive",
         "eps", "control", "smallest_step", "max_steps")


_OF_VARYING = ("control", "smallest_step", "max_steps")  # what steps of one size have no use for


def varying(given: Mapping[str, Any]) -> bool:
    """Whether the options say that steps vary."""
    return given.get("eps") is not None or given.get("adaptive") is not None and flag(given["adaptive"], "adaptive")


def refuse(given: Mapping[str, Any], names: Sequence[str], why: str) -> None:
    """Raises Misuse for an argument that nothing would read."""
    for name in names:
        if given.get(name) is not None:
            raise Misuse(f"{name} is {reprlib.repr(given[name])}; {why}")


def refuse_unused(given: Mapping[str, Any], *, max_steps: bool = False) -> None:
    """Raises Misuse for what shapes steps that vary, where they do not; ``max_steps``: whether it limits steps of one size too."""
    if not varying(given):
        refuse(given, [name for name in _OF_VARYING if not (max_steps and name == "max_steps")],
               "it is for steps that vary; adaptive=True or eps makes them so")


def require_fixed(given: Mapping[str, Any], what: str) -> None:
    """Raises Misuse for options of steps that vary, where there are none."""
    refuse(given, ("eps", *_OF_VARYING), f"{what} takes steps of one size; step gives it")
    if varying(given):
        raise Misuse(f"adaptive is True; {what} takes steps of one size, adaptive=False or nothing, and step gives it")


def options_from(given: dict[str, Any], until: float | None, pushed: bool = False, fixed: bool = False) -> c.Options:
    """The options of the library; raises Misuse for a keyword that is not known.

    fixed: steps of one size, unless the options say that they vary.
    """
    unknown = [name for name in given if name not in KNOWN]
    if unknown:
        raise Misuse(f"no argument {unknown[0]!r}; beside those of the function (help tells them) there are " + ", ".join(KNOWN))
    options = c.Options()
    for name in ("method", "rule", "solver", "jacobian", "control"):
        value = given.get(name)
        setattr(options, name, c.encoded(None if value is None else text(value, name)))
    for name in ("order", "substeps"):
        setattr(options, name, whole(given.get(name) or 0, name, most=_LARGEST_INT))
    options.max_steps = 0 if given.get("max_steps") is None else whole(given["max_steps"], "max_steps", 1)
    for name in ("project_start", "compensated_sums"):
        setattr(options, name, int(flag(given.get(name, False), name)))
    if given.get("step") is not None:
        options.step = real(given["step"], "step")
        if options.step == 0.0:
            raise Misuse("step is 0; a number other than zero is needed")
    options.smallest_step = real(given.get("smallest_step") or 0.0, "smallest_step")
    if options.smallest_step < 0.0:
        raise Misuse(f"smallest_step is {options.smallest_step}; 0 or more is needed")
    eps = given.get("eps")
    if eps is not None:
        options.eps = real(eps, "eps")
        if options.eps <= 0.0:
            raise Misuse(f"eps is {options.eps}; a number of radians above 0 is needed")
    adaptive = given.get("adaptive")
    if varying(given) and eps is None:
        options.eps = math.nan  # what is usual for the method, which may be chosen for it
    if eps is not None and adaptive is not None and not adaptive:
        raise Misuse("eps makes steps vary and goes with no adaptive=False")
    options.fixed = int(fixed or adaptive is not None and not adaptive)
    options.pushed = int(flag(pushed, "pushed"))
    if until is not None:
        options.ends, options.end = 1, real(until, "until")
    return options


def momentum_from(name: str) -> int:
    if name not in c.MOMENTA:
        raise Misuse(f"momentum: {name!r} is not one of " + ", ".join(c.MOMENTA))
    return c.MOMENTA[name]


def stop_flag() -> ctypes.c_int:
    return ctypes.c_int(0)


def course_of(every: int, momentum: str, steps: int | None, at: Any) -> tuple[Any, np.ndarray]:
    course = c.Course(every=whole(every, "every", 1), momentum=momentum_from(momentum))
    course.flag = stop_flag()
    course.stop = ctypes.pointer(course.flag)
    times = np.empty(0)
    if steps is not None:
        course.steps = whole(steps, "steps", 1)
    if at is not None:
        if course.every != 1:
            raise Misuse(f"every is {every}; it counts steps, and does not go with at and every_time, which say what is kept")
        times = table(np.asarray(at), (np.size(at),), "at")
        if not times.size:
            raise Misuse("at holds no times")
        course.kept = times
        course.times, course.time = times.size, times.ctypes.data
    return course, times
