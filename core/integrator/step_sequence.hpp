#pragma once

#include <algorithm>
#include <cstddef>
#include <diracstep/core/integrator/solved_stage.hpp>
#include <diracstep/core/integrator/step_solver.hpp>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// What a step is made of.
struct StepDesign {
  /// Fractions of the step, one after the other, and the part that takes each.
  std::vector<std::pair<double, std::size_t>> stages;
  /// The step of the method, and that of its adjoint where a composition takes both.
  std::vector<std::function<std::unique_ptr<StepProblem>()>> parts;
};

/// A step as its method or a composition of it takes it, whole or in pieces.
///
/// All that a step depends on beside the point where it starts: solutions to guess from, and what the parts
/// keep.  A solve leaves no trace until accept_step().
class StepSequence {
 public:
  /// The reader outlives the sequence.
  StepSequence(std::shared_ptr<const Scene> scene, StepDesign design, SolverFactory solvers,
               PointReader& reader);

  struct Outcome {
    SolveReport solve;
    std::string failure;  ///< empty, or what went wrong, with the residual of each block
    bool ok() const { return solve.ok(); }
  };
  /// A step from `start`, in pieces one after the other; afterwards end() is where it ends.
  Outcome solve(std::span<const Interval> pieces, const State& start, Guess guess, Work& work);
  State& end() { return end_; }

  /// The step last solved is one of the motion: the next ones are guessed from it and judged by it.
  void accept_step(std::size_t pieces);
  /// Takes the step accepted last out of the history, where it was a whole one; its solution stands in the
  /// unknowns.
  void withdraw_step();
  void clear_history(Origin origin);
  void leave_hard_steps() {
    for (StepSolver& part : parts_) part.leave_hard_steps();
  }

  /// The impulse λ that enters at the start of the next step, by solving its first stage on a copy.
  SolveReport impulse_ahead(Interval step, const State& start, Vector& impulse);

  std::size_t stages() const { return stages_.size(); }

  /// Whether what it solves is kept from now on: after solve() the stages of all its pieces, in their order,
  /// behind those of keep_record().
  void record_stages(bool wanted) {
    recording_ = wanted;
    record_.clear();
  }
  const std::vector<SolvedStage>& solved_stages() const { return record_; }
  void begin_record() { kept_ = 0; }
  void keep_record() { kept_ = record_.size(); }
  void drop_unkept() {
    record_.erase(record_.begin() + static_cast<std::ptrdiff_t>(std::min(kept_, record_.size())),
                  record_.end());
  }

  const StepSolver& part() const { return parts_.front(); }

  void save(Snapshot& to) const;
  void restore(SnapshotReader& from);

 private:
  struct Stage {
    double fraction;
    std::size_t part;
    Predictor predictor;
    Vector x;  ///< the unknowns in the current step
  };

  StepSolver make_part(std::size_t number) const;
  StepSolver::Task task(Stage& stage, Interval step, const State& start, Guess guess);
  Outcome failed(const SolveReport& report, Stage& stage, double step_size);

  std::shared_ptr<const Scene> scene_;
  StepDesign design_;
  SolverFactory solvers_;
  PointReader* reader_;
  std::vector<StepSolver> parts_;
  std::vector<Stage> stages_;
  std::optional<StepSolver> ahead_;  ///< the copy for impulse_ahead(), made when it is needed first
  Origin origin_ = Origin::start;
  State end_;
  bool recording_ = false;
  std::vector<SolvedStage> record_;
  std::size_t kept_ = 0;
};

}  // namespace diracstep
