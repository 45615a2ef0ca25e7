#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/reports/history.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/validation/studies/work_precision.hpp>
#include <functional>
#include <utility>

namespace diracstep {

namespace {

constexpr double shown_error = 1e-6;
constexpr long fewest_steps = 50;
constexpr long max_numbers = 30'000;  // positions kept of a run, give or take half
constexpr long finer_track = 12;      // points of a motion to those of the other curves
constexpr long fewest_points = 50;    // … and the points kept of the largest scene

/// Better: below the shown error with enough steps for a curve, and there the least work; else the smaller
/// error.
bool better(const StudyRow& a, const StudyRow& b) {
  const auto exact = [](const StudyRow& row) {
    return row.error() <= shown_error && row.steps >= fewest_steps;
  };
  const bool a_exact = exact(a), b_exact = exact(b);
  if (a_exact != b_exact) return a_exact;
  return a_exact ? a.cpu_seconds.median < b.cpu_seconds.median : a.error() < b.error();
}

const StudyRow* shown_row(const Study& study) {
  const StudyRow* best = nullptr;
  for (const StudyRow& row : study.rows)
    if (row.ok() && !row.is_baseline() && !row.method.ends_with(variable_steps) &&
        (best == nullptr || better(row, *best)))
      best = &row;
  return best;
}

double change(double now, double start) { return std::abs(now - start) / std::max(std::abs(start), 1.0); }

/// The integrator of a run, for a step size.
using IntegratorOf = std::function<Integrator(double)>;

/// A number of steps and their size.
StepGrid grid_of(const Study& study, long steps) {
  return {steps, (study.t_end - study.t_start) / static_cast<double>(steps)};
}

/// The error of a run while it goes on: against the closed form where the scene has one, else against a
/// second run of half the step beside it.
class ErrorAlongside {
 public:
  ErrorAlongside(const CatalogueScene& entry, const Study& study, const IntegratorOf& integrator_of,
                 double step)
      : entry_(entry), momentum_(study.momentum), finer_(integrator_of(0.5 * step)) {
    closed_form_ = known_point(entry, 0.5 * (study.t_start + study.t_end)).has_value();
  }

  std::string against() const { return closed_form_ ? "the closed form" : "the same run with half the step"; }

  /// Takes the next point; the error is NaN from where the second run has failed.
  void take(const Sample& sample, long steps) {
    double q = StudyRow::none, p = StudyRow::none;
    if (closed_form_) {
      if (const auto reference = known_point(entry_, sample.time)) {
        q = distance(sample.q, reference->q);
        p = reference->p.size() > 0 ? distance(sample.p, reference->p) : 0.0;
      }
    } else if (follow(steps)) {
      q = distance(sample.q, other_.q);
      p = distance(sample.p, other_.p);
    }
    errors_.emplace_back(q, p);
    largest_q_ = std::max(largest_q_, sample.q.lpNorm<Eigen::Infinity>());
    largest_p_ = std::max(largest_p_, sample.p.lpNorm<Eigen::Infinity>());
  }

  /// Over the largest q and p of the run, since those of a point may vanish.
  std::vector<double> relative() const {
    std::vector<double> all;
    const auto over = [](double error, double size) { return size > 0.0 ? error / size : error; };
    for (const auto& [q, p] : errors_) all.push_back(std::max(over(q, largest_q_), over(p, largest_p_)));
    return all;
  }

 private:
  static double distance(const Vector& a, const Vector& b) { return (a - b).lpNorm<Eigen::Infinity>(); }

  bool follow(long steps) {
    for (; taken_ < 2 * steps && going_; ++taken_) going_ = finer_.step().ok();
    return going_ && finer_.sample(momentum_, other_).ok();
  }

  const CatalogueScene& entry_;
  Momentum momentum_;
  Integrator finer_;
  Sample other_;
  std::vector<std::pair<double, double>> errors_;  ///< of q and p
  double largest_q_ = 0.0, largest_p_ = 0.0;
  long taken_ = 0;
  bool closed_form_ = false, going_ = true;
};

/// Takes samples into a history.
class Recorder {
 public:
  Recorder(const CatalogueScene& entry, const Scene& scene, History& history)
      : entry_(entry), scene_(scene), history_(history) {
    for (const Invariant& invariant : entry.invariants) history.invariants.push_back({invariant.name, {}});
    energy_ = scene.energy(scene.start);
  }

