#include <algorithm>
#include <cmath>
#include <diracstep/core/errors.hpp>
#include <diracstep/core/run.hpp>
#include <diracstep/plugins/callback_error.hpp>
#include <diracstep/plugins/differences.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/law_scenes.hpp>
#include <diracstep/validation/method_check.hpp>
#include <numbers>
#include <sstream>
#include <thread>

namespace diracstep {

namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
constexpr double gradient_limit = 1e-8;  // relative; differences of S are good to about 1e-11
constexpr double hessian_limit = 1e-6;   // relative; differences of a gradient by differences to about 1e-9
constexpr double law_limit = 1e-9;       // of what holds to the solver's tolerance, about 1e-12 a step
constexpr double order_tolerance = 0.2;  // as in the order table
constexpr double usual_step = 0.05;

Check pass_if(bool good, double figure, double limit, std::string detail) {
  return {{}, good ? Check::Result::pass : Check::Result::fail, figure, limit, std::move(detail)};
}
Check at_most(double figure, double limit, std::string detail) {
  return pass_if(figure <= limit, figure, limit, std::move(detail));
}
Check not_applicable(std::string why, double figure = nothing) {
  return {{}, Check::Result::not_applicable, figure, nothing, std::move(why)};
}

std::string text(double number) { return (std::ostringstream() << number).str(); }

/// The method looked at.
struct Subject {
  const Registry& registry;
  Method method;
  const CheckOptions& options;

