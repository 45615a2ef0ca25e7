#include <algorithm>
#include <cmath>
#include <diracstep/c_interface/handles.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

/// Steps one by one may go on beyond the end, or be far fewer: they are looked at as those of a run of about
/// so many.
constexpr long expected_steps = 300;

long expected_from(const Integrator& integrator, double end) {
  return std::max(expected_steps, steps_left(integrator, end));
}

double expected_end(const Integrator& integrator, double end) {
  return integrator.time() + static_cast<double>(expected_from(integrator, end)) * integrator.options().step;
}
double expected_end(const AdaptiveIntegrator&, double end) { return end; }

template <class Stepper>
void begin(const diracstep_integrator& handle, EventSteps<Stepper>& motion,
           std::optional<CheckedMotion<Stepper>>& checks) {
  Sample start;
  if (!motion.sample(start).ok()) return;
  checks.emplace(motion, checks_of(handle, motion, expected_end(motion.stepper(), handle.end)));
  checks->see(start);
}

void begin_checks(diracstep_integrator& handle, FixedMotion& motion) {
  if (handle.push && !handle.checks.pushed)
    handle.checks.pushed.emplace(motion.stepper(), expected_from(motion.stepper(), handle.end));
  else if (!handle.push && !handle.checks.fixed)
    begin(handle, motion, handle.checks.fixed);
}

void begin_checks(diracstep_integrator& handle, VariableMotion& motion) {
  if (!handle.push && !handle.checks.varying) begin(handle, motion, handle.checks.varying);
}

StepReport step(StepChecks& checks, FixedMotion& motion) {
  if (checks.fixed) return checks.fixed->step();
  if (!checks.pushed) return motion.step();
  checks.pushed->before(motion.stepper());
  StepReport report = motion.step();
  if (report.ok() && !motion.acted()) {
    checks.pushed->after(motion.stepper());
    checks.pushed->finish(motion.stepper(), false);  // with the force of this step
  }
  if (motion.acted()) checks.begin_anew();
  return report;
}

StepReport step(StepChecks& checks, VariableMotion& motion) {
  return checks.varying ? checks.varying->step() : motion.step();
}

void require_not_ended(const diracstep_integrator& handle) {
  if (handle.event_at_end() != nullptr)
    throw Misuse("an event has ended the motion at t = " + to_text(handle.time(), 17) + "; reset it");
}

template <class Motion>
void take_steps(diracstep_integrator& handle, Motion& motion, long steps) {
  for (long k = 0; k < steps && !motion.stopped(); ++k) {
    begin_checks(handle, motion);
    const StepReport report = step(handle.checks, motion);
    if (!report.failure.empty()) throw Failure(report.failure);
  }
}

const std::vector<EventHit>& hits_of(const diracstep_integrator& handle) {
  return std::visit([](const auto& motion) -> const std::vector<EventHit>& { return motion->hits(); },
                    handle.motion);
}

diracstep_event told_of(const CatalogueScene& entry, const EventHit& hit) {
  const Event& met = entry.events[hit.event];
  return {met.name.c_str(),
          hit.sample.time,
          hit.sample.q.data(),
          hit.sample.v.data(),
          hit.after ? hit.after->q.data() : nullptr,
          hit.after ? hit.after->v.data() : nullptr,
          met.restitution ? hit.impulse : std::nan("")};
}

}  // namespace

std::vector<diracstep_event> c_interface::events_of(const diracstep_integrator& handle) {
  std::vector<diracstep_event> events;
  for (const EventHit& hit : hits_of(handle)) events.push_back(told_of(handle.entry, hit));
  return events;
}

std::string StepChecks::text() const {
  if (!found.empty()) return found;
  if (fixed) return fixed->text();
  if (varying) return varying->text();
  return pushed ? pushed->text() : "";
}

void StepChecks::begin_anew() {
  found = text();
  fixed.reset();
  varying.reset();
  pushed.reset();
}

void StepChecks::clear() {
  begin_anew();
  found.clear();
}

void StepChecks::see(const Sample& point) {
  if (fixed) fixed->see(point);
  if (varying) varying->see(point);
}

long c_interface::steps_left(const Integrator& integrator, double end) {
  const double ratio = (end - integrator.time()) / integrator.options().step;
  return ratio > 0.0 && ratio < 1e15 ? std::lround(std::ceil(ratio - 1e-9)) : 0;
}

std::function<RunChecks()> c_interface::checks_of(const diracstep_integrator&, FixedMotion& motion,
                                                  double end) {
  return [&motion, end] { return RunChecks(motion.stepper(), steps_left(motion.stepper(), end)); };
}

std::function<VariableRunChecks()> c_interface::checks_of(const diracstep_integrator& handle,
                                                          VariableMotion& motion, double) {
  return [&motion, &handle] {
    return VariableRunChecks(motion.stepper(), handle.side(motion.stepper().integrator()));
  };
}

int diracstep_step(diracstep_integrator* integrator, long steps) {
  return guarded([&] {
    diracstep_integrator& handle = given(integrator, "the integrator");
    if (steps < 0) throw Misuse("steps is " + std::to_string(steps) + "; 0 or more are needed");
    require_not_ended(handle);
    std::visit([&](auto& motion) { take_steps(handle, *motion, steps); }, handle.motion);
  });
}

int diracstep_step_by(diracstep_integrator* integrator, double h) {
  return guarded([&] {
    diracstep_integrator& handle = given(integrator, "the integrator");
    FixedMotion& motion = fixed_of(handle, "a step of this size");
    require_not_ended(handle);
    handle.checks.begin_anew();  // they know steps of one size
    const StepReport report = motion.step(h);
    if (!report.failure.empty()) throw Failure(report.failure);
  });
}

int diracstep_push(diracstep_integrator* integrator, const double* force) {
  return guarded([&] {
    const diracstep_integrator& to = given(integrator, "the integrator");
    if (!to.push) throw Misuse("the integrator was created without the option 'pushed'");
    const Eigen::Map<const Vector> numbers(&given(force, "the force"), to.scene->dimension());
    if (!numbers.allFinite()) throw Misuse("the force is not finite");
    *to.push = numbers;
  });
}

long diracstep_count_events(const diracstep_integrator* integrator) {
  return integrator != nullptr ? static_cast<long>(hits_of(*integrator).size()) : 0;
}

int diracstep_read_event(const diracstep_integrator* integrator, long k, diracstep_event* event) {
  return guarded([&] {
    const diracstep_integrator& from = given(integrator, "the integrator");
    const long count = diracstep_count_events(integrator);
    if (k < 0 || k >= count)
      throw Misuse("there is no event " + std::to_string(k) + "; " + std::to_string(count) + " were met");
    given(event, "where the event goes") = told_of(from.entry, hits_of(from)[static_cast<std::size_t>(k)]);
  });
}
