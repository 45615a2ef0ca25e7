#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/contraction_loop.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/solvers/detail/fixed_point_trial.hpp>
#include <diracstep/solvers/detail/jacobian_factors.hpp>
#include <diracstep/solvers/detail/shells.hpp>
#include <diracstep/solvers/detail/vector.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <string>

namespace diracstep {

namespace {

using detail::data_of;
using detail::require;

/// KINSOL measures a Newton step in units of the guess, which may be next to zero.
constexpr double no_limit = 1e100;
/// A guess of less has no size to take a unit from: as velocities at rest that fell from step to step, of
/// which forces of rows would be beyond that limit.
constexpr double no_size = 1e-50;
/// The row that a norm is of is no larger than that norm times its scale, but for rounding.
constexpr double at_rounding = 1e-12;

/// A line search squares the residual, which overflows beyond.
constexpr double largest_squared = 1e150;

/// A fixed-point iteration of so many iterations costs what Newton's method does.  It is judged by its first
/// solves, once there is a history to guess from.
constexpr int quick = 6;

/// KINSOL around our own direct linear solver.  KINSOL believes that it gets a new Jacobian in each
/// iteration; JacobianFactors decides what it does get.  The SUNMatrix that KINSOL carries around is an empty
/// shell. Unlike the linear solvers that come with SUNDIALS, ours keeps its symbolic work from one call of
/// KINSol to the next.
class KinsolSolver final : public NonlinearSolver {
 public:
  KinsolSolver(NonlinearProblem& problem, KinsolOptions options)
      : problem_(problem),
        options_(options),
        factors_(problem, options.jacobian),
        fixed_point_(options.iteration != Iteration::newton && problem.has_splitting()) {
    if (problem.blocks().size() > report_.residual_norms.size())
      throw Misuse("a problem with " + std::to_string(problem.blocks().size()) +
                   " residual blocks; at most 4 are reported");
    const int size = problem.size();
    x_ = detail::make_view(size, context_);
    unknown_scale_ = detail::make_weights(x_.get());
    residual_scale_ = detail::make_weights(x_.get());
    for (Vector* column : {&guess_, &last_}) column->setZero(size);
    if (fixed_point_) contraction_residual_.setZero(size);
    matrix_shell_ = detail::make_matrix_shell(context_);
    make_linear_solver_shell();
    kinsol_.reset(require(KINCreate(context_), "KINCreate"));
    sink_.attach(memory());
    require(KINSetNumMaxIters(memory(), options.max_iterations), "KINSetNumMaxIters");
    if (fixed_point_) require(KINSetMAA(memory(), options.anderson), "KINSetMAA");
    require(KINInit(memory(), &KinsolSolver::evaluate, x_.get()), "KINInit");
    require(KINSetUserData(memory(), this), "KINSetUserData");
    require(KINSetLinearSolver(memory(), linear_shell_.get(), matrix_shell_.get()), "KINSetLinearSolver");
    require(KINSetJacFn(memory(), &KinsolSolver::jacobian), "KINSetJacFn");
    require(KINSetMaxSetupCalls(memory(), 1), "KINSetMaxSetupCalls");
    require(KINSetFuncNormTol(memory(), options.tolerance), "KINSetFuncNormTol");
    require(KINSetScaledStepTol(memory(), step_tolerance()), "KINSetScaledStepTol");
    require(KINSetMaxNewtonStep(memory(), no_limit), "KINSetMaxNewtonStep");
  }

  SolveReport solve(VectorRef x) override {
    report_ = {};
    guess_ = x;
    data_of(x_.get()) = x.data();
    set_scales();
    report_.status = SolveStatus::no_convergence;
    if (fixed_point_ && !trial_.given_up()) attempt(KIN_FP);
    if (options_.iteration == Iteration::automatic && fixed_point_) judge_fixed_point();
    if (!report_.ok()) attempt(KIN_NONE);
    if (!report_.ok()) {
      ++report_.line_searches;
      attempt(KIN_LINESEARCH);
    }
    if (report_.status == SolveStatus::not_finite) attempt_by_short_steps();
    return report_;
  }

  void reset() override {
    factors_.reset();
    trial_.reset();
  }
  void save(Snapshot& to) const override {
    factors_.save(to);
    trial_.save(to);
  }
  void restore(SnapshotReader& from) override {
    factors_.restore(from);
    trial_.restore(from);
  }