  void take(const Sample& sample) {
    history_.time.push_back(sample.time);
    history_.energy.push_back(change(sample.energy, energy_));
    if (scene_.rows() > 0) history_.constraint.push_back(largest_violation(scene_, sample));
    for (std::size_t i = 0; i < entry_.invariants.size(); ++i) {
      const double value = entry_.invariants[i].at(sample.time, sample.q, second_argument(sample));
      if (first_.size() == i) first_.push_back(value);
      history_.invariants[i].values.push_back(change(value, first_[i]));
    }
  }

 private:
  const Vector& second_argument(const Sample& sample) const {
    return entry_.scene->lagrangian ? sample.v : sample.p;
  }

  const CatalogueScene& entry_;
  const Scene& scene_;
  History& history_;
  double energy_;
  std::vector<double> first_;  ///< the invariants at the start
};

History described(const StudyRow& row, const CatalogueScene& entry) {
  History history;
  history.method = row.method;
  history.order = row.order;
  history.step = row.step;
  history.motion = motion_of(entry);
  return history;
}

/// Fills in the track of the motion: fewer points of a large scene, and steps short enough for a picture.
void record_track(History& history, const Study& study, const StudyRow& row, long points,
                  const IntegratorOf& integrator_of) {
  const auto& coordinates = history.motion.coordinates;
  const auto drawn = static_cast<long>(coordinates.size());
  const long kept =
      std::clamp(max_numbers / std::max(drawn, 1L), std::min(fewest_points, points), finer_track * points);
  const StepGrid grid = grid_of(study, std::max(row.steps, kept));
  Integrator integrator = integrator_of(grid.step);
  const RunReport report = run_steps(integrator, grid.steps, study.momentum, std::max(1L, grid.steps / kept),
                                     [&](const Sample& sample) {
                                       history.track_time.push_back(sample.time);
                                       Vector& at = history.positions.emplace_back(drawn);
                                       for (long i = 0; i < drawn; ++i)
                                         at[i] = sample.q[coordinates[static_cast<std::size_t>(i)].index];
                                       return true;
                                     });
  if (!report.ok()) history.failure = "the run for the picture of the motion: " + report.last.failure;
}

}  // namespace

History record_history(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers,
                       const Study& study, long points) {
  const StudyRow* row = shown_row(study);
  if (row == nullptr) return {};
  const StepGrid grid = grid_of(study, row->steps);
  const auto integrator_of = [&](double step) {
    return Integrator(entry.scene, registry, solvers,
                      {.method = row->method, .order = row->order, .step = step});
  };
  Integrator integrator = integrator_of(grid.step);
  History history = described(*row, entry);
  history.plan = integrator.plan();
  record_track(history, study, *row, points, integrator_of);
  ErrorAlongside error(entry, study, integrator_of, grid.step);
  history.error_against = error.against();
  Recorder recorder(entry, integrator.scene(), history);
  const long every = std::max(1L, grid.steps / points);
  const RunReport report =
      run_steps(integrator, grid.steps, study.momentum, every, [&](const Sample& sample) {
        recorder.take(sample);
        error.take(sample, std::lround((sample.time - study.t_start) / grid.step));
        return true;
      });
  history.error = error.relative();
  if (!report.ok()) history.failure = report.last.failure;
  return history;
}

std::string history_csv(const History& history) {
  std::string text = "t,error,energy";
  if (!history.constraint.empty()) text += ",rows";
  for (const auto& invariant : history.invariants) text += ',' + csv_field(invariant.name);
  for (std::size_t i = 0; i < history.time.size(); ++i) {
    text += fmt::format("\n{:.17g},{:.9g},{:.9g}", history.time[i], history.error[i], history.energy[i]);
    if (!history.constraint.empty()) text += fmt::format(",{:.9g}", history.constraint[i]);
    for (const auto& invariant : history.invariants) text += fmt::format(",{:.9g}", invariant.values[i]);
  }
  return text + '\n';
}

std::string motion_csv(const History& history) {
  std::string text = "t";
  for (const auto& drawn : history.motion.coordinates) text += ',' + csv_field(drawn.name);
  for (std::size_t i = 0; i < history.track_time.size(); ++i) {
    text += fmt::format("\n{:.17g}", history.track_time[i]);
    for (const double value : history.positions[i]) text += fmt::format(",{:.17g}", value);
  }
  return text + '\n';
}

}  // namespace diracstep
