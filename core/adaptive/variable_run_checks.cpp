#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/variable_run_checks.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>

namespace diracstep {

namespace {

constexpr long steps_for_a_look = 20;  // of the first; each next one comes after twice as many steps
constexpr long most_steps_for_a_look = 600;

constexpr long steps_for_a_reset = 1000;  // more is a warning of ControlReport::resets
constexpr long most_steps_repeated = 20000;

int order_of(const AdaptiveIntegrator& integrator) {
  return std::max(integrator.integrator().method().order, integrator.options().order);
}

}  // namespace

/// A step by its local error ends at a kink to the round-off of the time, where another integrator may read
/// the other side; it was compared with two halves of it.
bool VariableRunChecks::at_kink() const {
  return integrator_.integrator().method().damped && !integrator_.kinks_passed().empty();
}

void VariableRunChecks::before_step() {
  const long step = integrator_.work().steps;
  if (nodes_.wants(step) && integrator_.sample(Momentum::projected, node_).ok()) nodes_.see(step, node_);
  looking_ = (step >= next_look_ || velocity_.fast()) && !at_kink() &&
             integrator_.sample(Momentum::projected, start_).ok();
}

bool VariableRunChecks::divide(double size) {
  const double first = StepComparison::first_part * size;
  side_.restart(start_.time, start_.q, start_.p, start_.v);
  return side_.step(first).ok() && side_.step(size - first).ok() &&
         side_.sample(Momentum::projected, parts_).ok();
}

void VariableRunChecks::after_step() {
  ++taken_;
  if (first_.q.size() > 0) way_ = std::max(way_, max_norm(integrator_.integrator().position() - first_.q));
  largest_momentum_ = std::max(largest_momentum_, max_norm(integrator_.integrator().momentum()));
  // Steps by their local error resolve kinks.
  if (!integrator_.integrator().method().damped) kinks_.after(integrator_.integrator());
  work_.after(integrator_.integrator());
  impulse_.after(integrator_.integrator());
  velocity_.see(integrator_.integrator().velocity_estimate());
  jumps_.after(integrator_.kinks_passed(), integrator_.integrator(), side_);
  if (!looking_ || at_kink()) return;
  const bool due = integrator_.work().steps > next_look_;
  if (due) next_look_ += std::min(most_steps_for_a_look, std::max(steps_for_a_look, next_look_));
  if (!integrator_.sample(Momentum::projected, whole_).ok()) return;
  const double size = whole_.time - start_.time;
  if (divide(size))
    comparison_.add(start_, size, whole_, parts_,
                    due ? StepComparison::Place::usual : StepComparison::Place::fast);
}

void VariableRunChecks::finish() {
  const Integrator& main = integrator_.integrator();
  const Scene& scene = main.scene();
  const long resets = integrator_.control().resets - resets_before_;
  if (main.method().damped || first_.q.size() == 0 || taken_ > most_steps_repeated ||
      scene.dimension() + scene.rows() > StepComparison::most_unknowns_repeated ||
      resets * steps_for_a_reset <= taken_ || !(way_ > 0.0) || !(largest_momentum_ > 0.0) ||
      comparison_.at_rest_throughout())
    return;
  constexpr double part = 1.0 - StepComparison::first_part;
  if (!integrator_.sample(Momentum::projected, whole_).ok() ||
      !integrator_.with_finer_steps(part, first_, parts_).ok())
    return;
  error_ = std::max(max_norm(whole_.q - parts_.q) / way_, max_norm(whole_.p - parts_.p) / largest_momentum_) /
           (1.0 - std::pow(part, order_of(integrator_)));
}

std::string VariableRunChecks::text() const {
  std::string finer;
  if (error_ > StepComparison::largest_error(order_of(integrator_)))
    finer =
        "step size check: the step controller lost the rate of the motion, and with finer steps the run ends "
        "elsewhere: its error is " +
        to_text(std::min(100.0, 100.0 * error_), 2) +
        " % of the motion; take a smaller --eps, or ask for an error, --error";
  const Scene& scene = integrator_.integrator().scene();
  return joined_doubts({finer, energy_.text(), work_.text(), comparison_.text(), nodes_.text(),
                        impulse_.text(), jumps_.text(), kinks_.text(),
                        scene.doubt ? scene.doubt() : std::string()});
}

}  // namespace diracstep
