#pragma once

#include <diracstep/core/integrator/clock.hpp>
#include <diracstep/core/integrator/guess.hpp>
#include <diracstep/core/integrator/integrator_options.hpp>
#include <diracstep/core/integrator/kink_passed.hpp>
#include <diracstep/core/integrator/sample.hpp>
#include <diracstep/core/integrator/solved_stage.hpp>
#include <diracstep/core/integrator/step_report.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/snapshot.hpp>
#include <diracstep/core/steps/state.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace diracstep {

class LeftOutRows;
class PointReader;
class StepDivision;
class StepSequence;
struct PreparedScene;

/// Steps a scene with one method.  Owns every workspace and its solvers, and shares nothing: integrators on
/// different threads do not meet.  The scene's data are planned once, here; a step allocates nothing of its
/// own.
class Integrator {
 public:
  /// Throws Misuse for a bad scene, start, method, order or step; for an inconsistent start, and for
  /// constraints that are redundant there, unless the options say otherwise.  What was moved or dropped
  /// stands in plan().
  Integrator(std::shared_ptr<const Scene> scene, const Registry& registry, const SolverFactory& solvers,
             const IntegratorOptions& options);
  Integrator(Integrator&& other) noexcept;
  Integrator& operator=(Integrator&& other) noexcept;
  ~Integrator();

  /// Goes back to the scene's start, or to another consistent one.
  void reset();
  void reset(const Start& start);

  /// One step, of the size in the options.  Where a function of the scene jumps or has a kink at a known time
  /// or where the motion crosses it (Scene::kinks), the step is taken in parts that meet there, so that it
  /// keeps its order (step_division.hpp).
  StepReport step() { return step(options_.step); }

  /// One step of size h, which may change from step to step and be negative.  Throws Misuse for a step that
  /// is zero or not finite.
  StepReport step(double h);

  /// Takes the last step again from where it started, now with size h; its solution is the guess.  A failure
  /// leaves the state there.  Throws Misuse where the last step failed or there is none, and after restore().
  StepReport retry(double h);

  /// Goes on from another point of a motion: p is any momentum of its class, v an estimate of the velocity
  /// that serves as a guess.  That q fulfils the constraints is not checked.  The counts of work go on.
  void restart(double time, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v);

  double time() const { return clock_.time(options_.step); }
  const Vector& position() const { return state_.q; }
  /// A momentum of the class at the current point, and an estimate of the velocity there.
  const Vector& momentum() const { return state_.p; }
  const Vector& velocity_estimate() const { return state_.v; }
  const Work& work() const { return work_; }
  /// From now on a step that crosses a kink in q and v ends behind the first one: time() tells where.
  void end_steps_at_kinks();
  /// Whether the last step was taken in parts at such times.
  bool met_kinks() const;
  /// Where it crossed kinks in q and v.
  std::span<const KinkPassed> kinks_passed() const;
  /// Empty, or why the last step crossed a kink undivided: the motion crosses it again and again.
  const std::string& stuck_at_kink() const;
  /// How far the ends of the last step by the two finest divisions between its kinks are apart, relative to q
  /// and p; 0 where that is round-off.
  double unresolved_between_kinks() const;
  const Scene& scene() const { return *scene_; }
  const IntegratorOptions& options() const { return options_; }
  const MethodInfo& method() const { return method_.info; }

  /// Reads the current point.  Stepping goes on as if nothing was read, bit by bit; the work is not counted.
  /// `minus` solves the next step, its first stage where it is composed, on a copy: it takes as long again.
  SolveReport sample(Momentum momentum, Sample& sample);
  /// Reads a point that the last step passed; not `minus`.
  SolveReport sample(const KinkPassed& at, Momentum momentum, Sample& sample);

  std::vector<PlanLine> plan() const;

  /// From now on the systems of each step are kept as they were solved, those of the last step at a time.
  /// The motion has the same bits with and without.
  void record_stages(bool wanted);
  /// Of the last step; empty before the first, and where they are not kept.
  const std::vector<SolvedStage>& solved_stages() const;

  /// All that the next steps depend on.  After `restore`, an integrator of the same scene, method and step
  /// goes on with the same bits as the one saved.  restore() throws Misuse for a snapshot that does not fit,
  /// naming what does not, and then the integrator is as after reset().  The last step before it cannot be
  /// taken again by retry().
  Snapshot save() const;
  void restore(const Snapshot& from);
  /// The same beside fields of the caller's.  After a Misuse the integrator is to be reset().
  void save(Snapshot& to) const;
  void restore(SnapshotReader& from);

 private:
  /// The step taken last, or tried.
  struct LastStep {
    double size = 0.0;
    Clock clock;
    State start;
    std::optional<Guess> retry;  ///< what to guess from when it is taken again; none where it cannot be
  };

  Integrator(PreparedScene prepared, const Registry& registry, const SolverFactory& solvers,
             IntegratorOptions options);

  void go_on_from(double time, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v, Origin origin);
  StepReport take(double h, Guess guess);
  StepReport failed(const SolveReport& solve, double time, const std::string& why) const;
  std::string broken_left_out_row(const Vector& end);
  void accept_step(double h, std::size_t pieces);

  std::shared_ptr<const Scene> scene_;
  std::vector<PlanLine> preparation_;
  IntegratorOptions options_;
  Method method_;
  std::unique_ptr<PointReader> reader_;  // the sequence refers to it, also after a move
  std::unique_ptr<StepSequence> sequence_;
  std::unique_ptr<StepDivision> division_;
  std::unique_ptr<LeftOutRows> left_out_;  ///< null where no rows are left out

  Clock clock_;
  State state_;
  LastStep last_;
  Work work_;
};

}  // namespace diracstep
