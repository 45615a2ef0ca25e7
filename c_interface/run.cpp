#include <algorithm>
#include <cmath>
#include <diracstep/c_interface/point_writer.hpp>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/runs/run_points.hpp>
#include <exception>

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

void PointWriter::write(const Sample& of_run, long row) {
  Sample point = of_run;
  point.lambda = shown_forces(entry_, point.time, point.q, point.lambda);
  if (points_.t != nullptr) points_.t[row] = point.time;
  if (points_.energy != nullptr) points_.energy[row] = point.energy;
  write_row(point.q, points_.q, row);
  write_row(point.v, points_.v, row);
  write_row(point.p, points_.p, row);
  const auto row_of = [row](double* columns, std::size_t width) {
    return columns != nullptr ? columns + row * static_cast<long>(width) : nullptr;
  };
  write_forces(entry_, point, row_of(points_.lambda, static_cast<std::size_t>(entry_.shown().rows())));
  write_numbers(entry_, point, row_of(points_.invariants, entry_.invariants.size()),
                row_of(points_.outputs, entry_.outputs.size()));
}

void write_forces(const CatalogueScene& entry, const Sample& point, double* to) {
  if (to == nullptr) return;
  const Eigen::Index rows = entry.shown().rows(), known = std::min(rows, point.lambda.size());
  std::fill_n(std::copy_n(point.lambda.begin(), known, to), rows - known, 0.0);
}

void write_numbers(const CatalogueScene& entry, const Sample& point, double* invariants, double* outputs) {
  if (invariants != nullptr)
    for (const Invariant& invariant : entry.invariants)
      *invariants++ = invariant.at(point.time, point.q, entry.scene->lagrangian ? point.v : point.p);
  if (outputs != nullptr)
    for (const Output& output : entry.outputs) *outputs++ = output.at(point.point());
}

void require_sense(const diracstep_course& course) {
  if (course.steps < 0) throw Misuse("steps is " + std::to_string(course.steps) + "; 0 or more are needed");
  if (course.every < 0) throw Misuse("every is " + std::to_string(course.every) + "; 1 or more is needed");
  if (course.times > 0) (void)given(course.time, "the list of times");
  (void)momentum_from(course.momentum);
}

}  // namespace diracstep::c_interface

namespace {

long every_of(const diracstep_course& course) { return course.every > 0 ? course.every : 1; }

/// The steps of a checked motion, until the caller asks for the end.
template <class Stepper>
struct WatchedSteps {
  CheckedMotion<Stepper>& checked;
  const int* stop;
  bool& was_stopped;

  StepReport step() const {
    was_stopped = stopped(stop);
    return was_stopped ? refusal() : checked.step();
  }

 private:
  StepReport refusal() const {
    StepReport report;
    report.solve.status = SolveStatus::refused;
    report.time = checked.motion().time();
    return report;
  }
};

double next_size(const Integrator& stepper) { return stepper.options().step; }
double next_size(const AdaptiveIntegrator& stepper) { return stepper.next_size(); }

/// One run of a motion of either kind.
template <class Stepper>
class Run {
 public:
  Run(diracstep_integrator& handle, EventSteps<Stepper>& motion, const diracstep_course& course,
      diracstep_points& points)
      : handle_(handle),
        motion_(motion),
        course_(course),
        end_(end_of(handle, course)),
        checked_(motion, checks_of(handle, motion, planned_end())),
        writer_(points, handle.entry) {
    motion.read_momentum(momentum_from(course.momentum));
  }

  void go() {
    const StepReport report = at_times() ? shown_at_times()
                              : motion_.events().empty()
                                  ? without_events()
                                  : through_events([this](const Sample& point) { return write(point); });
    handle_.doubt = checked_.text();
    if (full_) std::rethrow_exception(full_);
    if (report.ok() && !stopped_) return;
    keep_last();
    if (stopped_) throw Interruption("interrupted at t = " + to_text(handle_.time(), 17));
    throw Failure(report.failure);
  }

