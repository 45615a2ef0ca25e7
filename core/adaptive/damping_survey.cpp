#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/linearised_motion.hpp>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/integrator/point_reader.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>

namespace diracstep {

namespace {

constexpr const char* surveying_method = "damped/radau:3";
constexpr double surveying_error = 1e-3, smallest_error = 1e-9;
constexpr int damping_steps = 150, most_coordinates = 60;
constexpr double grown_by = 1.5, parts_of_the_motion = 50.0;

/// A motion without mass, whose velocity is a function v(t, q): linearised about its points, δq̇ = ∂v/∂q δq.
class MasslessMotion {
 public:
  MasslessMotion(const Scene& scene, const SolverFactory& solvers)
      : scene_(scene),
        reader_(std::make_shared<const Scene>(scene), solvers, scene.dimension() <= most_coordinates),
        sizes_(Vector::Zero(scene.dimension())) {}

  /// The largest decay rate at a point; NaN where there is no velocity, 0 before anything has moved.
  double decay_rate(const Sample& at) {
    sizes_ = sizes_.cwiseMax(at.q.cwiseAbs());
    const double largest = max_norm(sizes_);
    if (largest == 0.0) return 0.0;  // nothing has moved yet
    units_ = sizes_.cwiseMax(LinearisedMotion::least_size * largest);
    return scene_.dimension() <= most_coordinates ? of_all_modes(at) : of_the_fastest_mode(at);
  }

 private:
  double of_all_modes(const Sample& at) {
    const Columns basis = tangent_space(at);
    double largest = 0.0;
    Vector here = at.v;
    if (!reader_.velocity(at.time, at.q, at.p, here).ok()) return std::nan("");
    for (const double side : {LinearisedMotion::damping_probe, -LinearisedMotion::damping_probe}) {
      Columns image(basis.rows(), basis.cols());
      for (Eigen::Index k = 0; k < basis.cols(); ++k) image.col(k) = change(at, here, basis.col(k), side);
      if (!image.allFinite()) return std::nan("");
      const Eigen::EigenSolver<Columns> solver(basis.transpose() * image, false);
      if (solver.info() != Eigen::Success) return std::nan("");
      for (const auto& value : solver.eigenvalues()) largest = std::max(largest, -value.real());
    }
    return largest;
  }

  /// By power iterations: for many coordinates.
  double of_the_fastest_mode(const Sample& at) {
    constexpr int iterations = 6;  // the mode of the node before is a good start
    if (mode_.size() == 0) {
      mode_.resize(scene_.dimension());
      for (Eigen::Index i = 0; i < mode_.size(); ++i) mode_[i] = std::sin(1.0 + 1.7 * static_cast<double>(i));
    }
    double rate = 0.0;
    Vector here = at.v;
    if (!reader_.velocity(at.time, at.q, at.p, here).ok()) return std::nan("");
    for (int k = 0; k < iterations; ++k) {
      mode_.normalize();
      const Vector image = change(at, here, mode_, LinearisedMotion::damping_probe);
      if (!image.allFinite() || !(image.norm() > 0.0)) return std::nan("");
      rate = -mode_.dot(image);
      mode_ = image;
    }
    return rate;
  }

  /// A basis of the δq that keep φ = 0, in units and orthonormal.
  Columns tangent_space(const Sample& at) const {
    const Eigen::Index n = scene_.dimension();
    ConstraintsAtPoint positions(only_holonomic(scene_.constraints), scene_.dimension());
    if (positions.rows() == 0) return Columns::Identity(n, n);
    positions.evaluate(at.time, at.q);
    Columns all = positions.pattern().full(positions.coefficients()) * units_.asDiagonal();
    for (Eigen::Index r = 0; r < all.rows(); ++r) all.row(r) /= size_or_one(max_norm(all.row(r).transpose()));
    const Columns kernel = Eigen::FullPivLU<Columns>(all).kernel();
    return Eigen::HouseholderQR<Columns>(kernel).householderQ() *
           Columns::Identity(kernel.rows(), kernel.cols());
  }

  /// δv/side in units, for δq = side · direction, where v is `here` without it.
  Vector change(const Sample& at, const Vector& here, const Vector& direction, double side) {
    Vector there = here;
    if (!reader_.velocity(at.time, at.q + side * direction.cwiseProduct(units_), at.p, there).ok())
      return Vector::Constant(here.size(), std::nan(""));
    return (there - here).cwiseQuotient(units_) / side;
  }

  const Scene& scene_;
  PointReader reader_;
  Vector sizes_, units_, mode_;
};

/// Why nothing is measured; empty where it is.
std::string not_surveyed(const Scene& scene) {
  if (!scene.lagrangian) return "the Hamiltonian is degenerate";
  if (scene.space) return "the scene is not in R^n";
  const PhaseStructure& structure = scene.lagrangian->structure();
  if (structure.phase_space()) return "L is linear in v";
  if (structure.y_hessian_zero) return scene.rows() > 0 ? "" : "nothing has mass";
  if (!scene.force) return "the scene has no force";
  if (scene.dimension() > most_coordinates)
    return "more than " + std::to_string(most_coordinates) + " coordinates";
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
  std::optional<LinearisedMotion> motion;
  std::optional<MasslessMotion> massless;
  if (has_accelerations(moved))
    motion.emplace(moved, solvers);
  else
    massless.emplace(moved, solvers);
  Sample node;
  survey.undamped = HUGE_VAL;
  LinearisedMotion::Rates rates;
  double measured_at = 0.0;
  for (long k = 0; k < damping_steps && std::abs(integrator.time() - start) < span; ++k) {
    if (!integrator.sample(Momentum::projected, node).ok()) break;
    const double h = step > 0.0 ? longest : std::min(std::abs(integrator.next_size()), longest);
    const bool grown = h > grown_by * measured_at || !(rates.decay > 0.0);
    if (moved.dimension() <= most_coordinates || grown) {
      rates = motion ? motion->rates(node) : LinearisedMotion::Rates{massless->decay_rate(node), 0.0};
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
  return survey;
}

DefaultMethod default_method_of_motion(const std::shared_ptr<const Scene>& given, const Registry& registry,
                                       const SolverFactory& solvers, double end, double step,
                                       const IntegratorOptions& options, const MethodRequest& request) {
  const auto scene = completed(given);
  const bool free = request.order == 0 && !request.rule && !options.compensated_sums;
  if (free && !(request.error > 0.0 && request.error < smallest_error)) {
    const DampingSurvey survey = survey_damping(scene, registry, solvers, end, step, options);
    if (survey.strong() || survey.switching()) {
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
