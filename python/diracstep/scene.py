"""Scenes: what moves, from where, and all that can be done with it."""

from __future__ import annotations

import os
import re
import reprlib
from typing import Any, Callable, Mapping, Sequence

import numpy as np

from .arrays import column, flag, real, reals, text, whole
from .callbacks import CallbackScene, GeneratingFunction, say_cost
from .command import Varied, sweep
from .ends import BoundaryMotion, ControlledMotion, boundary_of, control_of
from .equilibria import Equilibrium, SolvedStart, equilibrium_of, start_of
from .errors import Misuse
from .fits import Fit, fit_of
from .integrator import Integrator
from .motions import ensemble_of, run_of, search_of, times_every
from .opened_scene import OpenedScene
from .opening import names_of, parts_of
from .options import course_of, refuse_unused, require_fixed
from .plan import TextTable
from .run import Ensemble, Run
from .scene_text import SceneText, require_names, start_values
from .study import Study, run_study


class Scene(OpenedScene):
    """A mechanical system with constraints: L(q, v, t), rows A(q, t) v + b(q, t) = 0 or φ(q, t) = 0, a force, and a start.

    The functions are called **once**, with symbols, and become a compiled scene; nothing of Python runs in a step::

        ds.Scene(coordinates=["x", "y", "a"], parameters={"g": 9.81},
                 lagrangian=lambda q, v, g: (v.x**2 + v.y**2 + v.a**2)/2 + g*q.x,
                 rows=lambda q, v: v.x*ds.sin(q.a) - v.y*ds.cos(q.a),
                 v=[0, 0, 1], until=10, step=0.1)

    Arguments of the functions go by their names: ``q``, ``v`` (``p`` in a Hamiltonian), ``t``, and the parameters, which can be
    changed afterwards with ``with_parameters``.

    coordinates: names, in the order of all columns.
    lagrangian, hamiltonian, dissipation: one formula each, an energy (Rayleigh's function: a power).
    rows: one expression, a list, or {name: expression}, each zero along the motion; or a list of such functions.
    force: generalised forces, a column or {coordinate: force}.
    q, v, p, t: where the motion starts; a column or {coordinate: value}, 0 where nothing is said.  start: the same by name in
    one, {"x": 1.0, "v_x": 0.5}.
    until, step: where runs end that are given no other end, and a coarse but sensible step.
    invariants: {name: function}, quantities that the motion keeps.
    tolerances: {coordinate: absolute tolerance in its unit}, for one far smaller than the others.
    callback: True calls the Python functions at every evaluation instead; its cost is measured and warned of.
    """

    def __init__(self, coordinates: Sequence[str], lagrangian: Callable[..., Any] | None = None, *,
                 hamiltonian: Callable[..., Any] | None = None, dissipation: Callable[..., Any] | None = None, rows: Any = None,
                 force: Callable[..., Any] | None = None, parameters: Mapping[str, float] | None = None, q: Any = None,
                 v: Any = None, p: Any = None, t: float = 0.0, start: Mapping[str, float] | None = None, until: float = 1.0,
                 step: float = 0.1,
                 invariants: Mapping[str, Callable[..., Any]] | None = None, name: str = "scene", description: str = "",
                 callback: bool = False, plugins: Sequence[str] = (), methods: Sequence[GeneratingFunction] = (),
                 drop_redundant: bool = False, tolerances: Mapping[str, float] | None = None) -> None:
        if getattr(self, "_handle", 0):
            raise Misuse("a scene is made once")
        coordinates, parameters = names_of(coordinates), reals(parameters, "parameters")
        require_names(list(parameters), "parameters")
        name, description = text(name, "name"), text(description, "description")
        if not re.fullmatch("[A-Za-z0-9_]+", name):
            raise Misuse(f"name is {reprlib.repr(name)}; letters of ASCII, digits and _ are needed")
        until, step, t = real(until, "until"), real(step, "step"), real(t, "t")
        if start is not None:
            if q is not None or v is not None or p is not None:
                raise Misuse("start goes with no q, v or p: it holds them by name")
            q, v, p = parts_of(start, coordinates)
        if flag(callback, "callback"):
            if lagrangian is None or hamiltonian or dissipation or invariants or p is not None:
                raise Misuse("callback=True needs a lagrangian, and knows no hamiltonian, dissipation, invariants or start p")
            zeros = np.zeros(len(coordinates))
            source = CallbackScene(name, coordinates, parameters, lagrangian, rows, force,
                                   zeros if q is None else column(q, coordinates, "q"),
                                   zeros if v is None else column(v, coordinates, "v"), t, until, step)
            self._open(callbacks=source, coordinates=coordinates, plugins=plugins, methods=methods, drop_redundant=drop_redundant,
                       tolerances=tolerances)
            say_cost(self, source)
            return
        if lagrangian is None and hamiltonian is None:
            raise Misuse("a scene needs a lagrangian or a hamiltonian, such as lagrangian=lambda q, v: …")
        writer = SceneText(name, coordinates, parameters)
        writer.add("lagrangian", lagrangian)
        writer.add("hamiltonian", hamiltonian)
        writer.add("dissipation", dissipation)
        writer.add_rows(rows)
        writer.add_force(force)
        writer.add_invariants(invariants or {})
        written = writer.text(start_values(coordinates, q, v, p, t), until, step, {"description": description})
        self._open(text=written, name=name, coordinates=coordinates, plugins=plugins, methods=methods,
                   drop_redundant=drop_redundant, tolerances=tolerances)

    @classmethod
    def _made(cls, **given: Any) -> Scene:
        scene = cls.__new__(cls)
        scene._open(**given)
        return scene

    @property
    def coordinates(self) -> list[str]:
        """Names, in the order of the n columns of v and p; of those of q where the scene is in R^n, else see ``positions``."""
        return list(self._coordinates)

    @property
    def positions(self) -> list[str]:
        """Names of the s numbers of q, in the order of its columns: the coordinates, or on groups and spheres what is stored, such as
        ``R_w``, ``R_x``, ``R_y``, ``R_z`` of a rotation whose velocity is ``v_R_1`` … (docs/manifolds.md)."""
        return list(self._positions)

    @property
    def rows(self) -> list[str]:
        """Names of the constraints."""
        return list(self._rows)

    @property
    def invariants(self) -> list[str]:
        """Names of what the motion keeps."""
        return list(self._invariants)

    @property
    def outputs(self) -> list[str]:
        """Names of the formulas of the scene's file that runs tell: [outputs], powers of elements, voltages of nodes."""
        return list(self._outputs)

    def with_parameters(self, **parameters: float) -> Scene:
        """The same scene with other values of parameters and sizes; nothing is compiled again."""
        if self._callbacks is not None:
            raise Misuse("the parameters of a scene of callbacks are fixed; make it anew")
        return Scene._made(**self._again, parameters={**self._changes, **parameters})

    def with_tolerances(self, tolerances: Mapping[str, float]) -> Scene:
        """The same scene with absolute tolerances, in their units, of coordinates that are far smaller than others."""
        if self._callbacks is not None:
            raise Misuse("the tolerances of a scene of callbacks are stated where it is made")
        again: dict[str, Any] = {**self._again, "tolerances": {**self._tolerances, **reals(tolerances, "tolerances")}}
        return Scene._made(**again, parameters=self._changes)

    def __reduce__(self) -> tuple[Any, ...]:
        """A scene is copied and pickled as what it was made from, and made anew from that."""
        if self._callbacks is not None or self._methods:
            raise TypeError("a scene of callbacks, or with methods in Python, is not copied or pickled: make it again")
        return made_from, ({**self._again, "parameters": self._changes},)

    # ---- runs ----
    def run(self, *, until: float | None = None, steps: int | None = None, at: Any = None, every_time: float | None = None,
            error: float | None = None, every: int = 1, momentum: str = "projected", progress: bool | None = None,
            max_solves: int = 0, max_time: float = 0.0,
            tolerances: Mapping[str, float] | None = None, **options: Any) -> Run:
        """One motion from the scene's start, as a Run.

        until: time of the end, the scene's own without it; a fixed ``step`` is made so much smaller that whole steps lead there.
        steps: so many steps instead.  at: times to show instead of the steps, in their order; every_time: the start and each so
        much time later.  Values between steps have the order of the method, and the motion keeps its bits; at the time of an event
        they are those behind it.
        error: a relative error at the end; the library finds method and steps, repeating the run until its estimate is below
        (``max_solves`` and ``max_time`` in seconds limit that; ``adaptive=True`` or ``False`` decides whether steps vary, which
        they do not through events).
        every: keeps each so-many-th point.  momentum: the representative kept as p: projected, plus or minus.
        progress: shows a bar (tqdm where installed); without it on long runs only.
        tolerances: {coordinate: absolute tolerance in its unit}, see with_tolerances.
        Further options: method, order, step, rule, solver ("newton", "fixed-point", "automatic", "direct"), jacobian, project_start,
        substeps, compensated_sums; max_steps, beyond which there is a Misuse (a Failure where they vary); adaptive, eps (radians of a
        step), and with one of them control and smallest_step.  What nothing would read is a Misuse.
        What is left open is chosen as by the command ``diracstep run``: a motion that is damped strongly is stepped by
        damped/radau:3 with steps that vary, unless a step, ``steps`` or ``adaptive=False`` is given.

        Events of the scene act, and end the run where they say so: see ``Run.events``.
        Warns with Doubt where the library's checks find the result not to be believed.  Raises Misuse, or Failure, which holds
        what was computed in ``run``.  Ctrl-C ends the run and keeps what is computed.
        """
        counted = steps is not None
        if counted + (at is not None) + (every_time is not None) > 1 or counted and (until is not None or error is not None):
            raise Misuse("steps, at and every_time exclude each other, and steps goes with no until and no error")
        if error is None and (max_solves or max_time):
            raise Misuse("max_solves and max_time limit the search for an error, and go with error")
        if tolerances is not None:
            return self.with_tolerances(tolerances).run(
                until=until, steps=steps, at=at, every_time=every_time, error=error, every=every, momentum=momentum,
                progress=progress, max_solves=max_solves, max_time=max_time, **options)
        if every_time is not None:
            at = times_every(self, real(every_time, "every_time"), self.until if until is None else real(until, "until"))
        progress = None if progress is None else flag(progress, "progress")
        course, times = course_of(every, momentum, steps, at)
        if error is not None:
            return search_of(self, course, times, error, until, options, max_solves, max_time, progress)
        return run_of(self, course, times, until, options, progress)

    def ensemble(self, q: Any, v: Any = None, *, t: Any = None, until: float | None = None, steps: int | None = None,
                 threads: int = 0, momentum: str = "projected", **options: Any) -> Ensemble:
        """The ends of many motions, stepped by threads in C++ (0: one for each processor); the same bits for any number.

        q: N × s, v: N × n, consistent starts; v is the scene's where it is left out.  t: N starting times, the scene's without;
        equal ones where no steps are given.  Events of the scene act, and a motion that one ends is read there.
        Warns with Doubt where the checks of a run, which go along with at most twenty members, find one not to be believed.
        Ctrl-C ends it with KeyboardInterrupt.
        """
        require_fixed(options, "an ensemble")
        if steps is not None and until is not None:
            raise Misuse(f"until is {until!r}; steps goes with no until: so many steps end where they end")
        return ensemble_of(self, q, v, t, until, steps, threads, momentum, options)

    def integrator(self, *, until: float | None = None, pushed: bool = False, **options: Any) -> Integrator:
        """An integrator at the scene's start, to be stepped by hand; options as for ``run``.  Steps are of one size unless
        ``adaptive`` or ``eps`` says otherwise.

        until: where the motion will end: a fixed step is then fitted to it.  pushed: ``push`` will be used.
        """
        refuse_unused(options)
        return Integrator(self, until, pushed, options)

    def boundary(self, to: Any = None, *, start: Any = None, periodic: bool = False, until: float | None = None, guess: Any = None,
                 max_iterations: int = 60, **options: Any) -> BoundaryMotion:
        """The motion from one end to another, all steps solved at once.

        to, start: what is asked of the end and of the start, a place or {"x": 1.0, "v_x": 0.5, "p_y": 0.0}; without ``start`` its
        place is that of the scene.  periodic: q and v at the end as at the start, instead.
        until: time of the end.  guess: a run, another such motion or {"t": …, "q": …, "v": …} that the search begins with; without
        it a straight line between two places, else the motion from the scene's start.  options: method, order, step and others of
        ``run`` for steps of one size.

        Raises Misuse where the conditions are too many or too few; Failure, whose ``run`` is the last iterate, where the search
        does not converge.  Warns with Doubt where the steps are too large.  Ctrl-C ends it with KeyboardInterrupt.
        """
        require_fixed(options, "a motion between two ends")
        return boundary_of(self, to, start, periodic, until, guess, max_iterations, options)

    def control(self, to: Any = None, *, start: Any = None, at_least: Mapping[str, float] | None = None,
                at_most: Mapping[str, float] | None = None, degree: int = 0, until: float | None = None, guess: Any = None,
                tolerance: float = 1e-9, max_iterations: int = 500, **options: Any) -> ControlledMotion:
        """The controls of least cost, for a scene whose file has a table [control]; needs a library with Ipopt.

        to, start: as for ``boundary``, but any number; without ``start`` place and velocity are those of the scene's start.
        at_least, at_most: bounds by name of coordinates at the ends of steps, and of controls.  degree: of the polynomials in t
        that controls are in each step.  until, guess, options: as for ``boundary``.  tolerance: of the optimality conditions.

        Raises Misuse without Ipopt or [control]; Failure, whose ``run`` is the last iterate, where the search does not converge.
        Warns with Doubt where a run with these controls ends elsewhere.  Ctrl-C ends it with KeyboardInterrupt.
        """
        require_fixed(options, "optimal control")
        return control_of(self, to, start, at_least, at_most, degree, until, guess, tolerance, max_iterations, options)

    @property
    def plan(self) -> TextTable:
        """What is assembled for this scene, and what is left out and why."""
        return Integrator(self, None, False, {}, fixed=False).plan

    def study(self, *, methods: Sequence[str] = (), orders: Sequence[int] = (), steps: Sequence[float] = (),
              rtols: Sequence[float] = (), until: float | None = None, ida: bool = True, erk: bool = True, repeat: int = 1,
              budget: float = 0.2) -> Study:
        """Error against run time of methods, beside SUNDIALS IDA and an explicit code.

        Made by the command ``diracstep study``, which must be installed; the scene goes there as its file's text.
        """
        return run_study(self, methods=methods, orders=orders, steps=steps, rtols=rtols, until=until, ida=ida, erk=erk,
                         repeat=repeat, budget=budget)

    def equilibrium(self, *, along: bool = False, modes: int | None = None, near: float | None = None) -> Equilibrium:
        """Where the scene rests, from its start as the guess, and its small motions there: eigenvalues and modes.

        along: a steady motion, in which coordinates with a velocity at the start keep moving.
        modes: so many, by sparse matrices, the nearest to ``near`` or else the slowest; without both all of them, or ten of a scene
        of more than 2000 coordinates and rows.  Events are not looked for.
        Raises Failure where none is found; warns with Doubt where the linear equations change until the scene's end.  Ctrl-C ends it
        with KeyboardInterrupt.
        """
        return equilibrium_of(self, along, modes, near)

    def start(self) -> SolvedStart:
        """The start that runs take, with momenta, accelerations and forces of rows, and where each value is from."""
        return start_of(self)

    def fit(self, data: Any, parameters: Sequence[str], *, start: Mapping[str, float] | None = None,
            sigma: Mapping[str, float] | None = None, confidence: float = 0.95, max_motions: int = 200, **options: Any) -> Fit:
        """Parameters for which the motion is nearest to data, with confidence intervals.

        data: a CSV file, or {"t": …, "x": …, "v_x": …}, columns of one length: coordinates, velocities and outputs; an empty field
        or NaN where nothing was measured.
        start: where the search begins, by parameter.  sigma: standard deviations by column, 1 without.  options: method, order,
        rule, solver, jacobian and step, the largest: between two times so many equal ones are taken.
        Raises Failure where the search does not end at a least sum of squares; warns with Doubt where what is left is far larger
        than sigma.  Ctrl-C ends it with KeyboardInterrupt.
        """
        require_fixed(options, "a fit")
        return fit_of(self, data, parameters, start, sigma, confidence, max_motions, options)

    def sweep(self, grid: Mapping[str, Sequence[float]] | None = None, record: Sequence[str] = (), *,
              table: Mapping[str, Sequence[float]] | None = None, random: Mapping[str, Sequence[Any]] | None = None,
              sobol: Mapping[str, Sequence[Any]] | None = None, count: int | None = None, seed: int = 0,
              extrema: Sequence[str] = (), events: Sequence[str] = (), derivatives: Sequence[str] = (),
              until: float | None = None, step: float | None = None, method: str | None = None, order: int | None = None,
              rule: str | None = None, error: float | None = None, project: bool = False, checks: bool = True,
              out: str | os.PathLike[str] | None = None, threads: int = 0) -> np.ndarray:
        """One run for each of many parameters and starts: a structured array with a row for each.

        What varies has the name of a parameter, or "start.x", "start.v_x".  grid: every combination of these values.  table:
        columns of one length, a member for each row.  random, sobol: ``count`` draws by laws, {"e": ("uniform", 0, 0.7)}, also
        "log_uniform", and "normal" with mean and deviation.  All that is given multiplies.
        record: columns of the end; extrema: of them over the run; events: of the scene, time of the first and how many;
        derivatives: "d(x)/d(m)", at the end by parameters.  project: starts are moved onto the rows; checks: members are looked
        at as runs are.
        out: a folder to keep, which a further call continues; it holds the reasons of members that failed (``results.csv``) and a
        page (``report.html``).  The column ``status`` says how a member ended; where it failed numbers are NaN.
        Made by ``diracstep sweep``.
        """
        settings = {"end": until, "step": step, "method": method, "order": order, "rule": rule, "error": error,
                    "project": project or None, "checks": None if checks else False}
        varied = Varied(grid or {}, table or {}, random or {}, sobol or {}, count, seed)
        recorded = {"values": record, "extrema": extrema, "events": events, "derivatives": derivatives}
        return sweep(self, varied, recorded, settings, out, whole(threads, "threads"))

    def __repr__(self) -> str:
        return f"<scene {self.name}: {', '.join(self.coordinates)}; {len(self.rows)} rows>"

    def _repr_html_(self) -> str:
        return TextTable(self.name, ("", ""), self.about)._repr_html_() + self.plan._repr_html_()


def made_from(again: dict[str, Any]) -> Scene:
    """A scene that was copied or pickled."""
    return Scene._made(**again)