 private:
  static double end_of(const diracstep_integrator& handle, const diracstep_course& course) {
    if (course.ends != 0) return course.end;
    return course.times > 0 ? course.time[course.times - 1] : handle.end;
  }

  /// For the checks, which want to know how long a run will be.
  double planned_end() const {
    if (course_.steps == 0) return end_;
    return motion_.time() + static_cast<double>(course_.steps) * next_size(motion_.stepper());
  }

  bool at_times() const { return course_.steps == 0 && course_.times > 0; }

  StepReport without_events() {
    const Observer keep = [this](const Sample& point) { return write(point); };
    detail::RunOf<Stepper, WatchedSteps<Stepper>, CheckedMotion<Stepper>> run(
        motion_.stepper(), {checked_, course_.stop, stopped_}, momentum_from(course_.momentum),
        every_of(course_), keep, &checked_);
    const RunReport report = course_.steps > 0
                                 ? run.steps(course_.steps)
                                 : run.until(end_, [this] { return next_size(motion_.stepper()); });
    if (report.ok()) checked_.finish();
    return report.last;
  }

  StepReport through_events(const Observer& observer, ShownTimes* times = nullptr) {
    return run_through_events(
        checked_, {.steps = course_.steps, .end = end_, .every = every_of(course_), .times = times}, observer,
        [this] { return !(stopped_ = stopped(course_.stop)); });
  }

  /// What the points do not take ends the run behind the step at hand, which is whole then.
  StepReport shown_at_times() {
    detail::require_ahead(course_.time[course_.times - 1], end_, next_size(motion_.stepper()));
    ShownTimes times({course_.time, course_.time + course_.times}, motion_.time(),
                     next_size(motion_.stepper()), [this](const Sample& point) {
                       try {
                         return write(point);
                       } catch (...) {
                         full_ = std::current_exception();
                         return false;
                       }
                     });
    return through_events({}, &times);
  }

  bool write(const Sample& point) {
    writer_.write(point);
    return true;
  }

  /// The point that a run which ended early has reached.
  void keep_last() {
    if (writer_.has(motion_.time()) || at_times()) return;
    if (motion_.sample(handle_.sample).ok()) writer_.write(handle_.sample);
  }

  diracstep_integrator& handle_;
  EventSteps<Stepper>& motion_;
  const diracstep_course& course_;
  double end_;
  CheckedMotion<Stepper> checked_;
  PointWriter writer_;
  bool stopped_ = false;
  std::exception_ptr full_;  ///< why no more points are taken
};

}  // namespace

void c_interface::run_course(diracstep_integrator& handle, const diracstep_course& course,
                             diracstep_points& points) {
  require_sense(course);
  if (handle.event_at_end() != nullptr)
    throw Misuse("an event has ended the motion at t = " + to_text(handle.time(), 17) + "; reset it");
  if (course.ends != 0) require_inputs_until(handle.entry, course.end, "the end");
  handle.doubt.clear();
  handle.checks.begin_anew();
  std::visit([&](auto& motion) { Run(handle, *motion, course, points).go(); }, handle.motion);
}

int diracstep_run(diracstep_integrator* integrator, const diracstep_course* course,
                  diracstep_points* points) {
  return guarded([&] {
    run_course(given(integrator, "the integrator"), course != nullptr ? *course : diracstep_course{},
               given(points, "where the points go"));
  });
}

long diracstep_expect(const diracstep_integrator* integrator, const diracstep_course* course) {
  if (integrator == nullptr) return 0;
  const diracstep_course chosen = course != nullptr ? *course : diracstep_course{};
  if (chosen.times > 0) return chosen.times;
  const auto* const fixed = std::get_if<std::unique_ptr<FixedMotion>>(&integrator->motion);
  if (fixed == nullptr) return 0;
  const double end = chosen.ends != 0 ? chosen.end : integrator->end;
  const long steps = chosen.steps > 0 ? chosen.steps : steps_left((*fixed)->stepper(), end);
  return steps / every_of(chosen) + 2;  // the start and the end
}
