#include <cmath>
#include <diracstep/c_interface/point_writer.hpp>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/variable_run_checks.hpp>
#include <diracstep/core/runs/run_points.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace diracstep::c_interface {

namespace {

void write_row(const Vector& column, double* to, long row) {
  if (to != nullptr) std::copy(column.begin(), column.end(), to + row * column.size());
}

}  // namespace

void PointWriter::write(const Sample& point) {
  if (points_.count >= points_.room &&
      (points_.enlarge == nullptr || points_.enlarge(points_.data, &points_) != 0 ||
       points_.count >= points_.room))
    throw Failure("there is room for " + std::to_string(points_.room) +
                  " points only; t = " + to_text(point.time) + " is the first without");
  write(point, points_.count);
  ++points_.count;
  last_time_ = point.time;
}

void PointWriter::write(const Sample& point, long row) {
  if (points_.t != nullptr) points_.t[row] = point.time;
  if (points_.energy != nullptr) points_.energy[row] = point.energy;
  write_row(point.q, points_.q, row);
  write_row(point.v, points_.v, row);
  write_row(point.p, points_.p, row);
  if (points_.lambda != nullptr)
    std::copy_n(point.lambda.begin(), std::min(rows_, point.lambda.size()), points_.lambda + row * rows_);
  if (points_.invariants == nullptr) return;
  double* to = points_.invariants + row * static_cast<long>(invariants_.size());
  for (const Invariant& invariant : invariants_)
    *to++ = invariant.at(point.time, point.q, by_momentum_ ? point.p : point.v);
}

void require_sense(const diracstep_course& course) {
  if (course.steps < 0) throw Misuse("steps is " + std::to_string(course.steps) + "; 0 or more are needed");
  if (course.every < 0) throw Misuse("every is " + std::to_string(course.every) + "; 1 or more is needed");
  if (course.times > 0) (void)given(course.time, "the list of times");
  (void)momentum_from(course.momentum);
}

}  // namespace diracstep::c_interface

namespace {

constexpr const char* events_not_met =
    "the events of the scene are not looked for in runs through this interface; diracstep run does";

long every_of(const diracstep_course& course) { return course.every > 0 ? course.every : 1; }

/// The steps of an integrator with the checks around each, until the caller asks for the end.
template <class Stepper, class Checks>
struct WatchedSteps {
  Stepper& stepper;
  Checks& checks;
  const int* stop;
  bool& was_stopped;

  StepReport step() const {
    was_stopped = stopped(stop);
    if (was_stopped) return refusal();
    before();
    StepReport report = stepper.step();
    if (report.ok()) after();
    return report;
  }

 private:
  StepReport refusal() const {
    StepReport report;
    report.solve.status = SolveStatus::refused;
    report.time = stepper.time();
    return report;
  }
  void before() const {
    if constexpr (std::is_same_v<Stepper, Integrator>)
      checks.before_step(stepper);
    else
      checks.before_step();
  }
  void after() const {
    if constexpr (std::is_same_v<Stepper, Integrator>)
      checks.after_step(stepper);
    else
      checks.after_step();
  }
};

/// One run of an integrator of either kind.
template <class Stepper, class Checks>
class Run {
 public:
  Run(diracstep_integrator& handle, Stepper& stepper, Checks checks, const diracstep_course& course,
      diracstep_points& points)
      : handle_(handle),
        stepper_(stepper),
        checks_(std::move(checks)),
        course_(course),
        momentum_(momentum_from(course.momentum)),
        writer_(points, handle.scene->rows(), handle.invariants, handle.invariants_by_momentum) {}

  template <class Size>
  void go(double end, Size size) {
    const Observer keep = [&](const Sample& point) {
      writer_.write(point);
      return true;
    };
    detail::RunOf<Stepper, WatchedSteps<Stepper, Checks>, Checks> run(
        stepper_, {stepper_, checks_, course_.stop, stopped_}, momentum_, every_of(course_), keep, &checks_);
    const RunReport report = steps(run, end, size);
    handle_.doubt = joined_doubts({checks_.text(), handle_.has_events ? events_not_met : ""});
    if (report.ok()) return;
    keep_last();
    if (stopped_) throw Interruption("interrupted at t = " + to_text(stepper_.time(), 17));
    throw Failure(report.last.failure);
  }

 private:
  template <class Steps, class Size>
  RunReport steps(Steps& run, double end, Size size) {
    if (course_.steps > 0) return run.steps(course_.steps);
    if (course_.times > 0) return run.at({course_.time, static_cast<std::size_t>(course_.times)}, size);
    return run.until(end, size);
  }

  /// The point that a run which ended early has reached.
  void keep_last() {
    if (writer_.has(stepper_.time()) || course_.times > 0) return;
    if (stepper_.sample(momentum_, handle_.sample).ok()) writer_.write(handle_.sample);
  }

  diracstep_integrator& handle_;
  Stepper& stepper_;
  Checks checks_;
  const diracstep_course& course_;
  Momentum momentum_;
  PointWriter writer_;
  bool stopped_ = false;
};

double end_of(const diracstep_integrator& handle, const diracstep_course& course) {
  if (course.times > 0) return course.time[course.times - 1];
  return course.ends != 0 ? course.end : handle.end;
}

/// About so many steps; more than there are numbers for count as none.
long steps_of(const Integrator& integrator, const diracstep_integrator& handle,
              const diracstep_course& course) {
  if (course.steps > 0) return course.steps;
  const double ratio = (end_of(handle, course) - integrator.time()) / integrator.options().step;
  return ratio > 0.0 && ratio < 1e15 ? std::lround(std::ceil(ratio - 1e-9)) : 0;
}

void run(diracstep_integrator& handle, Integrator& stepper, const diracstep_course& course,
         diracstep_points& points) {
  RunChecks checks(stepper, steps_of(stepper, handle, course));
  Run<Integrator, RunChecks>(handle, stepper, std::move(checks), course, points)
      .go(end_of(handle, course), [&] { return stepper.options().step; });
}

void run(diracstep_integrator& handle, AdaptiveIntegrator& stepper, const diracstep_course& course,
         diracstep_points& points) {
  VariableRunChecks checks(stepper, handle.side());
  Run<AdaptiveIntegrator, VariableRunChecks>(handle, stepper, std::move(checks), course, points)
      .go(end_of(handle, course), [&] { return stepper.next_size(); });
}

}  // namespace

int diracstep_run(diracstep_integrator* integrator, const diracstep_course* course,
                  diracstep_points* points) {
  return guarded([&] {
    diracstep_integrator& handle = given(integrator, "the integrator");
    const diracstep_course chosen = course != nullptr ? *course : diracstep_course{};
    require_sense(chosen);
    handle.doubt.clear();
    diracstep_points& into = given(points, "where the points go");
    std::visit([&](auto& stepper) { run(handle, stepper, chosen, into); }, handle.stepper);
  });
}

long diracstep_expect(const diracstep_integrator* integrator, const diracstep_course* course) {
  if (integrator == nullptr) return 0;
  const diracstep_course chosen = course != nullptr ? *course : diracstep_course{};
  if (chosen.times > 0) return chosen.times;
  const auto* const fixed = std::get_if<Integrator>(&integrator->stepper);
  if (fixed == nullptr) return 0;
  return steps_of(*fixed, *integrator, chosen) / every_of(chosen) + 2;  // the start and the end
}
