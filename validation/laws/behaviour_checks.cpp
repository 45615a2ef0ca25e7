#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/plugins/callback_error.hpp>
#include <diracstep/validation/laws/law_scenes.hpp>
#include <diracstep/validation/laws/method_check_parts.hpp>
#include <functional>
#include <thread>

namespace diracstep::checks {

Check allocation(const Subject& subject) {
  if (!subject.method.generating_function) return not_applicable("no generating function is stated");
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

namespace {

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

}  // namespace

Check two_instances(const Subject& subject) {
  const std::array<Vector, 2> short_runs{alone(subject, two_steps[0], 20), alone(subject, two_steps[1], 20)};
  if (in_turn(subject) != short_runs)
    return pass_if(false, nothing, nothing, "two instances used in turn disturb each other");
  if (subject.method.generating_function && disturbed_in_the_middle(subject))
    return pass_if(false, nothing, nothing,
                   "an instance changes when another is evaluated in the middle of it");
  const std::array<Vector, 2> long_runs{alone(subject, two_steps[0], 60), alone(subject, two_steps[1], 60)};
  const int wrong = differences_on_threads(subject, long_runs, 60);
  return at_most(wrong, 0.0, "of 10 runs on two threads this many differ from those alone");
}

namespace {

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

}  // namespace

Check not_a_number(const Subject& subject) {
  if (subject.method.generating_function && !hands_on_nan(subject))
    return pass_if(false, nothing, nothing, "the gradient is finite where an argument is not a number");
  const auto integrator = subject.integrator(ending_scene());
  std::array<long, 2> steps_taken{};
  for (long& taken : steps_taken) {
    integrator->reset();
    const StepReport report = take_steps(*integrator, 20);
    taken = integrator->work().steps;
    if (report.ok()) return pass_if(false, 20.0, nothing, "20 steps succeeded where L is not a number");
  }
  return pass_if(steps_taken[0] == steps_taken[1] && integrator->position().allFinite(),
                 static_cast<double>(steps_taken[0]), nothing,
                 "steps until the report of a failure; the same again after it");
}

}  // namespace diracstep::checks