  IntegratorOptions stepping(double step = usual_step) const {
    return {.method = method.info.name, .step = step};
  }
  std::unique_ptr<Integrator> integrator(const std::shared_ptr<const Scene>& scene,
                                         double step = usual_step) const {
    return std::make_unique<Integrator>(scene, registry, kinsol(), stepping(step));
  }
};

// --- S at points -------------------------------------------------------------------------------------------

/// S of the method on a scene, and arguments like those of a step of size h.
struct Point {
  std::unique_ptr<GeneratingFunction> s;
  Interval step;
  Columns y;
};

Point point_of(const Subject& subject, const std::shared_ptr<const Scene>& scene, double h) {
  Point point{subject.method.make(*completed(scene)), {scene->start.time, h}, {}};
  GeneratingFunction& s = *point.s;
  const Vector& q = scene->start.q;
  const Vector& v = scene->start.v;
  Vector force(q.size()), p(q.size());
  scene->lagrangian->gradient(point.step.start, q, v, force, p);
  const GraphOf graph = graph_of(s.type());
  point.y.setZero(s.dimension(), s.columns());
  point.y.col(0) = graph.starts_from_position ? q : p;
  point.y.col(1) =
      graph.ends_at_position ? Vector(q + h * v + 0.3 * h * h * force) : Vector(p + 0.9 * h * force);
  if (s.inner_columns() > 0) s.guess_inner(point.step, q, p, v, point.y.rightCols(s.inner_columns()));
  for (Eigen::Index k = 0; k < s.inner_columns() * q.size(); ++k)  // off the guess, which may be special
    point.y.rightCols(s.inner_columns()).reshaped()[k] +=
        0.1 * h * std::sin(static_cast<double>(k + 1) * std::numbers::phi);
  return point;
}

std::vector<Point> points_of(const Subject& subject) {
  std::vector<Point> points;
  for (const auto& scene : {laws::unconstrained(), laws::driven()})
    for (const double h : {0.1, -0.07}) points.push_back(point_of(subject, scene, h));
  return points;
}

/// The largest entry of `given − expected` over the size of `expected`.
double relative(const Columns& given, const Columns& expected) {
  const double off = (given - expected).cwiseAbs().maxCoeff();
  return std::isfinite(off) ? off / std::max(expected.cwiseAbs().maxCoeff(), 1e-300) : HUGE_VAL;
}

double gradient_deviation(Point& at) {
  Columns g(at.y.rows(), at.y.cols());
  Vector differences(at.y.size());
  const auto value = [&](ConstVectorRef y) {
    return at.s->value(at.step, y.reshaped(at.y.rows(), at.y.cols()));
  };
  gradient_by_differences(value, at.y.reshaped(), differences);
  at.s->gradient(at.step, at.y, g);
  return relative(g, differences.reshaped(at.y.rows(), at.y.cols()));
}

Check check_gradient(const Subject& subject) {
  if (!subject.method.make) return not_applicable("no generating function of its end points");
  double largest = 0.0;
  try {
    for (Point& point : points_of(subject)) largest = std::max(largest, gradient_deviation(point));
  } catch (const Misuse& misuse) {
    return not_applicable(misuse.what());
  }
  return at_most(largest, gradient_limit, "largest deviation from differences of S, relative");
}

/// The Hessian of S in all its columns, from the blocks.
Columns full_hessian(Point& at) {
  const GeneratingFunction& s = *at.s;
  const int n = s.dimension();
  Columns blocks(s.pattern().nonzeros(), s.pairs());
  at.s->hessian(at.step, at.y, blocks);
  Columns full(n * s.columns(), n * s.columns());
  for (int i = 0; i < s.columns(); ++i)
    for (int j = i; j < s.columns(); ++j) {
      const Columns block = s.pattern().full(blocks.col(s.pair(i, j)));
      full.block(n * j, n * i, n, n) = block.transpose();
      full.block(n * i, n * j, n, n) = block;
    }
  return full;
}

Columns hessian_by_differences(Point& at) {
  const auto size = static_cast<int>(at.y.size());
  Columns g(at.y.rows(), at.y.cols());
  const JacobianByDifferences differences(SparsityPattern::dense(size, size));
  Vector values(static_cast<Eigen::Index>(size) * size);
  const auto gradient = [&](ConstVectorRef y, VectorRef out) {
    at.s->gradient(at.step, y.reshaped(at.y.rows(), at.y.cols()), g);
    out = g.reshaped();
  };
  differences.evaluate(gradient, at.y.reshaped(), values);
  return values.reshaped(size, size);
}

Check check_hessian(const Subject& subject) {
  if (!subject.method.make) return not_applicable("no generating function of its end points");
  double deviation = 0.0, asymmetry = 0.0;
  for (Point& point : points_of(subject)) {
    const Columns given = full_hessian(point), differences = hessian_by_differences(point);
    deviation = std::max(deviation, relative(given, differences));
    asymmetry = std::max(asymmetry, relative(differences.transpose(), differences));
  }
  if (asymmetry > hessian_limit)
    return pass_if(false, asymmetry, hessian_limit,
                   "differences of the gradient are not symmetric: it is the gradient of no function");
  return at_most(deviation, hessian_limit, "largest deviation from differences of the gradient, relative");
}

// --- The map -----------------------------------------------------------------------------------------------

Check check_symplecticity(const Subject& subject) {
  const double defect = symplecticity_defect(subject.registry, laws::unconstrained(), subject.stepping());
  return at_most(defect, 1e-8, "largest entry of M'JM - J, h = 0.05");
}

/// State after `steps` steps on the unconstrained scene, q and projected p; throws where a step fails.
Vector state_after(Integrator& integrator, long steps) {
  const RunReport report = run(integrator, steps, Momentum::projected, 1, nullptr);
  if (!report.ok()) throw std::runtime_error(report.last.failure);
  Sample end;
  if (!integrator.sample(Momentum::projected, end).ok()) throw std::runtime_error("the state cannot be read");
  Vector state(end.q.size() + end.p.size());
  state << end.q, end.p;
  return state;
}

Check check_consistency(const Subject& subject) {
  std::vector<double> errors;
  for (const double h : {0.04, 0.02}) {
    Integrator fine(laws::unconstrained(), subject.registry, kinsol(),
                    {.method = "type1/gl:6", .step = h / 4});
    const Vector expected = state_after(fine, 4);
    const auto ours = subject.integrator(laws::unconstrained(), h);
    errors.push_back((state_after(*ours, 1) - expected).lpNorm<Eigen::Infinity>());
  }
  if (errors.back() < 1e-12) return pass_if(true, errors.back(), 1e-12, "error of one step, h = 0.02");
  const double exponent = std::log2(errors.front() / errors.back());
  return pass_if(exponent > 1.5, exponent, 1.5, "the error of one step falls as this power of h");
}

Check check_order(const Subject& subject, const OrderScene& scene) {
  const MethodInfo& info = subject.method.info;
  if (scene.scene->force && info.type == GeneratingType::four)
    return not_applicable("type 4 takes no forces");
  const int claimed = claimed_order(info, *scene.scene);
  const OrderMeasurement measured = measure_order(subject.registry, scene, subject.stepping());
  if (!measured.failure.empty()) return pass_if(false, measured.order, claimed, measured.failure);
  return pass_if(std::abs(measured.order - claimed) <= order_tolerance, measured.order, claimed,
                 "measured and claimed order");
}

Check check_self_adjointness(const Subject& subject) {
  if (!subject.method.info.self_adjoint)
    return not_applicable("not claimed",
                          reversal_defect(subject.registry, laws::unconstrained(), subject.stepping()));
  double largest = 0.0;
  for (const auto& scene : {laws::unconstrained(), laws::nonholonomic(), laws::mixed()}) {
    const double defect = reversal_defect(subject.registry, scene, subject.stepping());
    largest = std::isnan(defect) ? HUGE_VAL : std::max(largest, defect);
  }
  return at_most(largest, law_limit, "a step there and back misses the start by this");
}

Check check_membership(const Subject& subject) {
  if (!subject.method.make) return not_applicable("no generating function of its end points");
  if (subject.method.info.type == GeneratingType::four) return not_applicable("none is stated for type 4");
  double largest = 0.0;
  for (const auto& scene : laws::every_constraint_class()) {
    const double residual = membership_residual(subject.registry, scene, subject.stepping(), 20);
    largest = std::isnan(residual) ? HUGE_VAL : std::max(largest, residual);
  }
  return at_most(largest, law_limit, "largest residual of membership in D_d+ and D_d-, 20 steps a class");
}

// --- Rows --------------------------------------------------------------------------------------------------

/// Largest violation along a run: of φ(q) = 0, or of A v + b = 0.
double violation(const Subject& subject, const std::shared_ptr<const Scene>& scene, bool positions) {
  const auto integrator = subject.integrator(scene);
  double largest = 0.0;
  const auto look = [&](const Sample& at) {
    for (const auto& rows : scene->constraints) {
      Vector a(rows->pattern().nonzeros()), residual(rows->rows());
      rows->coefficients(at.time, at.q, a, residual);
      rows->pattern().multiply_add(a.data(), at.v.data(), residual.data());
      if (positions && !rows->holonomic()) continue;
      if (positions) rows->position(at.time, at.q, residual);
      largest = std::max(largest, residual.lpNorm<Eigen::Infinity>());
    }
    return true;
  };
  const RunReport report = run(*integrator, 100, Momentum::projected, 1, look);
  if (!report.ok()) throw std::runtime_error(scene->name + ": " + report.last.failure);
  return largest;
}

Check check_holonomic_rows(const Subject& subject) {
  const double largest =
      std::max(violation(subject, laws::holonomic_sphere(), true), violation(subject, laws::mixed(), true));
  return at_most(largest, law_limit, "largest |phi(q)|, 100 steps of 0.05");
}

Check check_nonholonomic_rows(const Subject& subject) {
  const double largest =
      std::max(violation(subject, laws::nonholonomic(), false), violation(subject, laws::mixed(), false));
  return at_most(largest, law_limit, "largest |A v + b|, 100 steps of 0.05");
}

// --- Behaviour ---------------------------------------------------------------------------------------------

Check check_allocation(const Subject& subject) {
  if (!subject.method.make) return not_applicable("no generating function of its end points");
  if (!subject.method.info.allocation_free) return not_applicable("not claimed");
  if (!subject.options.allocations) return not_applicable("this program does not count allocations");
  Point point = point_of(subject, laws::unconstrained(), usual_step);
  Columns g(point.y.rows(), point.y.cols()), blocks(point.s->pattern().nonzeros(), point.s->pairs());
  long before = 0;
  for (int k = 0; k < 12; ++k) {
    if (k == 2) before = subject.options.allocations();  // the first calls may set things up
    point.s->gradient(point.step, point.y, g);
    point.s->hessian(point.step, point.y, blocks);
  }
  const auto count = static_cast<double>(subject.options.allocations() - before);
  return at_most(count, 0.0, "heap allocations in ten evaluations");
}

constexpr std::array<double, 2> two_steps{0.05, -0.03};

/// Steps two integrators in turn; the states they end in.
std::array<Vector, 2> in_turn(const Subject& subject) {
  const auto a = subject.integrator(laws::unconstrained(), two_steps[0]);
  const auto b = subject.integrator(laws::unconstrained(), two_steps[1]);
  std::array<Vector, 2> ends;
  for (int k = 0; k < 20; ++k) ends = {state_after(*a, 1), state_after(*b, 1)};
  return ends;
}

Vector alone(const Subject& subject, double step, long steps) {
  const auto integrator = subject.integrator(laws::unconstrained(), step);
  Vector state;
  for (long k = 0; k < steps; ++k) state = state_after(*integrator, 1);
  return state;
}

/// The unconstrained scene, whose Lagrangian lets something else happen before it answers.
class InterruptedLagrangian final : public Lagrangian {
 public:
  InterruptedLagrangian(std::shared_ptr<const Lagrangian> inner, std::function<void()> interruption)
      : Lagrangian(inner->pattern(), inner->structure()),
        inner_(std::move(inner)),
        interruption_(std::move(interruption)) {}

