#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/solvers/detail/fixed_point_trial.hpp>
#include <diracstep/solvers/detail/jacobian_factors.hpp>
#include <diracstep/solvers/direct_solver.hpp>

namespace diracstep {

namespace {

/// Without KINSOL around them so many fixed-point iterations cost what Newton's method does.
constexpr int quick_directly = 8;
/// Of a matrix of so many entries, a step takes one Jacobian and its factors cost what two or three residuals
/// do.
constexpr int few_entries = 600;
/// A solve gives it up where its rate promises more iterations than these.
constexpr int max_fixed_point = 16;

class DirectSolver final : public NonlinearSolver {
 public:
  DirectSolver(NonlinearProblem& problem, KinsolOptions options)
      : problem_(problem),
        options_(options),
        factors_(problem, resolved(options.jacobian, problem.pattern())),
        fixed_point_(options.iteration != Iteration::newton && problem.has_splitting()) {
    if (problem.blocks().size() > report_.residual_norms.size())
      throw Misuse("a problem with " + std::to_string(problem.blocks().size()) +
                   " residual blocks; at most 4 are reported");
    for (Vector* column : {&guess_, &f_, &last_}) column->setZero(problem.size());
  }

  SolveReport solve(VectorRef x) override {
    report_ = {};
    report_.status = SolveStatus::no_convergence;
    guess_ = x;
    if (fixed_point_ && !trial_.given_up()) contract(x);
    if (!report_.ok()) newton(x, x);
    if (report_.ok() && small_rows_are_unsolved(x)) {  // KINSOL goes on from here
      guess_ = x;
      return by_kinsol(x);
    }
    return report_.ok() ? report_ : by_kinsol(x);
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

  std::string description() const override {
    return std::string("direct, ") + factors_.name() + "; KINSOL where it does not converge";
  }
  std::string strategy() const override {
    std::string newton = "Newton's method, " + factors_.policy();
    if (!fixed_point_) return newton;
    const bool measured = options_.iteration == Iteration::automatic;
    return detail::fixed_point_strategy(measured, newton);
  }

 private:
  static JacobianPolicy resolved(JacobianPolicy policy, const SparsityPattern& pattern) {
    const bool few = policy == JacobianPolicy::automatic && pattern.nonzeros() <= few_entries;
    return few ? JacobianPolicy::per_step : policy;
  }

  /// The residual at x, and its largest entry in units of its block; infinite where one is no number.
  double evaluate(ConstVectorRef x) {
    ++report_.residual_evaluations;
    problem_.residual(x, f_);
    return norms_of_blocks(problem_.blocks(), f_.data(), report_.residual_norms);
  }

  /// Whether rows whose terms are far smaller than those of others in their block are not zero beside these.
  bool small_rows_are_unsolved(ConstVectorRef x) {
    problem_.residual(x, f_);
    const double norm = norms_of_blocks(problem_.blocks(), f_.data(), report_.residual_norms);
    return problem_.scales_of_unsolved_rows(f_, std::max(norm, options_.tolerance)) != nullptr;
  }

  /// x ← x − P⁻¹F(x) until F is round-off; where that is slow, x is left where F is smaller than at the
  /// guess.
  void contract(VectorRef& x) {
    const Contraction end = problem_.contract(x, f_, {options_.tolerance, max_fixed_point});
    report_.iterations += end.iterations;
    report_.residual_evaluations += end.iterations + 1;
    report_.residual_norms = end.residual_norms;
    if (end.solved) report_.status = SolveStatus::ok;
    if (!end.nearer) x = guess_;
    if (options_.iteration == Iteration::automatic) judge(end.iterations);
  }

  /// Newton's method from now on, where the fixed-point iteration has turned out to be slow.
  void judge(int iterations) {
    trial_.add(report_.ok() ? iterations : max_fixed_point, quick_directly);
    if (trial_.over()) trial_.count_again();
  }

  /// Newton's method with full steps, as KINSOL takes them: until F is below the tolerance, and where the
  /// corrections are small for as long as it still halves.
  void newton(ConstVectorRef at, VectorRef& x) {
    factors_.begin();
    report_.status = SolveStatus::no_convergence;
    double norm = evaluate(at);
    for (int k = 0; k < options_.max_iterations && std::isfinite(norm) && norm > options_.tolerance; ++k) {
      if (!factor(at, norm)) break;
      const double before = norm;
      last_ = x;
      factors_.solve(f_.data());
      const bool small = small_correction();
      x -= f_;
      ++report_.iterations;
      norm = evaluate(at);
      if (norm <= options_.tolerance || !small || norm < before / 2.0) continue;
      if (norm > before) {
        x = last_;
        norm = evaluate(at);
      }
      break;
    }
    report_.jacobian_evaluations += factors_.evaluations();
    if (!std::isfinite(norm)) report_.status = SolveStatus::not_finite;
    if (norm <= options_.accept) report_.status = SolveStatus::ok;
    if (report_.ok() && report_.iterations > 0 && !factors_.exact() && !factors_.current()) correct_again(x);
  }

  /// Where the convergence is linear, what is left of the error has the same sign in one step after the
  /// other; a last correction, which is not evaluated any more, makes it small beside round-off.
  void correct_again(VectorRef& x) {
    factors_.solve(f_.data());
    x -= f_;
  }

  bool small_correction() const {
    const double size = largest_entry(guess_.data(), guess_.size());
    const double unit = size > 0.0 && std::isfinite(size) ? size : 1.0;
    return largest_entry(f_.data(), f_.size()) <= factors_.step_tolerance(options_.step_tolerance) * unit;
  }

  bool factor(ConstVectorRef x, double norm) {
    using Outcome = detail::JacobianFactors::Outcome;
    const Outcome outcome = factors_.prepare(x, factors_.exact() ? 0.0 : norm);
    if (outcome == Outcome::singular) report_.status = SolveStatus::singular_jacobian;
    if (outcome == Outcome::not_finite) report_.status = SolveStatus::not_finite;
    return outcome == Outcome::ready;
  }

  SolveReport by_kinsol(VectorRef x) {
    x = guess_;
    if (!kinsol_) {
      KinsolOptions options = options_;
      options.iteration = Iteration::newton;
      kinsol_ = kinsol(options)(problem_);
    }
    kinsol_->reset();
    report_.add(kinsol_->solve(x));
    return report_;
  }

  NonlinearProblem& problem_;
  KinsolOptions options_;
  detail::JacobianFactors factors_;
  bool fixed_point_;
  std::unique_ptr<NonlinearSolver> kinsol_;  ///< made where it is needed first
  Vector guess_, f_, last_;
  SolveReport report_;
  detail::FixedPointTrial trial_;
};

}  // namespace

SolverFactory direct(KinsolOptions options) {
  return [options](NonlinearProblem& problem) -> std::unique_ptr<NonlinearSolver> {
    return std::make_unique<DirectSolver>(problem, options);
  };
}

SolverFactory direct() { return direct(KinsolOptions{.iteration = Iteration::automatic}); }

SolverFactory named_solver(const std::string& name, KinsolOptions options) {
  if (name == "direct") {
    options.iteration = Iteration::automatic;
    return direct(options);
  }
  try {
    options.iteration = iteration(name);
  } catch (const Misuse& misuse) {
    throw Misuse(std::string(misuse.what()) + ", and direct, which does without KINSOL");
  }
  return kinsol(options);
}

}  // namespace diracstep