  std::string description() const override { return std::string("KINSOL, ") + factors_.name(); }
  std::string strategy() const override {
    std::string newton = "Newton's method, " + factors_.policy();
    if (!fixed_point_) return newton;
    const bool measured = options_.iteration == Iteration::automatic;
    return detail::fixed_point_strategy(measured, newton);
  }

 private:
  void* memory() const { return kinsol_.get(); }

  double step_tolerance() const { return factors_.step_tolerance(options_.step_tolerance); }

  Eigen::Map<Vector> unknowns() const { return {data_of(x_.get()), guess_.size()}; }

  /// Newton's method from now on, where the fixed-point iteration has turned out to be slow.
  void judge_fixed_point() {
    if (trial_.given_up() || trial_.over()) return;
    trial_.add(report_.ok() ? report_.iterations : options_.max_iterations, quick);
  }

  /// From the guess to a status.
  void attempt(int strategy) {
    if (report_.residual_evaluations > 0) unknowns() = guess_;  // the first attempt starts there
    double norm = 0.0;
    if (iterate(strategy, norm))
      report_.status = SolveStatus::ok;
    else if (singular_)
      report_.status = SolveStatus::singular_jacobian;
    else if (not_finite_)
      report_.status = SolveStatus::not_finite;
    else
      report_.status = SolveStatus::no_convergence;
    if (report_.ok()) solve_small_rows(norm);
    const bool quadratic = factors_.exact() || factors_.current();
    if (report_.ok() && strategy != KIN_FP && !quadratic && report_.iterations > 0) correct_again();
  }

  /// Where the Jacobian is next to nothing, as that of a diode that blocks, a Newton step may be 1e11 times
  /// the unknowns and end where exponentials overflow.  KINSOL halves such a step five times only, so that
  /// steps are held to the size of the guess, and from where these end to parts of it.
  void attempt_by_short_steps() {
    ++report_.line_searches;
    require(KINSetNumMaxIters(memory(), 5 * options_.max_iterations), "KINSetNumMaxIters");
    require(KINSetMaxNewtonStep(memory(), 1.0), "KINSetMaxNewtonStep");  // the least that KINSOL takes
    short_steps_ = true;
    for (const double parts : {1.0, 16.0, 256.0}) {
      set_unit_of_unknowns(parts);
      attempt(KIN_LINESEARCH);
      if (report_.status != SolveStatus::not_finite) break;
      guess_ = unknowns();
    }
    short_steps_ = false;
    require(KINSetMaxNewtonStep(memory(), no_limit), "KINSetMaxNewtonStep");
    require(KINSetNumMaxIters(memory(), options_.max_iterations), "KINSetNumMaxIters");
  }

  /// From where the unknowns are, for as long as the residual falls; whether it is solved.
  bool iterate(int strategy, double& norm) {
    strategy_ = strategy;
    int code = run();
    norm = report_residual();
    // KINSOL ends where its steps are small beside the unknowns, which may be far from the origin or of
    // different sizes; it goes on for as long as the residual falls.
    while (code == KIN_STEP_LT_STPTOL && norm > round_off_in_tolerances * options_.tolerance &&
           report_.iterations < options_.max_iterations)
      if (!improve(code, norm)) break;
    small_step_ = code == KIN_STEP_LT_STPTOL;
    const bool converged = strategy != KIN_FP && (code == KIN_SUCCESS || code == KIN_INITIAL_GUESS_OK);
    // Other codes, KIN_STEP_LT_STPTOL above all, come at the round-off floor as well as far from a solution.
    return converged || norm <= options_.accept;
  }

  /// Rows whose terms are far smaller than those of others in their block are not judged by the scale of the
  /// block: Newton's method goes on by their own.
  void solve_small_rows(double norm) {
    const Eigen::Map<Vector> f(residual_, guess_.size());
    if (went_back_) problem_.residual(unknowns(), f);
    const double level = std::max((1.0 + at_rounding) * norm, options_.tolerance);
    const double* const scales = problem_.scales_of_unsolved_rows(f, level);
    if (scales == nullptr) return;
    row_scales_ = scales;
    detail::set_weights(residual_scale_.get(), scales);
    require(KINSetScaledStepTol(memory(), options_.step_tolerance), "KINSetScaledStepTol");
    const bool solved = iterate(KIN_NONE, norm);
    require(KINSetScaledStepTol(memory(), step_tolerance()), "KINSetScaledStepTol");
    // A small step of Newton's is one near a solution: what stays is round-off inside of the functions.
    if (!solved && !small_step_) report_.status = SolveStatus::no_convergence;
  }

