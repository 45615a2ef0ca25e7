#pragma once

#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/laws/method_check.hpp>
#include <limits>
#include <memory>
#include <string>
#include <utility>

/// The parts of check_method.
namespace diracstep::checks {

inline constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
inline constexpr double law_limit = 1e-9;  // of what holds to the solver's tolerance, about 1e-12 a step
inline constexpr double usual_step = 0.05;

inline Check pass_if(bool good, double figure, double limit, std::string detail) {
  return {{}, good ? Check::Result::pass : Check::Result::fail, figure, limit, std::move(detail)};
}
inline Check at_most(double figure, double limit, std::string detail) {
  return pass_if(figure <= limit, figure, limit, std::move(detail));
}
inline Check not_applicable(std::string why, double figure = nothing) {
  return {{}, Check::Result::not_applicable, figure, nothing, std::move(why)};
}

/// The method that is checked.
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

/// S of the method on a scene, and arguments like those of a step of size h.
struct Point {
  std::unique_ptr<GeneratingFunction> s;
  Interval step;
  Columns y;
};
Point point_of(const Subject& subject, const std::shared_ptr<const Scene>& scene, double h);

/// State after `steps` steps, q and projected p; throws where a step fails.
Vector state_after(Integrator& integrator, long steps);

// derivative_checks.cpp
Check gradient(const Subject& subject);
Check hessian(const Subject& subject);

// behaviour_checks.cpp
Check allocation(const Subject& subject);
Check two_instances(const Subject& subject);
Check not_a_number(const Subject& subject);

}  // namespace diracstep::checks
