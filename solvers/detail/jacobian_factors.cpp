#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/solvers/detail/jacobian_factors.hpp>
#include <iterator>
#include <limits>

namespace diracstep::detail {

namespace {

/// Up to so many entries, and so many for each unknown, a new Jacobian costs less than the iterations it
/// saves: full matrices of up to 11 unknowns, bands and chains of up to some tens.
constexpr int max_entries = 200, max_entries_of_unknown = 11;
/// Where so many further iterations at the rate of the last one would not do, a new Jacobian is taken.
constexpr int patience = 6;
constexpr double done = 1e-14;
/// Where an old Jacobian fails, so many solves do without one before it is tried again.
constexpr int fresh_starts_after_failure = 16;
/// So many different step sizes keep factors of their own: those of a symmetric composition of 31 stages, and
/// of Suzuki's composition where factors take much memory.
constexpr std::size_t max_parameters = 16, max_parameters_of_large = 2;
constexpr int large = 10000;

constexpr double none = std::numeric_limits<double>::quiet_NaN();

JacobianPolicy resolved(JacobianPolicy policy, const SparsityPattern& pattern) {
  if (policy != JacobianPolicy::automatic) return policy;
  const int entries = pattern.nonzeros();
  const bool cheap = entries <= max_entries && entries <= max_entries_of_unknown * pattern.rows();
  return cheap ? JacobianPolicy::fresh : JacobianPolicy::kept;
}

}  // namespace

JacobianFactors::JacobianFactors(NonlinearProblem& problem, JacobianPolicy policy)
    : problem_(problem),
      policy_(resolved(policy, problem.pattern())),
      constant_(policy != JacobianPolicy::fresh && !std::isnan(problem.constant_jacobian_parameter())) {
  factors_.reserve(max_parameters);
  current_ = &add();
}

JacobianFactors::Factors& JacobianFactors::add() {
  factors_.push_back({none, make_linear_solver(problem_.pattern()), {}});
  return factors_.back();
}

void JacobianFactors::reset() {
  factors_.resize(1);
  factors_.front().parameter = none;
  factors_.front().factored = factors_.front().usable = false;
  factors_.front().solver->reset();
  current_ = &factors_.front();
  fresh_starts_ = 0;
}

void JacobianFactors::save(Snapshot& to) const {
  if (!keeps_factors()) return factors_.front().solver->save(to);
  to.put("factored Jacobians", static_cast<double>(factors_.size()));
  to.put("number in use", static_cast<double>(current_ - factors_.data()));
  to.put("solves to begin with a new one", fresh_starts_);
  for (const Factors& kept : factors_) {
    kept.solver->save(to);
    to.put("factored", kept.factored);
    to.put("usable", kept.usable);
    if (!kept.factored) continue;
    to.put("Jacobian", kept.values);
    if (constant_) to.put("parameter", kept.parameter);
  }
}

void JacobianFactors::restore(SnapshotReader& from) {
  reset();
  if (!keeps_factors()) return factors_.front().solver->restore(from);
  const long most = max_parameters;
  const long count = from.whole_number("factored Jacobians", most);
  const long current = from.whole_number("number in use", most);
  if (count < 1 || current >= count) throw Misuse("the snapshot has no factors of a Jacobian");
  fresh_starts_ =
      static_cast<int>(from.whole_number("solves to begin with a new one", fresh_starts_after_failure));
  while (std::ssize(factors_) < count) add();
  current_ = factors_.data() + current;
  for (Factors& kept : factors_) {
    kept.solver->restore(from);
    kept.factored = from.flag("factored");
    kept.usable = from.flag("usable");
    if (!kept.factored) continue;
    kept.values.resize(problem_.pattern().nonzeros());
    from.read("Jacobian", kept.values);
    if (constant_) kept.parameter = from.number("parameter");
    if (!kept.solver->holds(kept.values.data())) (void)kept.solver->factor(kept.values.data());
  }
}

/// Takes the factors of this parameter; false where they are still to be made.
bool JacobianFactors::select(double parameter) {
  for (Factors& kept : factors_)
    if (kept.parameter == parameter) {
      current_ = &kept;
      return true;
    }
  const bool first = std::isnan(factors_.front().parameter);
  const std::size_t most = problem_.size() < large ? max_parameters : max_parameters_of_large;
  if (!first && factors_.size() < most) add();
  factors_.back().parameter = parameter;
  current_ = &factors_.back();
  return false;
}

void JacobianFactors::begin() {
  evaluations_ = iterations_ = 0;
  if (fresh_starts_ > 0) --fresh_starts_;
}

bool JacobianFactors::wanted(double norm) {
  if (!current_->usable || policy_ == JacobianPolicy::fresh) return true;
  double expected = norm;
  for (int k = 0; k < patience; ++k) expected *= norm / last_norm_;
  const bool too_slow = iterations_ > 0 && expected > done;
  switch (policy_) {
    case JacobianPolicy::per_step:
      return iterations_ == 0 || too_slow;
    case JacobianPolicy::kept:
      if (too_slow && evaluations_ == 0) fresh_starts_ = fresh_starts_after_failure;
      return too_slow || (iterations_ == 0 && fresh_starts_ > 0);
    default:
      return true;
  }
}

JacobianFactors::Outcome JacobianFactors::prepare(ConstVectorRef x, double norm) {
  const bool wanted_now =
      constant_ ? !select(problem_.constant_jacobian_parameter()) || !current_->usable : wanted(norm);
  last_norm_ = norm;
  ++iterations_;
  current_point_ = wanted_now;
  if (!wanted_now) return Outcome::ready;
  ++evaluations_;
  current_->factored = current_->usable = false;
  if (current_->values.size() == 0) current_->values.setZero(problem_.pattern().nonzeros());
  problem_.jacobian(x, current_->values);
  if (!all_finite(current_->values.data(), current_->values.size())) return Outcome::not_finite;
  current_->factored = true;
  current_->usable = current_->solver->factor(current_->values.data());
  return current_->usable ? Outcome::ready : Outcome::singular;
}

std::string JacobianFactors::policy() const {
  if (constant_) return "constant Jacobian, factored once for each step size";
  switch (policy_) {
    case JacobianPolicy::per_step:
      return "a new Jacobian in each solve";
    case JacobianPolicy::kept:
      return "a Jacobian kept for as long as it converges";
    default:
      return "a new Jacobian in each iteration";
  }
}

}  // namespace diracstep::detail