  /// Where the convergence is linear, what is left of the error is as large as the last residual and of the
  /// same sign in one step after the other; a last correction, which is not evaluated any more, makes it
  /// small beside round-off.
  void correct_again() {
    factors_.solve(residual_);
    unknowns() -= Eigen::Map<const Vector>(residual_, guess_.size());
  }

  /// Goes on from the last point and keeps the better one; false where the residual does not halve.
  bool improve(int& code, double& norm) {
    const double before = norm;
    const auto norms = report_.residual_norms;
    last_ = unknowns();
    code = run();
    norm = report_residual();
    went_back_ = norm > before;
    if (went_back_) {
      unknowns() = last_;
      report_.residual_norms = norms;
      norm = before;
    }
    return norm < before / 2.0;
  }

  /// One call of KINSOL from where the unknowns are.
  int run() {
    singular_ = not_finite_ = went_back_ = false;
    smallest_norm_ = HUGE_VAL;
    factors_.begin();
    const int code = KINSol(memory(), x_.get(), strategy_, unknown_scale_.get(), residual_scale_.get());
    callbacks_.rethrow();
    long iterations = 0;
    KINGetNumNonlinSolvIters(memory(), &iterations);
    report_.iterations += static_cast<int>(iterations);
    report_.jacobian_evaluations += factors_.evaluations();
    return code;
  }

  /// Norm of each block of the residual; NaN where an entry is no number.
  void measure_blocks() {
    const double* row = residual_;
    std::size_t b = 0;
    not_finite_ = false;
    for (const ResidualBlock& block : problem_.blocks()) {
      double& norm = norms_.at(b++) = largest_if_finite(row, block.rows);
      not_finite_ = not_finite_ || std::isnan(norm);
      row += block.rows;
    }
  }

  /// The largest entry of the last residual, each in units of its row.
  double norm_by_rows() const {
    return largest_of(guess_.size(), [this](Eigen::Index i) { return residual_[i] / row_scales_[i]; });
  }

  /// The largest scaled entry of the last residual.
  double scaled_norm() const {
    if (row_scales_ != nullptr) return norm_by_rows();
    double largest = 0.0;
    for (std::size_t b = 0; b < norms_.size(); ++b)
      largest = std::max(largest, norms_[b] * inverse_scales_[b]);
    return largest;
  }

  /// The last norms into the report; the largest one in units of its block back.
  double report_residual() {
    report_.residual_norms = norms_;
    double largest = 0.0;
    std::size_t b = 0;
    for (const ResidualBlock& block : problem_.blocks()) {
      const double norm = norms_.at(b++);
      if (std::isnan(norm)) return HUGE_VAL;
      largest = std::max(largest, norm / block.scale);
    }
    return row_scales_ != nullptr ? norm_by_rows() : largest;
  }

  void set_scales() {
    row_scales_ = nullptr;
    const double size = largest_entry(guess_.data(), guess_.size());
    unit_ = size > no_size && std::isfinite(size) ? 1.0 / size : 1.0;
    set_unit_of_unknowns(1.0);
    std::array<detail::Run, 4> runs{};
    std::size_t b = 0;
    for (const ResidualBlock& block : problem_.blocks()) {
      inverse_scales_.at(b) = 1.0 / block.scale;
      runs.at(b) = {block.rows, inverse_scales_.at(b)};
      ++b;
    }
    detail::set_weights(residual_scale_.get(), std::span(runs).first(b));
  }

  /// The size of the guess, or one of so many parts of it.
  void set_unit_of_unknowns(double parts) {
    detail::set_weights(unknown_scale_.get(), std::array{detail::Run{guess_.size(), parts * unit_}});
  }

  static KinsolSolver& self(void* data) { return *static_cast<KinsolSolver*>(data); }
  static KinsolSolver& self(SUNLinearSolver solver) { return self(solver->content); }
  Eigen::Map<Vector> map(N_Vector x) const { return {data_of(x), guess_.size()}; }

  static int evaluate(N_Vector x, N_Vector f, void* data) {
    KinsolSolver& solver = self(data);
    return solver.callbacks_.guarded([&] {
      ++solver.report_.residual_evaluations;
      const bool fixed_point = solver.strategy_ == KIN_FP;
      solver.residual_ = fixed_point ? solver.contraction_residual_.data() : data_of(f);
      solver.problem_.residual(solver.map(x), Eigen::Map<Vector>(solver.residual_, solver.guess_.size()));
      solver.measure_blocks();
      if (fixed_point) return solver.contract(solver.map(x), solver.map(f));
      const bool overflows = solver.short_steps_ && !(solver.scaled_norm() < largest_squared);
      return solver.not_finite_ || overflows ? 1 : 0;  // KINSOL then tries a shorter step
    });
  }

