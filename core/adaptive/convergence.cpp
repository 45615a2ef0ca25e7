#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/convergence.hpp>
#include <sstream>

namespace diracstep {

namespace {

constexpr double unlike = 0.3;             // 1 − the ratio of steps from which runs may agree for no reason
constexpr double safety = 2.5;             // between the estimate and the error asked for
constexpr double aimed = 0.2;              // part of the error asked for that the next run aims at
constexpr double least_order = 0.5;        // observed, of differences that prove something
constexpr double several = 10.0;           // between round-off as it adds up and what is laid to it
constexpr double stagnant_safety = 10.0;   // between differences that do not fall and the error
constexpr double round_off_alone = 1e-15;  // differences below this hold nothing else
constexpr double round_off = 1e-7;         // differences that stop falling below this are laid to round-off

/// p with  d1/d2 = (h0^p − h1^p)/(h1^p − h2^p);  the right side rises with p.
double order_from(double h0, double h1, double h2, double d1, double d2) {
  if (!(d1 > 0.0) || !(d2 > 0.0)) return std::nan("");
  double low = 0.01, high = 40.0;
  for (int k = 0; k < 60; ++k) {
    const double p = 0.5 * (low + high);
    const double a = std::pow(h0 / h1, p), b = std::pow(h2 / h1, p);
    ((a - 1.0) / (1.0 - b) < d1 / d2 ? low : high) = p;
  }
  return 0.5 * (low + high);
}

}  // namespace

void Convergence::clear() {
  steps_.clear();
  differences_.clear();
  estimate_ = none;
  stagnant_ = 0;
}

void Convergence::add(double step, double difference, double round_off) {
  steps_.push_back(step);
  round_off_ = round_off;
  if (runs() < 2) return;
  stagnant_ = runs() > 2 && difference > 0.5 * differences_.back() ? stagnant_ + 1 : 0;
  differences_.push_back(difference);
  judge();
}

void Convergence::insert(std::size_t later, double step, double from_coarser, double from_finer) {
  const auto at = static_cast<std::ptrdiff_t>(runs() - later);
  steps_.insert(steps_.begin() + at, step);
  differences_[static_cast<std::size_t>(at) - 1] = from_finer;
  differences_.insert(differences_.begin() + at - 1, from_coarser);
  judge();
}

void Convergence::judge() {
  double usable = order_;
  for (const std::size_t last : {runs(), runs() - 1})
    if (const double p = order_of(last); p < order_ - 1.0)
      usable = std::min(usable, std::max(p, least_order));
  estimate_ = differences_.back() / (std::pow(1.0 / ratio(runs() - 1), usable) - 1.0);
  if (!extrapolates_) estimate_ = std::max(estimate_, difference());
  if (stagnates() && !(order_of(runs()) >= least_order))
    estimate_ = stagnant_safety * largest_since_stagnation();
}

double Convergence::order_of(std::size_t runs) const {
  if (runs < 3) return none;
  return order_from(steps_[runs - 3], steps_[runs - 2], steps_[runs - 1], differences_[runs - 3],
                    differences_[runs - 2]);
}

bool Convergence::confirmed(std::size_t runs) const {
  return std::abs(order_of(runs) - order_) <= (order_ < 3 ? 0.5 : 1.0);
}

bool Convergence::by_order() const { return order_confirmed() && safety * estimate_ <= error_; }

/// Whether a run and the one before differ so little that both may have the error asked for, if their steps
/// are in this ratio.
bool Convergence::agree(std::size_t k, double ratio) const {
  const double likeness = std::max(1.0, unlike / (1.0 - ratio));
  return safety * likeness * differences_[k - 1] <= error_;
}

bool Convergence::by_three_runs() const {
  return runs() >= 3 && agree(runs() - 1) && agree(runs() - 2) && order_of(runs()) >= least_order &&
         safety * estimate_ <= error_;
}

bool Convergence::at_round_off() const {
  return runs() >= 3 && agree(runs() - 1) && agree(runs() - 2) &&
         std::max(differences_[runs() - 2], differences_[runs() - 3]) <= several * round_off_;
}

/// Of the differences that were not halved and the one that they followed.
double Convergence::largest_since_stagnation() const {
  const std::size_t count = std::min(differences_.size(), stagnant_runs + 1);
  return *std::max_element(differences_.end() - static_cast<std::ptrdiff_t>(count), differences_.end());
}

bool Convergence::by_stagnation() const { return stagnates() && estimate_ <= error_; }

std::string Convergence::grounds() const {
  std::ostringstream text;
  if (at_round_off() && *std::ranges::max_element(differences_) <= several * round_off_) {
    text << "that of round-off, by which already the coarsest of the runs differ";
  } else if (at_round_off()) {
    text << "that of round-off, to which the runs have come";
  } else if (by_order() || by_three_runs()) {
    text.precision(1);
    text << "observed order " << std::fixed << observed_order();
  } else {
    text << "ten times what the runs differ by, which no longer falls: round-off, amplified";
  }
  return text.str();
}

std::size_t Convergence::confirmed_by_run_before() const {
  if (runs() < 2 || accepted()) return 0;
  if (agree(runs() - 1, std::sqrt(ratio(runs() - 1)))) return 1;
  if (runs() < 3 || !confirmed(runs()) || safety * estimate_ > error_) return 0;
  return ratio(runs() - 2) <= ratio(runs() - 1) ? 2 : 1;  // the coarser one is cheaper
}

bool Convergence::near_round_off() const {
  return difference() < round_off_alone || (stagnant_ > 0 && difference() < round_off);
}

double Convergence::next_factor() const {
  if (!(estimate_ > 0.0) || stagnant_ > 0) return 0.7;
  return std::clamp(std::pow(aimed * error_ / estimate_, 1.0 / order_), 0.35, 0.7);
}

double Convergence::work_to_go() const {
  if (runs() < 4 || !(estimate_ > 0.0)) return 1.0;
  double p = 0.3;
  for (const std::size_t last : {runs(), runs() - 1}) p = std::max(p, order_of(last));
  p = std::min<double>(p, order_);
  return std::max(1.0, std::pow(safety * estimate_ / error_, 1.0 / p));
}

double Convergence::better_order() const {
  double better = 0.0;
  if (runs() < 4) return better;
  for (const std::size_t last : {runs(), runs() - 1}) better = std::max(better, order_of(last));
  return better;
}

std::string Convergence::obstacle() const {
  std::ostringstream text;
  text.precision(3);
  if (near_round_off()) {
    text << "the runs no longer come closer to each other than " << difference()
         << ": round-off, or a chaotic motion, sets the limit";
  } else {
    text << "the order observed is " << order_of(runs() - 1) << " and " << order_of(runs())
         << ", the stated one " << order_ << ", with differences of " << difference()
         << " between the runs: the steps do not resolve the motion, or its forces are not smooth, or it "
            "amplifies every error";
  }
  return text.str();
}

}  // namespace diracstep