  double value(double t, ConstVectorRef x, ConstVectorRef y) const override {
    interruption_();
    return inner_->value(t, x, y);
  }
  void gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const override {
    interruption_();
    inner_->gradient(t, x, y, fx, fy);
  }
  void hessian(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    interruption_();
    inner_->hessian(t, x, y, fxx, fxy, fyy);
  }
  void gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fyt) const override {
    inner_->gradient_rate(t, x, y, fyt);
  }

 private:
  std::shared_ptr<const Lagrangian> inner_;
  std::function<void()> interruption_;
};

/// Whether S gives other derivatives when another instance is evaluated in the middle of it, as a second
/// thread might: what two threads do by chance, this does every time.
bool disturbed_in_the_middle(const Subject& subject) {
  Point other = point_of(subject, laws::driven(), -0.07);
  Columns g(other.y.rows(), other.y.cols()), blocks(other.s->pattern().nonzeros(), other.s->pairs());
  bool interrupting = false;
  const auto interruption = [&] {
    if (!interrupting) return;
    other.s->gradient(other.step, other.y, g);
    other.s->hessian(other.step, other.y, blocks);
  };
  Scene scene = *laws::unconstrained();
  scene.lagrangian = std::make_shared<const InterruptedLagrangian>(scene.lagrangian, interruption);
  Point point = point_of(subject, std::make_shared<const Scene>(scene), 0.1);
  std::array<Columns, 2> gradients{point.y, point.y};
  std::array<Columns, 2> hessians;
  for (std::size_t k = 0; k < 2; ++k) {
    interrupting = k == 1;
    hessians[k].setZero(point.s->pattern().nonzeros(), point.s->pairs());
    point.s->gradient(point.step, point.y, gradients[k]);
    point.s->hessian(point.step, point.y, hessians[k]);
  }
  return gradients[0] != gradients[1] || hessians[0] != hessians[1];
}

