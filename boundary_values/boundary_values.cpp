#include <Eigen/Eigenvalues>
#include <algorithm>
#include <diracstep/boundary_values/boundary_values.hpp>
#include <diracstep/boundary_values/detail/newton.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/energy_check.hpp>

namespace diracstep {

namespace {

using boundary::MotionEquations;

void require_conditions(const BoundaryConditions& conditions, int n) {
  const auto rows = conditions.value.size();
  for (const Columns* side : {&conditions.at_start, &conditions.at_end}) {
    require_size("conditions: rows", side->rows(), rows);
    require_size("conditions: columns, of q, v and p,", side->cols(), 3L * n);
  }
  if (!conditions.value.allFinite() || !conditions.at_start.allFinite() || !conditions.at_end.allFinite())
    throw Misuse("conditions: a number is not finite");
}

/// A place that is held must be on the rows; a velocity cannot be asked for where none is a datum.
void require_on_rows(const Scene& scene, double t, const Vector& q, const char* which) {
  int row = 0;
  const double largest = max_norm(q);
  const Vector sizes = q.unaryExpr([largest](double x) { return size_beside(x, largest); });
  for (const auto& block : only_holonomic(scene.constraints)) {
    Vector phi(block->rows()), a(block->pattern().nonzeros()), terms(block->rows());
    block->position(t, q, phi);
    block->coefficients(t, q, a, terms);
    terms = std::abs(t) * terms.cwiseAbs();
    block->pattern().multiply_add(a.cwiseAbs().eval().data(), sizes.data(), terms.data());
    for (int i = 0; i < block->rows(); ++i, ++row)
      if (!(std::abs(phi[i]) <= 1e-9 * terms[i]))
        throw Misuse(std::string("the place at the ") + which + " is off " +
                     row_label(only_holonomic(scene.constraints), row) + ": " + to_text(phi[i]));
  }
}

/// As many conditions as the motion needs.
void require_count(const Scene& scene, const BoundaryConditions& conditions, bool phase_space) {
  if (conditions.families) return;
  const int n = scene.dimension(), m = scene.rows();
  const int holonomic = row_count(only_holonomic(scene.constraints));
  const int needed = phase_space ? n : 2 * n - m - holonomic;
  const int given = static_cast<int>(conditions.value.size()) -
                    holonomic * (int{conditions.start_held} + int{conditions.end_held});
  if (given == needed) return;
  std::string why;
  if (phase_space)
    why = ": its Lagrangian is linear in v, so that a place alone determines a motion";
  else if (m > holonomic && given > needed)
    why = ": under " + std::to_string(m - holonomic) +
          " nonholonomic rows the motions from one place end on a set of " + std::to_string(n - m) +
          " dimensions, so that no more than that can be asked of the other end";
  throw Misuse("scene '" + scene.name + "': a motion is determined by " + std::to_string(needed) +
               " conditions on its ends, and " + std::to_string(given) + " are given" + why);
}

/// What may help, by how the search failed.
std::string advice(const BoundaryConditions& conditions) {
  return conditions.families
             ? "; a guess nearer to a solution, more steps or another end time may help"
             : "; a guess nearer to a solution or more steps may help, and where the ends are conjugate "
               "points, or conditions depend on each other, no motion is determined by them";
}

/// Why the action of a motion does not generate it; empty where it does.
std::string why_no_action(const Scene& scene) {
  if (scene.force) return "a force acts: the motion makes no action stationary";
  if (!only_nonholonomic(scene.constraints).empty())
    return "nonholonomic rows act: d'Alembert's principle makes no action stationary";
  if (scene.lagrangian->structure().phase_space())
    return "the Lagrangian is linear in v: both places cannot be chosen";
  return {};
}

Columns hessian_of(MotionEquations& equations, const Vector& u) {
  const int n = equations.n();
  const boundary::DeterminedEnds factor(equations, u);
  const Columns by_places = factor.by_conditions(2 * n);
  Columns hessian(2 * n, 2 * n);
  const auto momenta_at_start = n + n;  // after v0 and q0
  hessian.topRows(n) = -by_places.middleRows(momenta_at_start, n);
  hessian.bottomRows(n) = by_places.middleRows(equations.unknowns() - 2 * n, n);
  return hessian;
}

/// Where the motion is computed, and its ends are read.
struct Solved {
  MotionEquations& equations;
  Integrator& integrator;
  const BoundaryProblem& problem;
  const Vector& u;
};

void add_action(const Solved& of, BoundaryReport& report) {
  MotionEquations& equations = of.equations;
  report.no_action = why_no_action(equations.scene());
  if (!report.no_action.empty()) return;
  const std::optional<double> value = equations.action(of.u);
  if (!value) {
    report.no_action = "the method has no generating function";
    return;
  }
  const int n = equations.n();
  DiscreteAction action{*value, Vector(2 * n), {}};
  action.gradient << -equations.start_momentum(of.u), equations.end_momentum(of.u);
  if (equations.scene().rows() == 0) {
    try {
      MotionEquations places(of.integrator, of.problem.registry, of.problem.steps,
                             between(Vector::Zero(n), Vector::Zero(n)));
      action.hessian = hessian_of(places, of.u);
    } catch (const Misuse&) {
      throw;
    } catch (const Error&) {  // conjugate points
    }
  }
  report.action = std::move(action);
}

void add_family(const Solved& of, BoundaryReport& report) {
  const boundary::FamilyOfEnds factor(of.equations, of.u, boundary::sizes_by_kind(of.equations, of.u));
  report.free_directions = factor.free_directions();
  const Eigen::VectorXcd values = factor.transition().eigenvalues();
  report.multipliers.assign(values.begin(), values.end());
  std::ranges::sort(report.multipliers, [](const auto& a, const auto& b) {
    return std::abs(a) != std::abs(b) ? std::abs(a) > std::abs(b) : a.imag() > b.imag();
  });
}

/// Of the step from the integrator's point: the steps of the search are not divided at kinks, as a run is.
std::string kink_on_the_way(Integrator& integrator, double size) {
  if (!integrator.step(size).ok() || integrator.kinks_passed().empty()) return "";
  return "the motion crosses a kink of the formulas at t = " +
         to_text(integrator.kinks_passed().front().time) +
         ", where a run divides its step and this search does not: a run from this start ends elsewhere; "
         "compare with more steps";
}

/// The equations of a large step have several solutions, of which a run takes the one near its guess.
std::string other_solution(Integrator& integrator, const MotionEquations::Node& from, const Vector& v,
                           const MotionEquations::Node& to) {
  constexpr double same = 1e-6;
  integrator.restart(from.t, from.q, from.p, v);
  const bool stepped = integrator.step(to.t - from.t).ok();
  const Vector& q = integrator.position();
  const double size = std::max(to.q.lpNorm<Eigen::Infinity>(), (to.q - from.q).lpNorm<Eigen::Infinity>());
  const double apart = stepped ? (q - to.q).lpNorm<Eigen::Infinity>() : size;
  constexpr double rest = 1e-12;  // of coordinates that are all zero
  if (stepped && apart <= same * size + rest) return "";
  return "a run from t = " + to_text(from.t) +
         (stepped ? " steps elsewhere, off by " + to_text(apart) : std::string(" fails in its step")) +
         ": steps are so large that their equations have several solutions; smaller ones are needed";
}

/// Positions, velocities and projected momenta at the ends of the steps.
void add_points(const Solved& of, BoundaryReport& report) {
  const std::vector<MotionEquations::Node> nodes = of.equations.nodes(of.u);
  const auto count = static_cast<Eigen::Index>(nodes.size());
  const int n = of.equations.n();
  report.times.resize(count);
  for (Columns* columns : {&report.q, &report.v, &report.p})
    *columns = Columns::Constant(n, count, std::nan(""));
  EnergyCheck energy(of.equations.scene(), of.integrator.method().damped);
  Sample sample;
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto& node = nodes[static_cast<std::size_t>(k)];
    const auto& other = nodes[static_cast<std::size_t>(k + 1 < count ? k + 1 : k - 1)];
    report.times[k] = node.t;
    report.q.col(k) = node.q;
    if (!node.q.allFinite() || !node.p.allFinite() || !other.q.allFinite()) continue;
    const Vector slope = (other.q - node.q) / (other.t - node.t);
    of.integrator.restart(node.t, node.q, node.p, slope);
    if (!of.integrator.sample(Momentum::projected, sample).ok()) continue;
    report.v.col(k) = sample.v;
    report.p.col(k) = sample.p;
    energy.see(sample);
    if (report.doubt.empty() && k + 1 < count && of.equations.scene().kinks)
      report.doubt = kink_on_the_way(of.integrator, other.t - node.t);
    if (report.doubt.empty() && k + 1 < count)
      report.doubt = other_solution(of.integrator, node, sample.v.size() > 0 ? sample.v : slope, other);
  }
  if (report.doubt.empty()) report.doubt = energy.text();
}

}  // namespace

