#include <algorithm>
#include <cmath>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <diracstep/solvers/detail/sundials.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <exception>
#include <string>

namespace diracstep {

namespace {

using detail::require;

/// KINSOL measures a Newton step in units of the guess, which may be next to zero.
constexpr double no_limit = 1e100;
/// A residual of so many tolerances is round-off.
constexpr double round_off = 16.0;

/// KINSOL around our own direct linear solver.  The Jacobian's values live in `values_`; the SUNMatrix that
/// KINSOL carries around is an empty shell, and the solver's `setup` factors `values_`.  Unlike the linear
/// solvers that come with SUNDIALS, this one keeps its symbolic work from one call of KINSol to the next.
class KinsolSolver final : public NonlinearSolver {
 public:
  KinsolSolver(NonlinearProblem& problem, KinsolOptions options)
      : problem_(problem), options_(options), linear_solver_(detail::make_linear_solver(problem.pattern())) {
    const int size = problem.size();
    x_.reset(require(N_VNew_Serial(size, context_), "N_VNew_Serial"));
    unknown_scale_.reset(require(N_VClone(x_.get()), "N_VClone"));
    residual_scale_.reset(require(N_VClone(x_.get()), "N_VClone"));
    last_residual_.setZero(size);
    values_.setZero(problem.pattern().nonzeros());
    make_matrix_shell();
    make_linear_solver_shell();
    kinsol_.reset(require(KINCreate(context_), "KINCreate"));
    sink_.attach(memory());
    require(KINInit(memory(), &KinsolSolver::residual, x_.get()), "KINInit");
    require(KINSetUserData(memory(), this), "KINSetUserData");
    require(KINSetLinearSolver(memory(), linear_shell_.get(), matrix_shell_.get()), "KINSetLinearSolver");
    require(KINSetJacFn(memory(), &KinsolSolver::jacobian), "KINSetJacFn");
    require(KINSetMaxSetupCalls(memory(), 1), "KINSetMaxSetupCalls");
    require(KINSetNumMaxIters(memory(), options.max_iterations), "KINSetNumMaxIters");
    require(KINSetFuncNormTol(memory(), options.tolerance), "KINSetFuncNormTol");
    require(KINSetScaledStepTol(memory(), options.step_tolerance), "KINSetScaledStepTol");
    require(KINSetMaxNewtonStep(memory(), no_limit), "KINSetMaxNewtonStep");
  }

  SolveReport solve(VectorRef x) override {
    report_ = {};
    guess_ = x;
    set_scales();
    attempt(KIN_NONE);
    if (!report_.ok()) {
      ++report_.line_searches;
      attempt(KIN_LINESEARCH);
    }
    x = unknowns();
    return report_;
  }

  void reset() override { linear_solver_->reset(); }
  void save(Snapshot& to) const override { linear_solver_->save(to); }
  void restore(Snapshot& from) override { linear_solver_->restore(from); }

  std::string description() const override { return std::string("KINSOL, ") + linear_solver_->name(); }

 private:
  void* memory() const { return kinsol_.get(); }

  Eigen::Map<Vector> unknowns() const { return {N_VGetArrayPointer(x_.get()), last_residual_.size()}; }

  /// From the guess to a status.
  void attempt(int strategy) {
    unknowns() = guess_;
    int code = run(strategy);
    double norm = measure_residual();
    // KINSOL ends where its steps are small beside the unknowns, which may be far from the origin or of
    // different sizes; it goes on for as long as the residual falls.
    while (code == KIN_STEP_LT_STPTOL && norm > round_off * options_.tolerance &&
           report_.iterations < options_.max_iterations)
      if (!improve(strategy, code, norm)) break;
    const bool converged = code == KIN_SUCCESS || code == KIN_INITIAL_GUESS_OK;
    // Other codes, KIN_STEP_LT_STPTOL above all, come at the round-off floor as well as far from a solution.
    if (converged || norm <= options_.accept)
      report_.status = SolveStatus::ok;
    else if (singular_)
      report_.status = SolveStatus::singular_jacobian;
    else if (not_finite_)
      report_.status = SolveStatus::not_finite;
    else
      report_.status = SolveStatus::no_convergence;
  }

  /// Goes on from the last point and keeps the better one; false where the residual does not halve.
  bool improve(int strategy, int& code, double& norm) {
    const double before = norm;
    const auto norms = report_.residual_norms;
    last_ = unknowns();
    code = run(strategy);
    norm = measure_residual();
    if (norm > before) {
      unknowns() = last_;
      report_.residual_norms = norms;
      norm = before;
    }
    return norm < before / 2.0;
  }

  /// One call of KINSOL from where the unknowns are.
  int run(int strategy) {
    singular_ = not_finite_ = false;
    const int code = KINSol(memory(), x_.get(), strategy, unknown_scale_.get(), residual_scale_.get());
    if (exception_) std::rethrow_exception(std::exchange(exception_, nullptr));
    long iterations = 0;
    KINGetNumNonlinSolvIters(memory(), &iterations);
    report_.iterations += static_cast<int>(iterations);
    return code;
  }

