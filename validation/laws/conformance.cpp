#include <algorithm>
#include <cmath>
#include <diracstep/core/dirac/discrete_action.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/laws/conformance.hpp>
#include <diracstep/validation/laws/law_scenes.hpp>
#include <diracstep/validation/laws/single_step.hpp>
#include <diracstep/validation/laws/stage_membership.hpp>

namespace diracstep {

namespace {

constexpr double round_off = 1e-12;
constexpr long fitted_points = 4;

struct Point {
  double step, error;
};

/// Least-squares slope of log(error) over log(step).
double slope_of(const std::vector<Point>& points) {
  double x_mean = 0.0, y_mean = 0.0, xy = 0.0, xx = 0.0;
  const auto count = static_cast<double>(points.size());
  for (const Point& point : points) {
    x_mean += std::log(point.step) / count;
    y_mean += std::log(point.error) / count;
  }
  for (const Point& point : points) {
    const double x = std::log(point.step) - x_mean;
    xy += x * (std::log(point.error) - y_mean);
    xx += x * x;
  }
  return xy / xx;
}

using laws::join;

/// The state after a number of steps; throws nothing, returns the failure.
std::string end_of(const Registry& registry, const std::shared_ptr<const Scene>& scene,
                   const IntegratorOptions& options, long steps, Momentum momentum, Sample& end,
                   long* solves = nullptr) {
  Integrator integrator(scene, registry, kinsol(), options);
  const StepReport last = take_steps(integrator, steps);
  if (!last.ok()) return last.failure;
  if (solves != nullptr) *solves = integrator.work().solves;
  const SolveReport read = integrator.sample(momentum, end);
  return read.ok() ? "" : std::string("reading the state: ") + describe(read.status);
}

std::shared_ptr<const Scene> starting_at(const Scene& scene, const Sample& point) {
  auto copy = std::make_shared<Scene>(scene);
  copy->start = {point.time, point.q, point.v};
  return copy;
}

/// Whether the slopes of the last points and of those before them agree closely: finer steps would tell
/// nothing new.
bool settled(const std::vector<Point>& points) {
  if (std::ssize(points) < 6 * fitted_points) return false;
  const auto end = points.end();
  return std::abs(slope_of({end - fitted_points, end}) -
                  slope_of({end - 2 * fitted_points, end - fitted_points})) < 0.01;
}

void find_reference(OrderScene& scene) {
  const StepGrid grid = fit_steps(0.0, scene.t_end, scene.t_end / 240.0);
  const IntegratorOptions options{.method = "type1/gl:6", .step = grid.step};
  end_of(Registry::with_built_ins(), scene.scene, options, grid.steps, Momentum::projected, scene.reference);
}

}  // namespace

std::vector<OrderScene> order_scenes() {
  std::vector<OrderScene> scenes;
  scenes.push_back({"unconstrained", laws::unconstrained(), 6.0, {}});
  scenes.push_back({"holonomic", laws::holonomic_sphere(), 6.0, {}});
  scenes.push_back({"nonholonomic", laws::nonholonomic(), 6.0, {}});
  scenes.push_back({"mixed", laws::mixed(), 6.0, {}});
  scenes.push_back({"affine, driven", laws::driven(), 6.0, {}});
  scenes.push_back({"forced, mixed", laws::forced(laws::mixed()), 6.0, {}});
  scenes.push_back({"phase space", laws::phase_space(), 6.0, {}});
  for (OrderScene& scene : scenes) find_reference(scene);
  return scenes;
}

OrderScene degenerate_order_scene() {
  OrderScene scene{"degenerate circuit", laws::degenerate_circuit(), 6.0, {}};
  find_reference(scene);
  return scene;
}

bool takes(const Method& method, const OrderScene& scene) {
  if (scene.scene->lagrangian->structure().y_hessian_zero)
    return method.info.stages > 0 || method.info.damped;
  return !(scene.scene->force && method.info.type == GeneratingType::four);
}

int claimed_order(const MethodInfo& method, const Scene& scene) {
  const bool constrained = scene.rows() > 0 || scene.force;
  return constrained && method.constrained_order > 0 ? method.constrained_order : method.order;
}

OrderMeasurement measure_order(const Registry& registry, const OrderScene& scene, IntegratorOptions options,
                               Momentum momentum) {
  const auto everything = [](const Sample& s) { return join(join(s.q, s.p), s.lambda); };
  const Vector expected = everything(scene.reference);
  const double claimed = options.order > 0 ? options.order : registry.method(options.method).info.order;
  std::vector<Point> points;
  OrderMeasurement result{std::nan(""), 0.0, 0.0, {}, false};
  for (int quarter_octave = 0; quarter_octave <= 40; ++quarter_octave) {
    const long steps = std::lround(4.0 * std::pow(2.0, 0.25 * quarter_octave));
    options.step = scene.t_end / static_cast<double>(steps);
    Sample end;
    long solves = 0;
    const std::string failure = end_of(registry, scene.scene, options, steps, momentum, end, &solves);
    if (!failure.empty()) {
      // Coarse steps may be beyond the method; only fine ones count.
      if (options.step < 0.02) result.failure = failure;
      points.clear();
      continue;
    }
    const double error = (everything(end) - expected).lpNorm<Eigen::Infinity>();
    if (error < std::max(round_off, 1e-13 * std::sqrt(static_cast<double>(solves)))) break;
    if (std::ssize(points) >= fitted_points && error < 1e-9) {
      std::vector<Point> last(points.end() - fitted_points + 1, points.end());
      last.push_back({options.step, error});
      if (slope_of(last) < 0.5 * claimed) {
        // Round-off takes over; it has touched the points close above this one too.
        std::erase_if(points, [error](const Point& point) { return point.error < 30.0 * error; });
        break;
      }
    }
    points.push_back({options.step, error});
    if (settled(points)) break;
  }
  if (std::ssize(points) < fitted_points) {
    if (!result.failure.empty()) return result;
    result.failure = "too few points above round-off";
    result.in_round_off = true;
    return result;
  }
  points.erase(points.begin(), points.end() - fitted_points);
  return {slope_of(points), points.back().error, points.back().step, result.failure, false};
}

double reversal_defect(const Registry& registry, const std::shared_ptr<const Scene>& scene,
                       const IntegratorOptions& options) {
  Sample start, there, again;
  IntegratorOptions backward = options;
  backward.step = -options.step;
  if (!end_of(registry, scene, options, 0, Momentum::projected, start).empty() ||
      !end_of(registry, scene, options, 1, Momentum::projected, there).empty() ||
      !end_of(registry, starting_at(*scene, there), backward, 1, Momentum::projected, again).empty())
    return std::nan("");
  return (join(again.q, again.p) - join(start.q, start.p)).lpNorm<Eigen::Infinity>();
}

double symplecticity_defect(const Registry& registry, const std::shared_ptr<const Scene>& scene,
                            const IntegratorOptions& options) {
  return laws::symplecticity_defect(registry.method(options.method), *scene, options.step);
}

double membership_residual(const Registry& registry, const std::shared_ptr<const Scene>& scene,
                           const IntegratorOptions& options, long steps) {
  const Method method = registry.method(options.method);
  if (!method.generating_function || method.info.type == GeneratingType::four) return std::nan("");
  if (!laws::generating_function_determines(method, *scene))
    return stage_membership_residual(registry, scene, options, steps);
  std::vector<Vector> q, plus, minus;
  for (const Momentum momentum : {Momentum::plus, Momentum::minus}) {
    Integrator integrator(scene, registry, kinsol(), options);
    q.clear();
    const RunReport report = run_steps(integrator, steps, momentum, 1, [&](const Sample& sample) {
      q.push_back(sample.q);
      (momentum == Momentum::plus ? plus : minus).push_back(sample.p);
      return true;
    });
    if (!report.ok()) return std::nan("");
  }
  const auto s = method.generating_function(*scene);
  const ConstraintRule rule = options.constraint_rule.value_or(method.info.constraint_rule);
  DiscreteDiracStructure structure(scene->constraints, scene->dimension(), rule);
  const GraphOf graph = graph_of(s->type());
  double largest = 0.0;
  for (std::size_t k = 0; k + 1 < q.size(); ++k) {
    const Interval step{scene->start.time + static_cast<double>(k) * options.step, options.step};
    Columns y(s->dimension(), s->columns()), g(s->dimension(), s->columns());
    y.col(0) = graph.starts_from_position ? q[k] : minus[k];
    y.col(1) = graph.ends_at_position ? q[k + 1] : plus[k + 1];
    s->guess_inner(step, q[k], minus[k], (q[k + 1] - q[k]) / options.step, y.rightCols(s->inner_columns()));
    if (!make_stationary(*s, step, y)) return std::nan("");
    s->gradient(step, y, g);
    const Covector d{y.col(0), y.col(1), g.col(0), g.col(1)};
    const bool lagrangian = s->type() == GeneratingType::one;
    const auto take = [&](const Membership& m) {
      largest = std::max({largest, m.constraint, m.annihilator});
    };
    if (s->type() != GeneratingType::three)
      take(structure.plus(step, {q[k], plus[k]}, {q[k + 1], plus[k + 1]}, lagrangian ? gamma_plus(d) : d));
    if (s->type() != GeneratingType::two)
      take(
          structure.minus(step, {q[k], minus[k]}, {q[k + 1], minus[k + 1]}, lagrangian ? gamma_minus(d) : d));
  }
  return largest;
}

}  // namespace diracstep
