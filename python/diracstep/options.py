"""How a scene is stepped: keyword arguments as the structs of the library."""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np

from . import _library as c
from .arrays import flag, real, table, text, whole
from .errors import Misuse

_LARGEST_INT = 2**31 - 1  # of C
KNOWN = ("method", "order", "step", "rule", "solver", "jacobian", "project_start", "substeps", "compensated_sums", "adaptive",
         "eps", "control", "smallest_step", "max_steps")


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
    options.max_steps = whole(given.get("max_steps") or 0, "max_steps")
    for name in ("project_start", "compensated_sums"):
        setattr(options, name, int(flag(given.get(name, False), name)))
    if given.get("step") is not None:
        options.step = real(given["step"], "step")
        if options.step == 0.0:
            raise Misuse("step is 0; a number other than zero is needed")
    options.smallest_step = real(given.get("smallest_step") or 0.0, "smallest_step")
    eps = given.get("eps")
    if eps is not None:
        options.eps = real(eps, "eps")
        if options.eps <= 0.0:
            raise Misuse(f"eps is {options.eps}; a number of radians above 0 is needed")
    adaptive = given.get("adaptive")
    if adaptive is not None and flag(adaptive, "adaptive") and eps is None:
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
        times = table(np.asarray(at), (np.size(at),), "at")
        if not times.size:
            raise Misuse("at holds no times")
        course.kept = times
        course.times, course.time = times.size, times.ctypes.data
    return course, times