  /// Norm of each block at the last evaluation into the report; the largest one, scaled, back.
  double measure_residual() {
    double largest = 0.0;
    int row = 0;
    std::size_t b = 0;
    for (const ResidualBlock& block : problem_.blocks()) {
      const double norm = last_residual_.segment(row, block.rows).lpNorm<Eigen::Infinity>();
      const bool finite = last_residual_.segment(row, block.rows).allFinite();
      report_.residual_norms.at(b++) = finite ? norm : std::nan("");
      largest = finite ? std::max(largest, norm / block.scale) : HUGE_VAL;
      if (!finite) break;
      row += block.rows;
    }
    return largest;
  }

  void set_scales() {
    const double size = guess_.lpNorm<Eigen::Infinity>();
    N_VConst(size > 0.0 && std::isfinite(size) ? 1.0 / size : 1.0, unknown_scale_.get());
    double* scale = N_VGetArrayPointer(residual_scale_.get());
    for (const ResidualBlock& block : problem_.blocks())
      scale = std::fill_n(scale, block.rows, 1.0 / block.scale);
  }

  /// Runs a callback's body; an exception must not cross KINSOL, so it is kept and thrown again after it.
  template <class Body>
  int guarded(Body body) noexcept {
    try {
      return body();
    } catch (...) {
      exception_ = std::current_exception();
      return -1;
    }
  }

  static KinsolSolver& self(void* data) { return *static_cast<KinsolSolver*>(data); }
  static KinsolSolver& self(SUNLinearSolver solver) { return self(solver->content); }

  static int residual(N_Vector x, N_Vector f, void* data) {
    KinsolSolver& solver = self(data);
    return solver.guarded([&] {
      const Eigen::Index size = solver.last_residual_.size();
      ++solver.report_.residual_evaluations;
      solver.problem_.residual(Vector::Map(N_VGetArrayPointer(x), size), solver.last_residual_);
      Vector::Map(N_VGetArrayPointer(f), size) = solver.last_residual_;
      solver.not_finite_ = !solver.last_residual_.allFinite();
      return solver.not_finite_ ? 1 : 0;  // KINSOL then tries a shorter step
    });
  }

  static int jacobian(N_Vector x, N_Vector, SUNMatrix, void* data, N_Vector, N_Vector) {
    KinsolSolver& solver = self(data);
    return solver.guarded([&] {
      ++solver.report_.jacobian_evaluations;
      solver.problem_.jacobian(Vector::Map(N_VGetArrayPointer(x), solver.last_residual_.size()),
                               solver.values_);
      solver.not_finite_ = !solver.values_.allFinite();
      return solver.not_finite_ ? -1 : 0;
    });
  }

  void make_matrix_shell() {
    matrix_shell_.reset(require(SUNMatNewEmpty(context_), "SUNMatNewEmpty"));
    matrix_shell_->ops->getid = [](SUNMatrix) { return SUNMATRIX_CUSTOM; };
    matrix_shell_->ops->zero = [](SUNMatrix) { return 0; };
    matrix_shell_->ops->destroy = [](SUNMatrix m) { SUNMatFreeEmpty(m); };
  }

  void make_linear_solver_shell() {
    linear_shell_.reset(require(SUNLinSolNewEmpty(context_), "SUNLinSolNewEmpty"));
    linear_shell_->content = this;
    auto& ops = *linear_shell_->ops;
    ops.gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; };
    ops.getid = [](SUNLinearSolver) { return SUNLINEARSOLVER_CUSTOM; };
    ops.initialize = [](SUNLinearSolver) { return 0; };
    ops.setup = [](SUNLinearSolver s, SUNMatrix) {
      KinsolSolver& solver = self(s);
      solver.singular_ = !solver.linear_solver_->factor(solver.values_.data());
      return solver.singular_ ? 1 : 0;
    };
    ops.solve = [](SUNLinearSolver s, SUNMatrix, N_Vector x, N_Vector b, sunrealtype) {
      if (x != b) N_VScale(1.0, b, x);
      self(s).linear_solver_->solve(N_VGetArrayPointer(x));
      return 0;
    };
    ops.free = [](SUNLinearSolver s) {
      SUNLinSolFreeEmpty(s);
      return 0;
    };
  }

  NonlinearProblem& problem_;
  KinsolOptions options_;
  std::unique_ptr<detail::LinearSolver> linear_solver_;
  detail::Context context_;  // outlives everything made from it
  detail::MessageSink sink_;
  detail::VectorHandle x_, unknown_scale_, residual_scale_;
  detail::MatrixHandle matrix_shell_;
  detail::LinearSolverHandle linear_shell_;
  detail::KinsolHandle kinsol_;
  Vector guess_, last_, last_residual_, values_;
  SolveReport report_;
  std::exception_ptr exception_;
  bool singular_ = false;
  bool not_finite_ = false;
};

}  // namespace

SolverFactory kinsol(KinsolOptions options) {
  return [options](NonlinearProblem& problem) -> std::unique_ptr<NonlinearSolver> {
    return std::make_unique<KinsolSolver>(problem, options);
  };
}

}  // namespace diracstep
