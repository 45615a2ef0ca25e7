#include <diracstep/core/adaptive/variable_run_checks.hpp>

namespace diracstep {

namespace {

constexpr long steps_for_a_look = 20;  // of the first; each next one comes after twice as many steps
constexpr long most_steps_for_a_look = 600;

}  // namespace

/// A step by its local error ends at a kink to the round-off of the time, where another integrator may read
/// the other side; it was compared with two halves of it.
bool VariableRunChecks::at_kink() const {
  return integrator_.integrator().method().damped && !integrator_.kinks_passed().empty();
}

void VariableRunChecks::before_step() {
  const long step = integrator_.work().steps;
  if (nodes_.wants(step) && integrator_.sample(Momentum::projected, node_).ok()) nodes_.see(step, node_);
  looking_ = step >= next_look_ && !at_kink() && integrator_.sample(Momentum::projected, start_).ok();
}

bool VariableRunChecks::divide(double size) {
  const double first = StepComparison::first_part * size;
  side_.restart(start_.time, start_.q, start_.p, start_.v);
  return side_.step(first).ok() && side_.step(size - first).ok() &&
         side_.sample(Momentum::projected, parts_).ok();
}

void VariableRunChecks::after_step() {
  // Steps by their local error resolve kinks.
  if (!integrator_.integrator().method().damped) kinks_.after(integrator_.integrator());
  work_.after(integrator_.integrator());
  jumps_.after(integrator_.kinks_passed(), integrator_.integrator(), side_);
  if (!looking_ || at_kink()) return;
  next_look_ += std::min(most_steps_for_a_look, std::max(steps_for_a_look, next_look_));
  if (!integrator_.sample(Momentum::projected, whole_).ok()) return;
  const double size = whole_.time - start_.time;
  if (divide(size)) comparison_.add(start_, size, whole_, parts_);
}

std::string VariableRunChecks::text() const {
  const Scene& scene = integrator_.integrator().scene();
  return joined_doubts({energy_.text(), work_.text(), comparison_.text(), nodes_.text(), jumps_.text(),
                        kinks_.text(), scene.doubt ? scene.doubt() : std::string()});
}

}  // namespace diracstep
