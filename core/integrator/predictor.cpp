#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/integrator/predictor.hpp>
#include <diracstep/core/numerics/combination.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/stage_sums.hpp>
#include <iterator>
#include <utility>

namespace diracstep {

namespace {

constexpr std::size_t longest = 5;
constexpr std::array<double, 8> no_base{};  ///< of sums of few rows

/// Weights, newest first, of the polynomial through k equally spaced values, taken one spacing further.
constexpr std::array<std::array<double, longest>, longest + 1> extrapolation{
    {{}, {1.0}, {2.0, -1.0}, {3.0, -3.0, 1.0}, {4.0, -6.0, 4.0, -1.0}, {5.0, -10.0, 10.0, -5.0, 1.0}}};

constexpr long max_steps = 1L << 53;  // a double counts so far

/// The rules are compared at every step of the first ones, then now and then.
constexpr long always_until = 12, later_every = 16;

}  // namespace

Predictor::Predictor(StepTraits traits, int unknowns) : traits_(std::move(traits)) {
  for (std::size_t terms = 2; terms <= longest; ++terms) rules_.push_back({false, terms});
  const Vector zero = Vector::Zero(unknowns);
  history_.assign(longest + 1, zero);
  if (traits_.stages.empty()) return;
  for (std::size_t terms = 1; terms < longest; ++terms) rules_.push_back({true, terms});
  candidate_ = missed_ = zero;
}

void Predictor::clear_history() {
  best_ = known_ = best_before_ = known_before_ = 0;
  accepted_ = 0;
}

/// x = Σ_k weights[k] x_{first + k}, newest first, of the entries from `begin` on; by fours, which the
/// processor adds side by side.
void Predictor::combine_history(std::size_t first, std::size_t terms, const double* weights, VectorRef x,
                                Eigen::Index begin) const {
  constexpr Eigen::Index side_by_side = 4;
  const Eigen::Index size = x.size(), whole = size - size % side_by_side;
  for (Eigen::Index i = 0; i < whole; i += side_by_side) {
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (std::size_t k = 0; k < terms; ++k)
      sum += weights[k] * Eigen::Map<const Eigen::Vector4d>(history_[first + k].data() + begin + i);
    Eigen::Map<Eigen::Vector4d>(x.data() + i) = sum;
  }
  for (Eigen::Index i = whole; i < size; ++i) {
    double sum = 0.0;
    for (std::size_t k = 0; k < terms; ++k) sum += weights[k] * history_[first + k].data()[begin + i];
    x.data()[i] = sum;
  }
}

/// x = E last: the polynomials through the stages of `last`, taken into the next step.
void Predictor::extrapolate_stages(const Vector& last, VectorRef x) const {
  Eigen::Index first = 0;
  for (const StageBlock& block : traits_.stages) {
    const auto stages = static_cast<int>(block.weights.rows());
    if (const StageSum sum = stage_sum(block.rows, stages)) {
      sum(last.data() + first, block.weights.data(), no_base.data(), 0, x.data() + first);
      first += static_cast<Eigen::Index>(block.rows) * stages;
      continue;
    }
    for (int i = 0; i < stages; ++i)
      combine(block.rows, stages, &block.weights(0, i), last.data() + first, nullptr,
              x.data() + first + static_cast<Eigen::Index>(block.rows) * i);
    first += static_cast<Eigen::Index>(block.rows) * stages;
  }
}

void Predictor::evaluate(const Rule& rule, VectorRef x) {
  if (!rule.through_stages) return combine_history(0, rule.terms, extrapolation[rule.terms].data(), x);
  // E x_1 + Σ_k w_k d_k with d_k = x_k − E x_{k+1}, the defects of the stage polynomials in the past.
  const std::size_t defects = rule.terms - 1;
  const double* const weights = extrapolation[defects].data();
  combine_history(1, defects, weights, missed_);
  missed_ = history_[0] - missed_;
  extrapolate_stages(missed_, x);
  if (defects == 0) return;
  combine_history(0, defects, weights, missed_);
  x += missed_;
}

void Predictor::predict(VectorRef x) {
  if (rules_[best_].terms > known_) best_ = 0;
  evaluate(rules_[best_], x);
}

/// Largest error of a rule among the leading unknowns; of a long column piece by piece, which takes no
/// memory.
double Predictor::error(const Rule& rule, ConstVectorRef solution) {
  const Eigen::Index leading = traits_.leading_unknowns;
  if (rule.through_stages) {
    evaluate(rule, candidate_);
    return (candidate_ - solution).head(leading).lpNorm<Eigen::Infinity>();
  }
  std::array<double, 512> piece;
  double largest = 0.0;
  for (Eigen::Index i = 0; i < leading; i += std::ssize(piece)) {
    Eigen::Map<Vector> guess(piece.data(), std::min(std::ssize(piece), leading - i));
    combine_history(0, rule.terms, extrapolation[rule.terms].data(), guess, i);
    guess -= solution.segment(i, guess.size());
    largest = std::max(largest, largest_entry(guess.data(), guess.size()));
  }
  return largest;
}

void Predictor::elect(ConstVectorRef solution) {
  double smallest = HUGE_VAL;
  for (std::size_t r = 0; r < rules_.size(); ++r) {
    if (rules_[r].terms > known_) continue;
    const double missed = error(rules_[r], solution);
    if (!(missed < smallest)) continue;
    smallest = missed;
    best_ = r;
  }
}

void Predictor::accept_step(ConstVectorRef solution) {
  best_before_ = best_;
  known_before_ = known_;
  if (known_ >= 2 && (accepted_ < always_until || accepted_ % later_every == 0)) elect(solution);
  ++accepted_;
  for (std::size_t k = longest; k > 0; --k) history_[k].swap(history_[k - 1]);
  history_.front() = solution;
  known_ = std::min(known_ + 1, longest);
}

void Predictor::withdraw_step(VectorRef x) {
  x = history_.front();
  for (std::size_t k = 0; k < longest; ++k) history_[k].swap(history_[k + 1]);
  best_ = best_before_;
  known_ = known_before_;
  --accepted_;
}

void Predictor::save(Snapshot& to) const {
  to.section("predictor");
  to.put("steps accepted", static_cast<double>(accepted_));
  to.put("solutions known", static_cast<double>(known_));
  to.put("best rule", static_cast<double>(best_));
  for (std::size_t k = 0; k < known_; ++k) to.put("solution", history_[k]);
}

void Predictor::restore(SnapshotReader& from) {
  from.section("predictor");
  accepted_ = from.whole_number("steps accepted", max_steps);
  known_ = static_cast<std::size_t>(from.whole_number("solutions known", longest));
  best_ = static_cast<std::size_t>(from.whole_number("best rule", static_cast<long>(rules_.size()) - 1));
  for (std::size_t k = 0; k < known_; ++k) from.read("solution", history_[k]);
}

}  // namespace diracstep
