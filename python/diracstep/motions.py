"""Motions of a scene from its start: one run, the search for an error, many starts."""

from __future__ import annotations

import ctypes
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _library as c
from .arrays import address, flag, real, table, whole
from .errors import Doubt, Interrupted, Misuse, spelled
from .integrator import Integrator
from .options import momentum_from, options_from, refuse, refuse_unused, stop_flag
from .points import Points
from .progress import Progress
from .run import Ensemble, Event, Run, Search, Statistics, event_from, search_from

if TYPE_CHECKING:
    from .scene import Scene

_ROOM = 1024  # points of a run whose number is not known


def run_of(scene: Scene, course: Any, times: np.ndarray, until: float | None, options: dict[str, Any],
           progress: bool | None) -> Run:
    """A run along a course, which shows these times if there are any."""
    refuse_unused(options, max_steps=True)
    counted, at_times = course.steps > 0, times.size > 0
    end = None if counted else _end(scene, until, times, options)
    integrator = Integrator(scene, end, False, options, counted)
    _require_few(scene, integrator.statistics.step, course.steps, end, options.get("max_steps"))
    room = c.lib.expect(integrator._handle, ctypes.byref(course))
    if room > 2**40:
        raise Misuse(f"{room} points would be kept; take a larger every")
    points = Points(scene._widths, room or _ROOM)
    with Progress(progress, points, room, scene.start_time, end) as bar:
        code, message = c.call_interruptibly(lambda: c.lib.run(integrator._handle, ctypes.byref(course), points.reference()),
                                             course.flag, bar.show)
    taken = integrator.statistics
    return _finished(scene, points, code, message, statistics=taken, doubt=integrator.doubt, events=integrator.events,
                     again=None if at_times else (end, {**options, "max_steps": None}, taken.steps))


def search_of(scene: Scene, course: Any, times: np.ndarray, error: float, until: float | None, options: dict[str, Any], max_solves: int,
              max_time: float, progress: bool | None) -> Run:
    for name in ("eps", "smallest_step", "max_steps"):
        if options.get(name) is not None:
            raise Misuse(f"{name} goes with no error: the search finds the steps; max_solves and max_time limit it")
    kind = options.pop("adaptive", None)
    kind = None if kind is None else flag(kind, "adaptive")
    if kind is False:
        refuse(options, ("control",), "it is for steps that vary, which adaptive=False excludes")
    request = c.ErrorRequest(error=real(error, "error"), steps=0 if kind is None else 2 if kind else 1,
                             max_solves=whole(max_solves, "max_solves"), max_time=real(max_time, "max_time"))
    if request.max_time < 0.0:
        raise Misuse(f"max_time is {request.max_time}; a number of seconds above 0 is needed")
    if times.size:
        until = _end(scene, until, times, {})
    chosen, found = options_from(options, until), c.Found()
    points = Points(scene._widths, _ROOM)
    told: list[Search] = []
    events: list[Event] = []

    def call() -> int:
        code = c.lib.solve(scene._handle, ctypes.byref(chosen), ctypes.byref(course), ctypes.byref(request), points.reference(),
                           ctypes.byref(found))
        if found.runs.columns:  # texts belong to this thread, and to its last call
            told.append(search_from(found))
            events.extend(event_from(found.event[k], scene._widths) for k in range(found.events))
        return code

    with Progress(progress, points, 0, scene.start_time, None) as bar:
        code, message = c.call_interruptibly(call, course.flag, bar.show)
    search = told[0] if told else None
    again = None
    if search and not search.varies and not scene.events and not times.size:
        found_steps = {**options, "method": search.method, "order": search.order, "step": search.step}
        again = scene.until if until is None else real(until, "until"), found_steps, None
    return _finished(scene, points, code, message, search=search, doubt=search.warning if search else "", events=events,
                     again=again)