  /// g = x − P⁻¹F(x); x = g as well, which ends the iteration, where the residual is round-off; a failure
  /// where it grows.
  int contract(Eigen::Map<Vector> x, Eigen::Map<Vector> g) {
    const double norm = scaled_norm();
    const bool stagnates = norm > smallest_norm_ / 2.0;
    if (not_finite_ || norm > 2.0 * smallest_norm_) return norm <= options_.accept ? end_near(x, g) : -1;
    smallest_norm_ = std::min(smallest_norm_, norm);
    if (norm <= options_.tolerance || (stagnates && norm <= round_off_in_tolerances * options_.tolerance))
      return end_near(x, g);
    contract_to(x, g);
    return 0;
  }

  void contract_to(const Eigen::Map<Vector>& x, Eigen::Map<Vector> g) {
    g = contraction_residual_;
    problem_.solve_splitting(g);
    g = x - g;
  }

  /// KINSOL ends where x does not move and gives x back, so x takes the last correction.
  int end_near(Eigen::Map<Vector> x, Eigen::Map<Vector> g) {
    contract_to(x, g);
    x = g;
    return 0;
  }

  static int jacobian(N_Vector x, N_Vector, SUNMatrix, void* data, N_Vector, N_Vector) {
    KinsolSolver& solver = self(data);
    return solver.callbacks_.guarded([&] {
      using Outcome = detail::JacobianFactors::Outcome;
      const double norm = solver.factors_.exact() ? 0.0 : solver.scaled_norm();
      const Outcome outcome = solver.factors_.prepare(solver.map(x), norm);
      if (!solver.factors_.exact() && solver.row_scales_ == nullptr)
        require(KINSetScaledStepTol(solver.memory(), solver.step_tolerance()), "KINSetScaledStepTol");
      solver.not_finite_ = outcome == Outcome::not_finite;
      solver.singular_ = outcome == Outcome::singular;
      return outcome == Outcome::ready ? 0 : -1;
    });
  }

  void make_linear_solver_shell() {
    linear_shell_ = detail::make_linear_solver_shell(context_, this);
    auto& ops = *linear_shell_->ops;
    ops.setup = [](SUNLinearSolver, SUNMatrix) { return 0; };  // jacobian() has done it
    ops.solve = [](SUNLinearSolver s, SUNMatrix, N_Vector x, N_Vector b, sunrealtype) {
      if (self(s).strategy_ == KIN_LINESEARCH)  // which looks at b again
        std::copy_n(data_of(b), self(s).guess_.size(), data_of(x));
      else
        std::swap(data_of(b), data_of(x));
      self(s).factors_.solve(data_of(x));
      return 0;
    };
  }

  NonlinearProblem& problem_;
  KinsolOptions options_;
  detail::JacobianFactors factors_;
  bool fixed_point_;
  detail::Context context_;  // outlives everything made from it
  detail::MessageSink sink_;
  detail::VectorHandle x_, unknown_scale_, residual_scale_;
  detail::MatrixHandle matrix_shell_;
  detail::LinearSolverHandle linear_shell_;
  detail::KinsolHandle kinsol_;
  Vector guess_, last_, contraction_residual_;
  double* residual_ = nullptr;                        ///< the last one
  const double* row_scales_ = nullptr;                ///< where rows are judged one by one
  std::array<double, 4> norms_{}, inverse_scales_{};  ///< of its blocks
  double unit_ = 1.0;                                 ///< one over the size of the guess of this solve
  SolveReport report_;
  detail::ExceptionKeeper callbacks_;
  int strategy_ = KIN_NONE;
  detail::FixedPointTrial trial_;
  double smallest_norm_ = HUGE_VAL;  ///< of the fixed-point iteration so far
  bool singular_ = false;
  bool not_finite_ = false;   ///< the last residual or Jacobian
  bool small_step_ = false;   ///< the iteration ended by one
  bool short_steps_ = false;  ///< of attempt_by_short_steps()
  bool went_back_ = false;    ///< the unknowns are those before the last residual
};

}  // namespace

SolverFactory kinsol(KinsolOptions options) {
  return [options](NonlinearProblem& problem) -> std::unique_ptr<NonlinearSolver> {
    return std::make_unique<KinsolSolver>(problem, options);
  };
}

}  // namespace diracstep
