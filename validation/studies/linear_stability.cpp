#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/validation/studies/linear_stability.hpp>
#include <functional>
#include <memory>
#include <optional>

namespace diracstep {

namespace {

constexpr double smallest_tested_step = 1e-2;
constexpr int tested_per_decade = 40, kept_per_decade = 20, decades = 8;
constexpr int bisections = 30;
constexpr double visible_peak = 1e-3;  // smaller ones are round-off

Scene line(const std::string& name) {
  Scene scene;
  scene.name = name;
  scene.coordinates = {"q"};
  scene.start = {0.0, Vector::Zero(1), Vector::Ones(1)};
  return scene;
}

std::shared_ptr<const Scene> oscillator() {
  Scene scene = line("oscillator");
  scene.lagrangian =
      lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * v[0] * v[0] - 0.5 * q[0] * q[0]; });
  return std::make_shared<const Scene>(scene);
}

std::shared_ptr<const Scene> damped_mass() {
  Scene scene = line("damped mass");
  scene.lagrangian = lagrangian<1>([](const auto&, const auto& v) { return 0.5 * v[0] * v[0]; });
  scene.force = force<1>(
      []<class T>(const std::array<T, 1>&, const std::array<T, 1>& v) { return std::array<T, 1>{-v[0]}; });
  return std::make_shared<const Scene>(scene);
}

using Column = std::array<double, 2>;

/// (q,p) one step after (q,v); empty where the step failed.
std::optional<Column> after_one_step(Integrator& integrator, double q, double v) {
  integrator.reset({0.0, Vector::Constant(1, q), Vector::Constant(1, v)});
  Sample sample;
  if (!integrator.step().ok() || !integrator.sample(Momentum::projected, sample).ok()) return {};
  return Column{sample.q[0], sample.p[0]};
}

double spectral_radius(const Column& first, const Column& second) {
  const double half_trace = 0.5 * (first[0] + second[1]);
  const double determinant = first[0] * second[1] - first[1] * second[0];
  const double discriminant = half_trace * half_trace - determinant;
  if (discriminant < 0.0) return std::sqrt(determinant);
  return std::abs(half_trace) + std::sqrt(discriminant);
}

/// One of the two test equations: its growth over a step.
using Growth = std::function<double(double step)>;

bool stable(double growth) { return growth <= 1.0 + growth_tolerance; }  // false for NaN

/// Halves [below, above], stable and not, to the limit.
double limit_between(const Growth& growth, double below, double above) {
  for (int i = 0; i < bisections; ++i) {
    const double middle = 0.5 * (below + above);
    (stable(growth(middle)) ? below : above) = middle;
  }
  return below;
}

/// Where growth is largest between the neighbours of a peak, by golden section; ends at the first unstable
/// step.
double climb(const Growth& growth, double left, double right) {
  constexpr double golden = 0.6180339887498949;
  for (int i = 0; i < bisections; ++i) {
    const double a = right - golden * (right - left), b = left + golden * (right - left);
    const double at_a = growth(a), at_b = growth(b);
    if (!stable(at_a)) return a;
    if (!stable(at_b)) return b;
    (at_a > at_b ? right : left) = at_a > at_b ? b : a;
  }
  return 0.5 * (left + right);
}

double first_limit(const Growth& growth) {
  std::array<double, 3> steps{}, values{};  // the last three; a peak in the middle may hide a pole
  for (int k = 0; k <= decades * tested_per_decade; ++k) {
    const double step = smallest_tested_step * std::pow(10.0, static_cast<double>(k) / tested_per_decade);
    steps = {steps[1], steps[2], step};
    values = {values[1], values[2], growth(step)};
    if (k > 1 && values[1] > (1.0 + visible_peak) * std::max(values[0], values[2])) {
      const double top = climb(growth, steps[0], steps[2]);
      if (!stable(growth(top))) return limit_between(growth, steps[0], top);
    }
    if (!stable(values[2])) return limit_between(growth, steps[1], step);
  }
  return largest_tested_step;
}

}  // namespace

LinearStability linear_stability(const Registry& registry, const SolverFactory& solvers,
                                 const std::string& method, int order) {
  const auto integrator = [&](const std::shared_ptr<const Scene>& scene, double step) {
    return Integrator(scene, registry, solvers, {.method = method, .order = order, .step = step});
  };
  const auto oscillating = oscillator(), damped = damped_mass();
  const Growth oscillator_growth = [&](double step) {
    Integrator stepping = integrator(oscillating, step);
    const auto first = after_one_step(stepping, 1.0, 0.0), second = after_one_step(stepping, 0.0, 1.0);
    return first && second ? spectral_radius(*first, *second) : std::nan("");
  };
  const bool takes_forces = registry.method(method).info.type != GeneratingType::four;
  const Growth damping_growth = [&](double step) {
    if (!takes_forces) return std::nan("");
    Integrator stepping = integrator(damped, step);
    const auto after = after_one_step(stepping, 0.0, 1.0);
    return after ? std::abs((*after)[1]) : std::nan("");
  };
  LinearStability result{method, order, first_limit(oscillator_growth), std::nan(""), {}};
  if (takes_forces) result.damping_limit = first_limit(damping_growth);
  for (int k = 0; k <= decades * kept_per_decade; ++k) {
    const double step = smallest_tested_step * std::pow(10.0, static_cast<double>(k) / kept_per_decade);
    result.growth.push_back({step, oscillator_growth(step), damping_growth(step)});
  }
  return result;
}

}  // namespace diracstep
