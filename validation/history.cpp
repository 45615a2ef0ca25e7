#include <algorithm>
#include <cmath>
#include <diracstep/core/run.hpp>
#include <diracstep/validation/history.hpp>

namespace diracstep {

namespace {

constexpr double shown_error = 1e-6;

/// Better: below the shown error, and there the least work; else the smaller error.
bool better(const StudyRow& a, const StudyRow& b) {
  const bool a_exact = a.error() <= shown_error, b_exact = b.error() <= shown_error;
  if (a_exact != b_exact) return a_exact;
  return a_exact ? a.cpu_seconds.median < b.cpu_seconds.median : a.error() < b.error();
}

const StudyRow* shown_row(const Study& study) {
  const StudyRow* best = nullptr;
  for (const StudyRow& row : study.rows)
    if (row.ok() && !row.is_yardstick() && !row.method.ends_with(variable_steps) &&
        (best == nullptr || better(row, *best)))
      best = &row;
  return best;
}

double change(double now, double start) { return std::abs(now - start) / std::max(std::abs(start), 1.0); }

/// The steps of a row, shortened where there are too few for a smooth picture.
StepGrid finer(const StudyRow& row, const Study& study, long points) {
  const double length = study.t_end - study.t_start;
  const long steps = std::max(row.steps, points / 2);
  return {steps, length / static_cast<double>(steps)};
}

/// Takes samples into a history.
class Recorder {
 public:
  Recorder(const CatalogueScene& entry, const Scene& scene, History& history)
      : entry_(entry), scene_(scene), history_(history) {
    for (const Invariant& invariant : entry.invariants) history.invariants.push_back({invariant.name, {}});
    const Start& start = scene.start;
    energy_ = scene.energy(start.time, start.q, start.v);
  }

  void take(const Sample& sample) {
    history_.time.push_back(sample.time);
    history_.q.push_back(sample.q);
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

}  // namespace

History record_history(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers,
                       const Study& study, long points) {
  const StudyRow* row = shown_row(study);
  if (row == nullptr) return {};
  const StepGrid grid = finer(*row, study, points);
  Integrator integrator(entry.scene, registry, solvers,
                        {.method = row->method, .order = row->order, .step = grid.step});
  History history;
  history.method = row->method;
  history.order = row->order;
  history.step = grid.step;
  history.coordinates = integrator.scene().coordinates;
  history.plan = integrator.plan();
  Recorder recorder(entry, integrator.scene(), history);
  const long every = std::max(1L, grid.steps / points);
  const RunReport report = run(integrator, grid.steps, study.momentum, every, [&](const Sample& sample) {
    recorder.take(sample);
    return true;
  });
  history.failure = report.last.failure;
  return history;
}

}  // namespace diracstep
