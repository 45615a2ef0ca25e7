#include <diracstep/version.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/run_control.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>

namespace diracstep::command {

namespace {

using Clock = std::chrono::steady_clock;

constexpr long steps_between_looks = 256;
constexpr long points_looked_at = 400;  ///< for the energy
constexpr auto between_checkpoints = std::chrono::seconds(10);

/// What the energy doubt reads of the point where a resumed run once began.
Sample start_of(const Scene& scene) {
  Sample start;
  start.time = scene.start.time;
  start.q = scene.start.q;
  start.v = scene.start.v;
  start.energy = scene.energy(start.time, start.q, start.v);
  return start;
}

class Run {
 public:
  Run(long steps, Integrator& integrator, const Keeping& keeping, RunResult& result)
      : steps_(steps),
        integrator_(integrator),
        keeping_(keeping),
        result_(result),
        doubt_(integrator, steps - integrator.work().steps),
        every_look_(std::max(1L, steps / points_looked_at)),
        next_checkpoint_(Clock::now() + between_checkpoints),
        progress_(static_cast<double>(integrator.work().steps) / static_cast<double>(steps)) {
    if (integrator.work().steps > 0) doubt_.see(start_of(integrator.scene()));
  }

  void go() {
    const long first = integrator_.work().steps;
    if (first == 0 || wanted(first)) keep();
    CheckedSteps steps{integrator_, &doubt_};
    const StepReport last = step_while(
        steps, [&](long k) { return first + k < steps_ && result_.failure.empty() && !interrupted(); },
        [&](long k) {
          visit(first + k);
          return true;
        });
    if (!last.ok()) result_.failure = last.failure;
    if (result_.failure.empty() && integrator_.work().steps < steps_) {
      result_.failure = fmt::format("interrupted at t = {:.17g}", integrator_.time());
      save();
    }
    if (integrator_.time() != kept_time_) keep();
    result_.work = integrator_.work();
    result_.doubt = doubt_.text();
  }

 private:
  /// What there is to do after step k.
  void visit(long k) {
    if (k == steps_ || checkpoint_due(k)) save();
    if (wanted(k))
      keep();
    else if (k % every_look_ == 0)
      look();
    if (k % steps_between_looks == 0) show(k);
  }

  bool wanted(long k) const { return k == steps_ || (keeping_.file != nullptr && k % keeping_.every == 0); }

  bool checkpoint_due(long k) const {
    if (keeping_.checkpoint.empty()) return false;
    if (keeping_.checkpoint_every > 0) return k % keeping_.checkpoint_every == 0;
    return k % steps_between_looks == 0 && Clock::now() >= next_checkpoint_;
  }

  void save() {
    if (keeping_.checkpoint.empty()) return;
    const TrajectoryFile::Mark mark =
        keeping_.file != nullptr ? keeping_.file->sync() : TrajectoryFile::Mark{};
    write_checkpoint(keeping_.checkpoint, {keeping_.identity, mark.lines, mark.bytes, integrator_.save()});
    next_checkpoint_ = Clock::now() + between_checkpoints;
  }

  void keep() {
    Sample sample;
    const SolveReport report = integrator_.sample(keeping_.momentum, sample);
    if (!report.ok()) {
      if (result_.failure.empty())
        result_.failure =
            fmt::format("reading the state at t = {}: {}", integrator_.time(), describe(report.status));
      return;
    }
    kept_time_ = integrator_.time();
    doubt_.see(sample);
    if (keeping_.file != nullptr) keeping_.file->write(sample);
    result_.end = std::move(sample);
  }

  /// At the energy only; a point that cannot be read is told of where it is kept.
  void look() {
    if (integrator_.sample(Momentum::projected, looked_at_).ok()) doubt_.see(looked_at_);
  }

  void show(long k) {
    progress_.show(static_cast<double>(k) / static_cast<double>(steps_),
                   fmt::format("step {} of {}", k, steps_));
  }

  long steps_;
  Integrator& integrator_;
  const Keeping& keeping_;
  RunResult& result_;
  RunChecks doubt_;
  long every_look_;
  Sample looked_at_;
  double kept_time_ = std::nan("");
  Clock::time_point next_checkpoint_;
  Progress progress_;
};

/// What the scene's formulas give at its start and at a point beside it, as a check sum of the bits.
std::string formula_sum(const Scene& scene) {
  const Eigen::Index n = scene.dimension();
  std::string bytes;
  const auto put = [&](const Vector& values) {
    bytes.append(reinterpret_cast<const char*>(values.data()),
                 static_cast<std::size_t>(values.size()) * sizeof(double));
  };
  ConstraintsAtPoint rows(scene.constraints, static_cast<int>(n));
  for (const double shift : {0.0, 0.01}) {
    const Vector q = scene.start.q.array() + shift, v = scene.start.v.array() + shift;
    Vector lq = Vector::Zero(n), lv = Vector::Zero(n);
    scene.lagrangian->gradient(scene.start.time, q, v, lq, lv);
    put(lq);
    put(lv);
    if (scene.rows() == 0) continue;
    rows.evaluate(scene.start.time, q);
    put(rows.coefficients());
  }
  return fmt::format("{:016x}", check_sum(bytes));
}

}  // namespace

void run_to(long steps, Integrator& integrator, const Keeping& keeping, RunResult& result) {
  Run(steps, integrator, keeping, result).go();
}

std::vector<std::pair<std::string, std::string>> identity(const CatalogueScene& entry,
                                                          const Integrator& integrator,
                                                          const Keeping& keeping, bool to_file) {
  const IntegratorOptions& options = integrator.options();
  std::vector<std::pair<std::string, std::string>> run{{"diracstep", DIRACSTEP_VERSION},
                                                       {"scene", entry.scene->name}};
  for (const auto& [name, value] : entry.parameters) run.emplace_back(name, fmt::format("{:.17g}", value));
  run.emplace_back("check sum of the formulas", formula_sum(integrator.scene()));
  run.emplace_back("method", options.method);
  run.emplace_back("order", std::to_string(options.order));
  run.emplace_back("step", fmt::format("{:.17g}", options.step));
  run.emplace_back("substeps", std::to_string(options.substeps));
  run.emplace_back("compensated sums", options.compensated_sums ? "yes" : "no");
  run.emplace_back("trajectory", to_file ? fmt::format("every {}", keeping.every) : "none");
  run.emplace_back("momentum", diracstep::name(keeping.momentum));
  return run;
}

}  // namespace diracstep::command
