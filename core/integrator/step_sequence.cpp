#include <algorithm>
#include <diracstep/core/integrator/singularity.hpp>
#include <diracstep/core/integrator/step_sequence.hpp>
#include <sstream>

namespace diracstep {

StepSequence::StepSequence(std::shared_ptr<const Scene> scene, StepDesign design, SolverFactory solvers,
                           PointReader& reader)
    : scene_(std::move(scene)), design_(std::move(design)), solvers_(std::move(solvers)), reader_(&reader) {
  const Eigen::Index n = scene_->dimension();
  end_ = {Vector::Zero(scene_->storage_size()), Vector::Zero(n), Vector::Zero(n)};
  for (std::size_t k = 0; k < design_.parts.size(); ++k) {
    parts_.push_back(make_part(k));
    parts_.back().end().at = end_;  // of its size, so that no later step allocates it
  }
  for (const auto& [fraction, part] : design_.stages) {
    const StepProblem& problem = parts_[part].problem();
    stages_.push_back(
        {fraction, part, Predictor(problem.traits(), problem.size()), Vector::Zero(problem.size())});
  }
}

StepSolver StepSequence::make_part(std::size_t number) const {
  return {design_.parts[number](), solvers_, *reader_};
}

StepSolver::Task StepSequence::task(Stage& stage, Interval step, const State& start, Guess guess) {
  const bool first = origin_ == Origin::start && &stage == &stages_.front() && !stage.predictor.begun();
  return {step, start, stage.predictor, guess, first};
}

StepSequence::Outcome StepSequence::solve(std::span<const Interval> pieces, const State& start, Guess guess,
                                          Work& work) {
  SolveReport total;
  const State* at = &start;
  drop_unkept();
  for (const Interval& piece : pieces) {
    double t = piece.start;
    for (Stage& stage : stages_) {
      StepSolver& part = parts_[stage.part];
      const double h = stage.fraction * piece.size;
      const SolveReport report = part.solve(task(stage, {t, h}, *at, guess), stage.x, work);
      if (!report.ok()) return failed(report, stage, piece.size);
      total.add(report);
      if (recording_) record_.push_back({stage.part, {t, h}, *at, stage.x});
      end_.swap(part.end().at);
      at = &end_;
      t += h;
    }
  }
  return {total, {}};
}

StepSequence::Outcome StepSequence::failed(const SolveReport& report, Stage& stage, double step_size) {
  for (StepSolver& part : parts_) part.drop_factors();
  StepSolver& part = parts_[stage.part];
  std::ostringstream message;
  message << describe(report.status) << " after " << report.iterations << " iterations";
  const char* separator = "; ";
  std::size_t b = 0;
  for (const ResidualBlock& block : part.problem().blocks()) {
    message << separator << block.name << " residual " << report.residual_norms.at(b++);
    separator = ", ";
  }
  if (part.reached() > 0.0 && part.reached() < 1.0)
    message << "; the solution can be followed up to a step of " << part.reached() * step_size;
  if (const std::string why = part.problem().failure(); !why.empty())
    message << "; " << why;
  else
    message << describe_singularity(part.problem(), stage.x, *scene_);
  return {report, message.str()};
}

void StepSequence::accept_step(std::size_t pieces) {
  for (StepSolver& part : parts_) part.accept_step();
  for (Stage& stage : stages_) {
    if (pieces == 1)
      stage.predictor.accept_step(stage.x);
    else  // the solutions are no longer those of equally long steps
      stage.predictor.clear_history();
  }
}

void StepSequence::withdraw_step() {
  for (Stage& stage : stages_) stage.predictor.withdraw_step(stage.x);
}

void StepSequence::clear_history(Origin origin) {
  origin_ = origin;
  for (Stage& stage : stages_) stage.predictor.clear_history();
  for (StepSolver& part : parts_) part.clear_history();
}

SolveReport StepSequence::impulse_ahead(Interval step, const State& start, Vector& impulse) {
  Stage& first = stages_.front();
  if (!ahead_) ahead_.emplace(make_part(first.part));
  ahead_->take_over(parts_[first.part]);
  Vector x(first.x.size());
  Work not_of_the_steps;
  const SolveReport report = ahead_->solve(
      task(first, {step.start, first.fraction * step.size}, start, Guess::predicted), x, not_of_the_steps);
  if (report.ok()) impulse = ahead_->end().impulse;
  return report;
}

void StepSequence::save(Snapshot& to) const {
  to.put("begun at a start", origin_ == Origin::start);
  for (const Stage& stage : stages_) stage.predictor.save(to);
  for (const StepSolver& part : parts_) part.save(to);
}

void StepSequence::restore(SnapshotReader& from) {
  origin_ = from.flag("begun at a start") ? Origin::start : Origin::motion;
  for (Stage& stage : stages_) stage.predictor.restore(from);
  for (StepSolver& part : parts_) part.restore(from);
}

}  // namespace diracstep
