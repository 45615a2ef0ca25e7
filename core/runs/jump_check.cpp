#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/jump_check.hpp>
#include <diracstep/core/spaces/space.hpp>

namespace diracstep {

namespace {

bool jumps_at(const KinkPassed& kink, const Integrator& end, Integrator& reader) {
  constexpr double near = 1e-6, nearer = 1e-7;  // of a step
  const Scene& scene = reader.scene();
  const Eigen::Index n = scene.dimension();
  Sample at;
  if (!reader.sample(kink, Momentum::projected, at).ok()) return true;
  const double size = std::abs(reader.options().step), later = end.time() - kink.time;
  const Vector bend = later != 0.0 ? Vector((end.velocity_estimate() - at.v) / later) : Vector::Zero(n);
  const auto force_at = [&](double away) {
    Vector force(n), momentum(n), more(n);
    const Vector v = at.v + away * bend;
    const Vector q = moved(scene.space.get(), kink.at.q, away * at.v);
    scene.force_and_momentum(kink.time, q, v, kink.at.p, force, momentum);
    if (!scene.force) return force;
    scene.force->value(kink.time, q, v, more);
    return Vector(force + more);
  };
  const auto apart = [&](double part) { return max_norm(force_at(part * size) - force_at(-part * size)); };
  return apart(nearer) > 0.5 * apart(near);
}

}  // namespace

std::optional<double> jump_of_force(std::span<const KinkPassed> kinks, const Integrator& end,
                                    Integrator& reader) {
  for (const KinkPassed& kink : kinks)
    if (jumps_at(kink, end, reader)) return kink.time;
  return std::nullopt;
}

JumpCheck::JumpCheck(const Integrator& integrator) : method_(integrator.method().name) {
  const MethodInfo& method = integrator.method();
  watched_ = integrator.options().order > std::max(2, method.order) && method.stages == 0 &&
             method.constraint_rule != StepRule::midpoint;
}

std::string JumpCheck::text() const {
  if (!first_) return "";
  return "the force jumps at t = " + to_text(*first_) + " on the way, where " + method_ +
         ", composed to a higher order, steps over to the other side and back: its order is lost there; "
         "--method type1/gl:3 stays within its steps";
}

}  // namespace diracstep
