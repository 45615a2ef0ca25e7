#pragma once

#include <diracstep/core/integrator/predictor.hpp>
#include <diracstep/core/integrator/step_continuation.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/numerics/snapshot.hpp>
#include <diracstep/core/steps/gauss_lobatto/phase_space_step.hpp>
#include <diracstep/core/steps/matrix_form.hpp>
#include <diracstep/core/steps/step_problem.hpp>
#include <diracstep/core/system/saddle_point.hpp>
#include <diracstep/core/system/scene.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// Which representative of the momentum class [p] ∈ T*Q/Δ°_Q is reported.
enum class Momentum {
  plus,      ///< before the impulse of the next step, p⁺_k: the (+) systems
  minus,     ///< after it, p⁻_k = p⁺_k + A(q_k)ᵀλ_k: the (−) systems
  projected  ///< ∂L/∂v(q_k, v_k) with v_k ∈ Δ_Q(q_k)
};

/// How a scene is stepped; everything but the step size has a default.
struct IntegratorOptions {
  std::string method = automatic_method;  ///< a name of the registry, or "auto": see default_method()
  int order = 0;  ///< composed to this order, methods that are not self-adjoint with their adjoint; 0 keeps
                  ///< the method's own
  double step = 0.0;  ///< step size, may be negative; must be given
  std::optional<ConstraintRule> constraint_rule = std::nullopt;  ///< instead of the method's own
  int dense_limit = as_measured;  ///< up to so many unknowns n + m full matrices; see matrix_form()
  bool force_degenerate = false;  ///< use a method on a degenerate scene that is known to be unstable there
  bool project_start = false;     ///< move an inconsistent start onto the constraints instead of refusing it
  bool drop_redundant_rows =
      false;         ///< leave out rows that depend on others at the start instead of refusing
  int substeps = 1;  ///< a step that cannot be solved is taken in 2, 4, … up to so many smaller ones
  bool compensated_sums = false;  ///< sums of a step in extended precision, what rounding drops carried on:
                                  ///< round-off in the energy then grows like a random walk, see
                                  ///< StepProblem::compensate.  Pays over very many steps
};

/// What one step did.  A failed step leaves the state as it was, bit by bit; only the work done counts.
///
/// A system that Newton's method from the predicted guess does not solve is tried with a line search, from
/// the plain guess, from the last solution, and by following the solution from small step sizes on
/// (step_continuation.hpp); then, where the options allow it, the step is taken in smaller ones.  A solution
/// far from its guess, or the first of a run, is compared with the one that smaller steps lead to, which is
/// taken where it is another.  On a scene with rows, a solution that turns the velocity sharply is compared
/// with the one found from a guess straight on, which is taken where it turns less: where rows come near to
/// depending on each other, motions branch, and Newton's method may end on another branch.
struct [[nodiscard]] StepReport {
  SolveReport solve;
  long step = 0;        ///< number of the step, from 0
  double time = 0.0;    ///< where it started
  std::string failure;  ///< empty, or what went wrong and where, with the residual of each block

  bool ok() const { return solve.ok(); }
};

/// How often a step needed more than Newton's method from its first guess.
struct Retries {
  long line_searches = 0;       ///< attempts of the solver with a line search
  long plain_guesses = 0;       ///< solves from the plain guess after the predicted one failed
  long previous_solutions = 0;  ///< solves from the last solution after that
  long continuations = 0;       ///< solutions followed from small step sizes on
  long other_branches = 0;      ///< … that were not the solution found before
  long divided_steps = 0;       ///< steps taken in smaller ones

  long total() const {
    return line_searches + plain_guesses + previous_solutions + continuations + divided_steps;
  }
};

/// Work done since the start.
struct Work {
  long steps = 0;
  long solves = 0;
  long iterations = 0;
  long residual_evaluations = 0;
  long jacobian_evaluations = 0;
  Retries retries;
};

/// Everything that can be read at one point of a trajectory.
struct Sample {
  double time = 0.0;
  Vector q;       ///< configuration
  Vector v;       ///< velocity in Δ_Q(q)
  Vector p;       ///< momentum, in the representative asked for
  Vector lambda;  ///< forces Λ of the rows at (q, v): Aᵀ Λ is a generalised force, so Λ is power over the
                  ///< unit of a row A v: a force for a row in m/s, a voltage for one in A
  Vector impulse;  ///< with Momentum::minus the impulses λ that the next step lets in at q, units of Λ times
                   ///< time; empty with the others
  double energy = 0.0;
};

/// One decision of the plan: what is done or left out, and why.
struct PlanLine {
  std::string item;
  std::string decision;
  std::string reason;
};

/// Steps a scene with one method.  Owns every workspace and its solvers, and shares nothing: integrators on
/// different threads do not meet.  The scene's data are planned once, here; a step allocates nothing of its
/// own.
class Integrator {
 public:
  /// Throws Misuse for a bad scene, start, method, order or step; for an inconsistent start, and for rows
  /// that depend on others there, unless the options say otherwise.  What was moved or dropped stands in
  /// plan().
  Integrator(std::shared_ptr<const Scene> scene, const Registry& registry, const SolverFactory& solvers,
             const IntegratorOptions& options);

  /// Goes back to the scene's start, or to another consistent one.
  void reset();
  void reset(const Start& start);

  /// One step, of the size in the options.
  StepReport step() { return step(options_.step); }

  /// One step of size h, which may change from step to step and be negative.  Throws Misuse for a step that
  /// is zero or not finite.
  StepReport step(double h);

  /// Takes the last step again from where it started, now with size h; its solution is the guess.  A failure
  /// leaves the state there.  Throws Misuse where the last call was no successful step.
  StepReport retry(double h);

