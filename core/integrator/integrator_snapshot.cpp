#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/integrator/step_sequence.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {

namespace {

constexpr long max_counted = 1L << 53;  // a double counts so far

/// Calls visit(name, count) for everything counted.
template <class AnyWork, class Visit>
void for_each_count(AnyWork& work, Visit visit) {
  visit("steps", work.steps);
  visit("solves", work.solves);
  visit("iterations", work.iterations);
  visit("residual evaluations", work.residual_evaluations);
  visit("Jacobian evaluations", work.jacobian_evaluations);
  auto& retries = work.retries;
  visit("line searches", retries.line_searches);
  visit("plain guesses", retries.plain_guesses);
  visit("previous solutions", retries.previous_solutions);
  visit("continuations", retries.continuations);
  visit("other branches", retries.other_branches);
  visit("divided steps", retries.divided_steps);
}

std::string title(const IntegratorOptions& options) {
  return "integrator of " + options.method + ", order " + std::to_string(options.order);
}

}  // namespace

Snapshot Integrator::save() const {
  Snapshot to;
  save(to);
  return to;
}

void Integrator::save(Snapshot& to) const {
  to.section(title(options_));
  to.put("step size", options_.step);
  for_each_count(work_, [&](const char* name, long count) { to.put(name, static_cast<double>(count)); });
  to.put("time base", clock_.base);
  to.put("time rest", clock_.rest);
  to.put("steps since the base", static_cast<double>(clock_.steps));
  to.put("last step size", last_.size);
  to.put("position", state_.q);
  to.put("momentum", state_.p);
  to.put("velocity estimate", state_.v);
  to.put_extended("position rest", state_.rest.q);
  to.put_extended("momentum rest", state_.rest.p);
  sequence_->save(to);
}

void Integrator::restore(const Snapshot& from) {
  try {
    SnapshotReader reader(from);
    restore(reader);
    reader.require_end();
  } catch (const Misuse&) {
    reset();
    throw;
  }
}

void Integrator::restore(SnapshotReader& from) {
  reset();
  from.section(title(options_));
  if (const double step = from.number("step size"); step != options_.step)
    throw Misuse("the snapshot is of steps of " + to_text(step) + "; this integrator takes " +
                 to_text(options_.step));
  for_each_count(work_, [&](const char* name, long& count) { count = from.whole_number(name, max_counted); });
  clock_.base = from.number("time base");
  clock_.rest = from.number("time rest");
  clock_.steps = from.whole_number("steps since the base", max_counted);
  last_.size = from.number("last step size");
  from.read("position", state_.q);
  from.read("momentum", state_.p);
  from.read("velocity estimate", state_.v);
  from.read_extended("position rest", state_.rest.q);
  from.read_extended("momentum rest", state_.rest.p);
  sequence_->restore(from);
}

}  // namespace diracstep