def ensemble_of(scene: Scene, q: Any, v: Any, t: Any, until: float | None, steps: int | None, threads: int, momentum: str,
                options: dict[str, Any]) -> Ensemble:
    starts_q = np.asarray(q)
    if starts_q.ndim != 2:
        raise Misuse(f"q has shape {starts_q.shape}; (members, {len(scene._positions)}) is needed: a start in each row")
    members = len(starts_q)
    starts_q = table(starts_q, (members, len(scene._positions)), "q")
    starts_v = None if v is None else table(v, (members, len(scene._coordinates)), "v")
    times = None if t is None else table(t, (members,), "t")
    flag, points = stop_flag(), Points(scene._widths, members, grows=False)
    request = c.Ensemble(members=members, q=starts_q.ctypes.data, v=address(starts_v), time=address(times),
                         steps=0 if steps is None else whole(steps, "steps", 1), momentum=momentum_from(momentum),
                         threads=whole(threads, "threads", most=2**31 - 1), stop=ctypes.pointer(flag))
    request.kept = starts_q, starts_v, times  # the call may go on after a second Ctrl-C has left this function
    chosen = options_from(options, None if steps is not None else scene.until if until is None else until)
    told: dict[str, dict[int, str]] = {"failed": {}, "doubted": {}}
    table_of = c.Table()

    def call() -> int:
        code = c.lib.run_ensemble(scene._handle, ctypes.byref(chosen), ctypes.byref(request), points.reference(),
                                  ctypes.byref(table_of))
        for member, what, why in table_of.lines():
            told[what][int(member)] = why
        return code

    for array in points.arrays.values():
        array[:] = np.nan  # what cannot be read stays so
    if members:
        code, message = c.call_interruptibly(call, flag)
        if code == c.INTERRUPTED:
            raise KeyboardInterrupt(message)
        if code != c.OK:
            scene._raise(code, message)
    if told["doubted"]:
        member, why = next(iter(told["doubted"].items()))
        warnings.warn(f"{scene.name}: member {member}: {spelled(why)}", Doubt, stacklevel=3)
    return Ensemble(scene, **points.arrays, failures=told["failed"], doubts=told["doubted"])


def _end(scene: Scene, until: float | None, times: np.ndarray, options: dict[str, Any]) -> float:
    """Where steps are to lead: as far as the times to show, where that is farther than the end of the scene."""
    if not times.size:
        return scene.until if until is None else real(until, "until")
    if until is not None:
        end, last = real(until, "until"), float(times[-1])
        if abs(last - scene.start_time) > (1.0 + 1e-9) * abs(end - scene.start_time) or (last - scene.start_time) * (end - scene.start_time) < 0.0:
            raise Misuse(f"at: t = {last:g} lies behind t = {end:g}, the end; until moves it")
        return end
    last, varies = float(times[-1]), bool(options.get("adaptive") or options.get("eps"))
    inside = (last - scene.start_time) * (scene.until - last) >= 0.0
    return scene.until if inside and not varies else last


def _require_few(scene: Scene, step: float, steps: int, end: float | None, most: int | None) -> None:
    """Raises Misuse where steps of one size would be more than ``max_steps``; those that vary end there by themselves."""
    if most is None or step == 0.0:
        return
    where = "" if end is None else f" lead to t = {end:g}"
    count = steps if end is None else round(abs((end - scene.start_time) / step))
    if count > most:
        raise Misuse(f"{count} steps of {abs(step):g}{where}; max_steps allows {most}")


def times_every(scene: Scene, between: float, end: float) -> np.ndarray:
    if between <= 0.0:
        raise Misuse(f"every_time is {between}; a number above 0 is needed")
    span = end - scene.start_time
    count = np.floor(abs(span) / between + 1e-9)
    if count > 1e8:
        raise Misuse(f"every_time = {between:g} asks for {count:g} points; 1e8 are the most")
    return scene.start_time + np.copysign(np.arange(count + 1.0) * between, span)


def _finished(scene: Scene, points: Points, code: int, message: str, *, statistics: Statistics | None = None,
              search: Search | None = None, doubt: str = "", events: list[Event] | None = None,
              again: Any = None) -> Run:
    arrays: dict[str, Any] = points.finish()
    run = Run(scene, **arrays, statistics=statistics, search=search, doubt=doubt, interrupted=code == c.INTERRUPTED,
              events=events or [], _again=again if code == c.OK else None)
    if points.failure is not None:
        raise points.failure
    if code == c.INTERRUPTED:
        warnings.warn(spelled(message), Interrupted, stacklevel=4)
    elif code != c.OK:
        scene._raise(code, message, run)
    if doubt:
        warnings.warn(f"{scene.name}: {spelled(doubt)}", Doubt, stacklevel=4)
    return run