/// Runs both on threads of their own, several times; how often an end differed or a run failed.
int differences_on_threads(const Subject& subject, const std::array<Vector, 2>& expected, long steps) {
  std::array<int, 2> wrong{};
  const auto work = [&](std::size_t k) {
    for (int repeat = 0; repeat < 5; ++repeat) {
      try {
        if (alone(subject, two_steps[k], steps) != expected[k]) ++wrong[k];
      } catch (const std::exception&) {
        ++wrong[k];
      }
    }
  };
  std::thread other(work, 1);
  work(0);
  other.join();
  return wrong[0] + wrong[1];
}

Check check_two_instances(const Subject& subject) {
  const std::array<Vector, 2> short_runs{alone(subject, two_steps[0], 20), alone(subject, two_steps[1], 20)};
  if (in_turn(subject) != short_runs)
    return pass_if(false, nothing, nothing, "two instances used in turn disturb each other");
  if (subject.method.make && disturbed_in_the_middle(subject))
    return pass_if(false, nothing, nothing,
                   "an instance changes when another is evaluated in the middle of it");
  const std::array<Vector, 2> long_runs{alone(subject, two_steps[0], 60), alone(subject, two_steps[1], 60)};
  const int wrong = differences_on_threads(subject, long_runs, 60);
  return at_most(wrong, 0.0, "of 10 runs on two threads this many differ from those alone");
}