  /// Goes on from another point of a motion: p is any momentum of its class, v a rough velocity that serves
  /// as a guess.  That q fulfils the constraints is not checked.  The counts of work go on.
  void restart(double time, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v);

  double time() const { return clock_.base + static_cast<double>(clock_.steps) * options_.step; }
  const Vector& position() const { return q_; }
  /// A momentum of the class at the current point, and a rough velocity there.
  const Vector& momentum() const { return p_; }
  const Vector& velocity_estimate() const { return v_; }
  const Work& work() const { return work_; }
  const Scene& scene() const { return *scene_; }
  const IntegratorOptions& options() const { return options_; }

  /// Reads the current point.  `minus` solves the next step in advance and keeps the solution for it.
  SolveReport sample(Momentum momentum, Sample& sample);

  std::vector<PlanLine> plan() const;

  /// All that the next steps depend on.  After `restore`, an integrator of the same scene and options goes on
  /// with the same bits as the one saved.  restore() throws Misuse for a snapshot that does not fit, and then
  /// the integrator is as after reset().  The last step before it cannot be taken again by retry().
  Snapshot save() const;
  void restore(Snapshot from);

 private:
  /// One of the two steps that a composition is made of: the method, and its adjoint where it is not its own.
  struct Part {
    std::unique_ptr<StepProblem> problem;
    std::unique_ptr<NonlinearSolver> solver;  ///< null where the step is explicit
    std::unique_ptr<StepContinuation> continuation;
  };
  /// A fraction of the step taken with one of the parts.
  struct Stage {
    double fraction;
    std::size_t part;
    Vector solution;  ///< the unknowns in the current step
    Predictor predictor;
  };

  struct Preparation {
    std::shared_ptr<const Scene> scene;
    std::vector<PlanLine> lines;
  };
  static Preparation prepare(std::shared_ptr<const Scene> scene, const IntegratorOptions& options,
                             const SolverFactory& solvers);
  Integrator(Preparation preparation, const Registry& registry, const SolverFactory& solvers,
             IntegratorOptions options);

  /// Fractions of the step and the part that takes each.
  using Sequence = std::vector<std::pair<double, std::size_t>>;

  Method choose_method(const Registry& registry);
  Sequence composed(const MethodInfo& info) const;
  /// The time: `base`, where the step size last changed, and steps of the options' size from there on. `rest`
  /// is what rounding has dropped from the base.
  struct Clock {
    double base = 0.0, rest = 0.0;
    long steps = 0;
  };
  Part make_part(const Method& method, bool mirror_rule, const SolverFactory& solvers) const;
  void plan_stages(const Registry& registry, const SolverFactory& solvers);
  enum class Guess { predicted, plain, last_solution };

  SolveReport project_velocity(double t, const Vector& q, const Vector& p, Vector& v);
  SolveReport solve_velocity(double t, Vector& v);
  SolveReport solve_stage(std::size_t stage, double t, const Vector& q, const Vector& p, Guess guess);
  SolveReport solve(Part& part, Vector& x, SolveReport& total);
  SolveReport retry_stage(Stage& stage, Interval step, const Vector& q, const Vector& p, Guess guess,
                          SolveReport total);
  bool doubtful(const Stage& stage, Interval step, const Vector& q, const Vector& p,
                const SolveReport& report);
  SolveReport follow_stage(Stage& stage, Interval step, const Vector& q, const Vector& p, SolveReport found);
  /// How the velocity changes from the last step (or part of one) to the one from q_stage_ to q_next_.
  struct Turn {
    double size, speed;
  };
  Turn turn(const Vector& q, double h) const;
  void prefer_smaller_turn(Stage& stage, Interval step, const Vector& q, const Vector& p, SolveReport& total);
  void count(const SolveReport& report, long solves = 1);
  void forget();
  void compensate();
  void learn();
  StepReport take(double h, Guess guess);
  StepReport take_in_pieces(double h, int pieces, Guess guess);
  void remember(int pieces);
  void advance_clock(double h);
  StepReport failed(const SolveReport& report, const StepProblem& problem, double time);
  void read(Snapshot& from);

  std::shared_ptr<const Scene> scene_;
  std::vector<PlanLine> preparation_;
  IntegratorOptions options_;
  Method method_;
  MatrixForm matrices_;
  std::vector<Part> parts_;
  std::vector<Stage> stages_;
  SolverFactory solvers_;
  std::unique_ptr<VelocityProblem> velocity_problem_;  // the solvers refer to the problems, also after a move
  std::unique_ptr<AccelerationProblem> acceleration_problem_;  ///< made when it is needed first
  std::unique_ptr<PhaseSpaceVelocityProblem>
      phase_space_velocity_problem_;  ///< instead of both, where L is linear in v
  std::unique_ptr<NonlinearSolver> velocity_solver_;
  std::unique_ptr<NonlinearSolver> acceleration_solver_;

  Clock clock_;
  double size_ = 0.0;  ///< of the step under way, or of the last one
  Vector q_, p_;
  Vector v_;              ///< the velocity, roughly: a guess only
  double reached_ = 1.0;  ///< part of the step that could be solved, where the last one failed
  Vector q_next_, p_next_, q_stage_, p_stage_, impulse_, start_velocity_, guess_;
  Vector velocity_unknowns_, acceleration_unknowns_;
  struct {
    Clock clock;
    Vector q, p, v;
  } before_;                  ///< where the last step started; v also while one is under way
  bool retryable_ = false;    ///< before_ is known
  bool unlearned_ = false;    ///< the predictors have not seen the last step yet
  bool on_a_motion_ = false;  ///< the start was given by restart(), so that v_ is near the velocity there
  bool first_stage_solved_ = false;  ///< the first stage of the next step is solved already
  Work work_;
};

}  // namespace diracstep
