#include <cmath>
#include <diracstep/core/adaptive/search_run.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>

namespace diracstep::detail {

namespace {

constexpr double rounding_of_time = 1e-12;  // of the time of a node, in parts of the motion

/// Whether a switching function depends on velocities.  Where none does, as in contacts, a motion that
/// crosses one again and again does not stick: its steps are longer than a contact.
bool may_stick(const Scene& scene) {
  if (!scene.kinks) return false;
  const Vector v = scene.start.v.size() > 0 ? scene.start.v : Vector::Zero(scene.dimension());
  const Vector other = v.array() + (1.0 + max_norm(v));
  Vector at_v(scene.kinks->count()), at_other(scene.kinks->count());
  scene.kinks->evaluate(scene.start.time, scene.start.q, v, at_v);
  scene.kinks->evaluate(scene.start.time, scene.start.q, other, at_other);
  return at_v != at_other;
}

StepsTaken run_fixed(Integrator& integrator, const ErrorControlReport::Steps& steps, double end,
                     const AtNode& at_node) {
  const double span = std::abs(end - integrator.time());
  const ReadNode read{integrator.scene(), [&](Momentum momentum, Sample& sample) {
                        const SolveReport report = integrator.sample(momentum, sample);
                        if (std::abs(sample.time - end) <= rounding_of_time * span) sample.time = end;
                        return report;
                      }};
  if (!at_node(read, false)) return {};
  StepsTaken taken;
  long left = steps.plan.steps() * steps.refinement;
  taken.last = steps.plan.run(
      integrator, steps.refinement, [&] { return at_node(read, --left == 0); },
      [&](const KinkPassed& kink) {
        return at_node(
            {integrator.scene(),
             [&](Momentum momentum, Sample& sample) { return integrator.sample(kink, momentum, sample); }},
            false);
      });
  taken.sticks = !taken.last.ok() && !integrator.stuck_at_kink().empty() && may_stick(integrator.scene());
  return taken;
}

constexpr double far_ahead = 1e7;  // steps, which no run is allowed
constexpr long most_slow_steps = 5000;

StepReport collapsed(double t, double size) {
  StepReport report;
  report.solve.status = SolveStatus::no_convergence;
  report.time = t;
  report.failure = "steps shrink to " + to_text(std::abs(size)) + " at t = " + to_text(t) +
                   " and stay so, with which no end is reached";
  return report;
}

StepReport run_variable(AdaptiveIntegrator& integrator, double end, const AtNode& at_node) {
  const ReadNode read{integrator.integrator().scene(),
                      [&](Momentum momentum, Sample& sample) { return integrator.sample(momentum, sample); }};
  for (long slow = 0;;) {
    const double left = end - integrator.time(), size = integrator.next_size();
    if (!at_node(read, false)) return {};
    slow = std::abs(left) > far_ahead * std::abs(size) ? slow + 1 : 0;
    if (slow > most_slow_steps) return collapsed(integrator.time(), size);
    if (std::abs(size) >= std::abs(left) * (1.0 - 1e-12)) break;
    StepReport report = integrator.step();
    if (!report.ok()) return report;
  }
  StepReport report;
  const ReadNode read_end{integrator.integrator().scene(), [&](Momentum momentum, Sample& sample) {
                            report = integrator.sample_at(end, momentum, sample);
                            return report.solve;
                          }};
  at_node(read_end, true);
  return report;
}

}  // namespace

StepsTaken run_steps_of(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                        const SolverFactory& solvers, const ErrorControlReport::Steps& steps, bool adaptive,
                        double end, Work& work, const AtNode& at_node) {
  StepsTaken taken;
  if (adaptive) {
    AdaptiveIntegrator integrator(scene, registry, solvers, steps.integrator, steps.variable);
    taken.last = run_variable(integrator, end, [&](const ReadNode& read, bool last) {
      work = integrator.work();
      return at_node(read, last);
    });
    work = integrator.work();
    work.solves += integrator.side_work().solves;
    work.iterations += integrator.side_work().iterations;
    work.residual_evaluations += integrator.side_work().residual_evaluations;
    work.jacobian_evaluations += integrator.side_work().jacobian_evaluations;
  } else {
    Integrator integrator(scene, registry, solvers, steps.integrator);
    taken = run_fixed(integrator, steps, end, [&](const ReadNode& read, bool last) {
      work = integrator.work();
      return at_node(read, last);
    });
    work = integrator.work();
  }
  return taken;
}

}  // namespace diracstep::detail