/// The unconstrained scene, whose L is not a number after t = 0.33.
std::shared_ptr<const Scene> ending_scene() {
  Scene scene = laws::particle("ending");
  scene.lagrangian =
      lagrangian<3>([]<class T>(const std::array<T, 3>& q, const std::array<T, 3>& v, const T& t) {
        using std::sqrt;
        return laws::Particle{}(q, v) * (1.0 + 0.0 * sqrt(0.33 - t));
      });
  return std::make_shared<const Scene>(scene);
}

/// Whether S answers NaN in any argument with something that is no number, or with an error.
bool hands_on_nan(const Subject& subject) {
  Point point = point_of(subject, laws::unconstrained(), usual_step);
  Columns g(point.y.rows(), point.y.cols());
  for (Eigen::Index column = 0; column < point.y.cols(); ++column) {
    Columns y = point.y;
    y(0, column) = nothing;
    g.setZero();
    try {
      point.s->gradient(point.step, y, g);
    } catch (const CallbackError&) {
      continue;
    }
    if (g.allFinite()) return false;
  }
  return true;
}

Check check_not_a_number(const Subject& subject) {
  if (subject.method.make && !hands_on_nan(subject))
    return pass_if(false, nothing, nothing, "the gradient is finite where an argument is not a number");
  const auto integrator = subject.integrator(ending_scene());
  std::array<long, 2> steps_taken{};
  for (long& taken : steps_taken) {
    integrator->reset();
    StepReport report;
    while (report.ok() && taken < 20) {
      report = integrator->step();
      if (report.ok()) ++taken;
    }
    if (report.ok()) return pass_if(false, 20.0, nothing, "20 steps succeeded where L is not a number");
  }
  return pass_if(steps_taken[0] == steps_taken[1] && integrator->position().allFinite(),
                 static_cast<double>(steps_taken[0]), nothing,
                 "steps until the report of a failure; the same again after it");
}

/// The check, with what it throws turned into a failure.
template <class Body>
void add(ConformanceTable& table, const CheckOptions& options, const std::string& name, Body body) {
  if (options.proceed && !options.proceed(name)) return;
  Check check;
  try {
    check = body();
  } catch (const std::exception& error) {
    check = pass_if(false, nothing, nothing, error.what());
  }
  check.name = name;
  table.checks.push_back(std::move(check));
}

}  // namespace

bool ConformanceTable::passed() const {
  return std::ranges::none_of(checks, [](const Check& c) { return c.result == Check::Result::fail; });
}

ConformanceTable check_method(const Registry& registry, const std::string& method,
                              const std::vector<OrderScene>& scenes, const CheckOptions& options) {
  const Subject subject{registry, registry.method(method), options};
  ConformanceTable table{method, {}};
  const auto perform = [&](const std::string& name, Check (*body)(const Subject&)) {
    add(table, options, name, [&] { return body(subject); });
  };
  perform("gradient", check_gradient);
  perform("hessian", check_hessian);
  perform("symplecticity", check_symplecticity);
  perform("consistency", check_consistency);
  for (const OrderScene& scene : scenes)
    add(table, options, "order, " + scene.constraint_class, [&] { return check_order(subject, scene); });
  perform("self-adjointness", check_self_adjointness);
  perform("membership", check_membership);
  perform("holonomic rows", check_holonomic_rows);
  perform("nonholonomic rows", check_nonholonomic_rows);
  perform("allocation", check_allocation);
  perform("two instances", check_two_instances);
  perform("not a number", check_not_a_number);
  return table;
}

ConformanceTable check_rule(const Registry& registry, const std::string& rule,
                            const std::vector<OrderScene>& scenes) {
  const StepRule looked_at = registry.rule(rule);
  double centre = 0.0;
  for (const StepNode& node : looked_at.nodes()) centre += node.weight * node.c;
  const int expected = std::abs(centre - 0.5) < 1e-12 ? 2 : 1;
  ConformanceTable table{rule, {}};
  for (const OrderScene& scene : scenes) {
    if (scene.constraint_class != "nonholonomic") continue;
    add(table, {}, "order, nonholonomic", [&] {
      const OrderMeasurement measured =
          measure_order(registry, scene, {.method = "type1/midpoint", .constraint_rule = looked_at});
      if (!measured.failure.empty()) return pass_if(false, measured.order, expected, measured.failure);
      return pass_if(std::abs(measured.order - expected) <= order_tolerance, measured.order, expected,
                     "with type1/midpoint; " + text(expected) + " follows from the nodes");
    });
  }
  return table;
}

}  // namespace diracstep
