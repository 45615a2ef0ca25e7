#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/motion_rates.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/first_order_motions.hpp>

namespace diracstep {

namespace {

constexpr const char* surveying_method = "damped/radau:3";
constexpr double surveying_error = 1e-3, smallest_error = 1e-9;
constexpr int damping_steps = 150;
constexpr double grown_by = 1.5, parts_of_the_motion = 50.0;

/// How much the entries of ∂f/∂v change from node to node.
class ResistanceChanges {
 public:
  explicit ResistanceChanges(const Scene& scene) : force_(*scene.force) {}

  void add(const Sample& at) {
    Vector by_q(force_.pattern().nonzeros()), by_v = by_q;
    force_.derivatives(at.time, at.q, at.v, by_q, by_v);
    by_v = by_v.cwiseAbs();
    if (!by_v.allFinite()) return;
    least_ = least_.size() == 0 ? by_v : Vector(least_.cwiseMin(by_v));
    most_ = most_.size() == 0 ? by_v : Vector(most_.cwiseMax(by_v));
  }

  double largest_ratio() const {
    double largest = 1.0;
    for (Eigen::Index i = 0; i < most_.size(); ++i)
      if (least_[i] > 0.0) largest = std::max(largest, most_[i] / least_[i]);
    return largest;
  }

 private:
  const Force& force_;
  Vector least_, most_;
};

/// Why nothing is measured; empty where it is.
std::string not_surveyed(const Scene& scene) {
  if (!scene.lagrangian) return "the Hamiltonian is degenerate";
  if (scene.space) return "the scene is not in R^n";
  const PhaseStructure& structure = scene.lagrangian->structure();
  if (structure.phase_space()) return "L is linear in v";
  if (structure.y_hessian_zero) return scene.rows() > 0 ? "" : "nothing has mass";
  if (!scene.force && !has_states(scene)) return "the scene has no force";
  if (first_order_motions(scene).hide_equations()) return "the kernel of ∂²L/∂v² moves or hides equations";
  if (scene.dimension() > MotionRates::most_coordinates)
    return "more than " + std::to_string(MotionRates::most_coordinates) + " coordinates";
  return "";
}

/// So that an undamped motion of so many radians loses 1e-5 of its amplitude; see default_method_of_motion().
double local_error_for(double radians) {
  constexpr double usual = AdaptiveOptions::usual_local_error, smallest = 1e-8;
  return radians > 0.0 ? std::clamp(std::pow(2e-3 / radians, 1.2), smallest, usual) : usual;
}

std::string reason_of(const DampingSurvey& survey) {
  const std::string dies_out = "what is fastest dies out at a rate of " + to_text(survey.rate, 2) +
                               ", which times a step of " + to_text(survey.step, 2) + " is " +
                               to_text(survey.product, 2) + " at most";
  if (survey.switched())
    return "resistances that switch: those that velocities which nothing stores are found by change by a "
           "factor "
           "of " +
           to_text(survey.resistance_ratio, 2);
  if (survey.strong())
    return "strong damping: " + dies_out + ", above " + to_text(DampingSurvey::strong_from, 2);
  return "damping that switches: " + dies_out + ", and local errors of " + to_text(surveying_error, 2) +
         " ask for steps " + to_text(survey.finer, 2) + " times smaller";
}

}  // namespace

DampingSurvey survey_damping(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                             const SolverFactory& solvers, double end, double step,
                             const IntegratorOptions& given) {
  DampingSurvey survey;
  survey.failure = not_surveyed(*completed(scene));
  if (!survey.failure.empty()) return survey;
  const double start = scene->start.time, span = std::abs(end - start);
  const double longest = step > 0.0 ? step : span / parts_of_the_motion;
  IntegratorOptions options = given;
  options.method = surveying_method;
  options.order = 0;
  options.step = std::copysign(longest, end - start);
  AdaptiveIntegrator integrator(scene, registry, solvers, options, {.eps = surveying_error, .end = end});
  const Scene& moved = integrator.integrator().scene();  // with its hidden rows
  MotionRates motion(moved, solvers);
  std::optional<ResistanceChanges> changes;
  if (first_order_motions(moved).by_force) changes.emplace(moved);
  Sample node;
  survey.undamped = HUGE_VAL;
  MotionRates::Rates rates;
  double measured_at = 0.0;
  for (long k = 0; k < damping_steps && std::abs(integrator.time() - start) < span; ++k) {
    if (!integrator.sample(Momentum::projected, node).ok()) break;
    if (changes) changes->add(node);
    const double h = step > 0.0 ? longest : std::min(std::abs(integrator.next_size()), longest);
    const bool grown = h > grown_by * measured_at || !(rates.decay > 0.0);
    if (moved.dimension() <= MotionRates::most_coordinates || grown) {
      rates = motion.at(node);
      measured_at = h;  // many coordinates: only where steps have grown, on which the product depends
    }
    const double rate = rates.decay;
    if (rate > 0.0) survey.undamped = std::min(survey.undamped, rates.undamped);
    survey.covered = std::abs(node.time - start);
    survey.rate = std::max(survey.rate, rate);
    if (rate * h > survey.product) {
      survey.product = rate * h;
      survey.step = h;
    }
    const long refused = integrator.control().refused;
    const StepReport report = integrator.step();
    if (!report.ok()) {
      if (survey.product == 0.0) survey.failure = report.failure;
      break;
    }
    const double taken = std::abs(integrator.time() - node.time);
    if (step > 0.0 && integrator.control().refused > refused)
      survey.finer = std::max(survey.finer, step / taken);
  }
  if (!std::isfinite(survey.undamped)) survey.undamped = 0.0;
  if (changes) survey.resistance_ratio = changes->largest_ratio();
  return survey;
}

DefaultMethod default_method_of_motion(const std::shared_ptr<const Scene>& given, const Registry& registry,
                                       const SolverFactory& solvers, double end, double step,
                                       const IntegratorOptions& options, const MethodRequest& request) {
  const auto scene = completed(given);
  const bool free = request.order == 0 && !request.rule && !options.compensated_sums;
  if (free && !(request.error > 0.0 && request.error < smallest_error)) {
    const DampingSurvey survey = survey_damping(scene, registry, solvers, end, step, options);
    if (survey.strong() || survey.switching() || survey.switched()) {
      DefaultMethod choice{surveying_method, 0, reason_of(survey)};
      const double radians = survey.undamped * std::abs(end - scene->start.time);
      choice.local_error = local_error_for(radians);
      if (choice.local_error < AdaptiveOptions::usual_local_error)
        choice.reason += "; what is not damped, at a rate of " + to_text(survey.undamped, 2) +
                         ", is kept by local errors of " + to_text(choice.local_error, 2);
      return choice;
    }
  }
  return default_method(*scene, request);
}

}  // namespace diracstep