void require_steps(long steps, long most) {
  if (steps < 1 || steps > most)
    throw Misuse(std::to_string(steps) + " steps; 1 or more are needed, and " + std::to_string(most) +
                 " are the most");
}

BoundaryConditions between(ConstVectorRef q0, ConstVectorRef qN) {
  const Eigen::Index n = q0.size();
  require_size("places: numbers at the end", qN.size(), n);
  BoundaryConditions conditions{
      Columns::Zero(2 * n, 3 * n), Columns::Zero(2 * n, 3 * n), Vector(2 * n), true, true, false};
  conditions.at_start.topLeftCorner(n, n).setIdentity();
  conditions.at_end.bottomLeftCorner(n, n).setIdentity();
  conditions.value << q0, qN;
  return conditions;
}

BoundaryConditions periodic(int n) {
  BoundaryConditions conditions{
      Columns::Zero(2 * n, 3 * n), Columns::Zero(2 * n, 3 * n), Vector::Zero(2 * n), false, false, true};
  conditions.at_start.leftCols(2 * n).setIdentity();
  conditions.at_end = -conditions.at_start;
  return conditions;
}

GuessedMotion straight_line(double t0, ConstVectorRef q0, double tN, ConstVectorRef qN) {
  const Vector from = q0, velocity = (qN - q0) / (tN - t0);
  return [=](double t) { return GuessedPoint{from + (t - t0) * velocity, velocity}; };
}

