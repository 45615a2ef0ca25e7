#pragma once

#include <diracstep/core/integrator/solved_stage.hpp>
#include <diracstep/core/methods/method.hpp>
#include <diracstep/sensitivities/detail/extended_scene.hpp>
#include <memory>
#include <optional>
#include <utility>

namespace diracstep::sensitivity {

/// A step F(x; z0) = 0, z1 = G(x; z0) differentiated at its solution, with z0 = (q0, θ, p0), N + n numbers,
/// and z1 = (q1, p1), 2n numbers.
template <class Matrix>
struct StageJacobians {
  Matrix by_unknowns;      ///< F_x
  Matrix by_start;         ///< F_z
  Matrix end_by_unknowns;  ///< G_x
  Matrix end_by_start;     ///< G_z
};

/// The derivatives of the steps of one kind.
template <class Matrix>
class StageEquations {
 public:
  explicit StageEquations(std::unique_ptr<StepProblem> problem) : problem_(std::move(problem)) {}
  StageEquations(const StageEquations&) = delete;
  StageEquations& operator=(const StageEquations&) = delete;
  virtual ~StageEquations() = default;

  /// At any unknowns x, solved or not.
  virtual void take(const SolvedStage& at, StageJacobians<Matrix>& out) = 0;

  /// The way back: F_x of a step, and with it products with the transposes of the others, which a kind of
  /// step may have without their matrices: G_xᵀ z̄1 and G_zᵀ z̄1 − F_zᵀ w.
  virtual const Matrix& take_transposed(const SolvedStage& at) {
    take(at, taken_);
    return taken_.by_unknowns;
  }
  virtual Columns pull_end(const Columns& end) { return taken_.end_by_unknowns.transpose() * end; }
  virtual Columns pull_start(const Columns& end, const Columns& w) {
    return taken_.end_by_start.transpose() * end - taken_.by_start.transpose() * w;
  }

  /// How many unknowns F_x has.  Where the step has fewer, its own are the last ones and its rows the last
  /// rows, and those before them are solved whatever x is.
  virtual int unknowns() const { return problem_->size(); }

  /// The action of the step, its discrete Lagrangian L_d(q0, q1), where one is stated.
  virtual std::optional<double> action(const SolvedStage& /*at*/) { return std::nullopt; }

  StepProblem& problem() { return *problem_; }

 protected:
  StageJacobians<Matrix> taken_;  ///< of the way back

 private:
  std::unique_ptr<StepProblem> problem_;
};

/// What the equations of a step are made from: the step itself, of the scene that is stepped, for F_x and for
/// where it ends; the extended scene for everything else.
struct StageParts {
  std::unique_ptr<StepProblem> problem;
  std::shared_ptr<ExtendedScene> scene;
};

/// F_x of a step at its solution, which `problem` has begun.
template <class Matrix>
Matrix jacobian_of(StepProblem& problem, const Vector& x) {
  Vector values = Vector::Zero(problem.pattern().nonzeros());
  problem.jacobian(x, values);
  return matrix_of<Matrix>(problem.pattern(), values);
}

/// Begins the step as it was when it was solved; what it remembers of earlier ones changes its scales alone.
void begin(StepProblem& problem, const SolvedStage& at);

/// GL(s), and with a phase-space Lagrangian; Radau IIA with s stages; the step of a generating function, with
/// that of the extended scene.  The equations: steps/gauss_lobatto/step.hpp and phase_space_step.hpp,
/// steps/radau/step.hpp, steps/step_problem.hpp.
template <class Matrix>
std::unique_ptr<StageEquations<Matrix>> gauss_lobatto_equations(StageParts parts, int s);
template <class Matrix>
std::unique_ptr<StageEquations<Matrix>> phase_space_equations(StageParts parts, int s);
template <class Matrix>
std::unique_ptr<StageEquations<Matrix>> radau_equations(StageParts parts, int s);
template <class Matrix>
std::unique_ptr<StageEquations<Matrix>> generating_function_equations(
    StageParts parts, std::unique_ptr<GeneratingFunction> extended, const StepRule& rule);

}  // namespace diracstep::sensitivity