BoundaryReport solve_boundary_values(const BoundaryProblem& problem) {
  require_steps(problem.steps, most_boundary_steps);
  if (!problem.guess) throw Misuse("boundary values: no guess");
  Integrator integrator(problem.scene, problem.registry, problem.solvers, problem.options);
  const Scene& scene = integrator.scene();
  BoundaryConditions conditions = problem.conditions;
  const int n = scene.dimension();
  require_conditions(conditions, n);
  MotionEquations equations(integrator, problem.registry, problem.steps, conditions);
  const bool phase_space = scene.lagrangian->structure().phase_space();
  if (phase_space && !conditions.families &&
      !(conditions.at_start.middleCols(n, n).isZero(0.0) && conditions.at_end.middleCols(n, n).isZero(0.0)))
    throw Misuse("scene '" + scene.name + "': its Lagrangian is linear in v, of which nothing can be asked");
  require_count(scene, conditions, phase_space);
  Vector u = equations.guess(problem.guess);
  const double end_time = equations.nodes(u).back().t;
  if (conditions.start_held) require_on_rows(scene, scene.start.time, conditions.value.head(n), "start");
  if (conditions.end_held) require_on_rows(scene, end_time, conditions.value.tail(n), "end");
  double power = 1.0;
  const auto factor = [&](const Vector& at,
                          const Vector& sizes) -> std::unique_ptr<boundary::LinearisedEnds> {
    if (!conditions.families) return std::make_unique<boundary::DeterminedEnds>(equations, at);
    return std::make_unique<boundary::FamilyOfEnds>(equations, at, sizes, power);
  };
  const Vector at_guess = u;
  boundary::NewtonReport search =
      boundary::newton(equations, u, problem.max_iterations, factor, problem.go_on);
  if (conditions.families && !search.converged &&
      !search.interrupted) {  // less damping, for conditions that are all but degenerate
    power = 2.0;
    u = at_guess;
    search = boundary::newton(equations, u, problem.max_iterations, factor, problem.go_on);
  }
  BoundaryReport report;
  report.iterations = search.iterations;
  report.correction = search.correction;
  report.residual = equations.residual(u).ends.lpNorm<Eigen::Infinity>();
  const auto size_of = [&](const Vector& at) {
    return boundary::sizes_by_kind(equations, at).head(3).maxCoeff();
  };
  const double size = std::max(size_of(u), size_of(at_guess));  // a rest in the origin has none
  report.converged = search.converged && report.residual <= 1e-8 * size;
  report.interrupted = search.interrupted;
  if (search.interrupted)
    report.ending = search.failure;
  else if (report.converged)
    report.ending = "the corrections are round-off";
  else if (search.converged)
    report.ending =
        "no motion fulfils the conditions near the guess: they contradict each other, or the rows";
  else
    report.ending = "Newton's method has not converged: " + search.failure + advice(conditions);
  const Solved solved{equations, integrator, problem, u};
  add_points(solved, report);
  if (!report.converged) return report;
  add_action(solved, report);
  if (conditions.families) add_family(solved, report);
  return report;
}

}  // namespace diracstep
