#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <diracstep/plugins/differences.hpp>
#include <functional>
#include <limits>
#include <sstream>

namespace diracstep {

namespace {

constexpr double agreement = 1e-7;   // of both formulas, relative
constexpr double resolution = 2e-5;  // relative, of both parts of f; δ of 2e-3 of a scale leaves about 2e-6
constexpr double round_off = 4.0 * std::numeric_limits<double>::epsilon();
constexpr double divisor = 16.0;  // of the increment where they do not agree
constexpr int most_divisions = 8;
constexpr double scale_over_increment = 512.0;
constexpr double known_to = 1e-5;         // relative error of derivatives from which they are doubted
constexpr int most_rungs = 12;            // from a guess of a scale
constexpr double slope_known_to = 1e-10;  // relative, from where a straight line asks for no larger scale
constexpr double worth_a_rung = 0.5;      // of the error: less is gained at this point alone

/// The increment for a variable of this scale: a power of two, so that x + kδ is exact for most x.
double increment(double scale) { return std::exp2(std::ceil(std::log2(scale))) / scale_over_increment; }

/// The scale of a variable at x: that at the start, and up to eight times as much where x has grown.
double scale_at(const DifferenceScales& scales, Eigen::Index i, double x) {
  const double size = std::isfinite(x) ? std::abs(x) : 1.0;
  if (scales.size() == 0) return std::max(1.0, size);
  return std::max({scales[i], std::min(size, 8.0 * scales[i]), std::ldexp(size, -20)});
}

/// Sums of one difference, δ not yet divided by.
struct Sums {
  Vector sixth, fourth;    ///< (45 Δ₁ − 9 Δ₂ + Δ₃)/60 and (8 Δ₁ − Δ₂)/12
  Vector bend, bend_near;  ///< about δ² f'', from Δ₁ and Δ₃ and from Δ₁ and Δ₂
  Vector largest;          ///< |f|
  Vector noise;            ///< round-off of f beyond that of its size

  explicit Sums(Eigen::Index rows)
      : sixth(rows), fourth(rows), bend(rows), bend_near(rows), largest(rows), noise(rows) {}

  double disagreement(Eigen::Index r) const { return std::abs(sixth[r] - fourth[r]); }
  double loss(Eigen::Index r) const { return round_off * largest[r] + noise[r]; }
  /// The difference, 0 where it is no more than what f loses by itself.
  double change(Eigen::Index r) const { return std::abs(sixth[r]) <= noise[r] ? 0.0 : sixth[r]; }
  /// The size of the terms of f, which may cancel at x: what f is a scale away.
  double terms(Eigen::Index r, double factor) const {
    const double per_scale = scale_over_increment / factor;
    return std::max({largest[r], std::abs(sixth[r]) * per_scale, std::abs(bend[r]) * per_scale * per_scale});
  }
  /// The size of f' that a disagreement is measured by: near a zero of f', what it is a scale away.
  double size(Eigen::Index r, double factor) const {
    return std::max(std::abs(sixth[r]), std::abs(bend[r]) * scale_over_increment / factor);
  }
  /// The largest part by which both formulas disagree beyond round-off.
  double misfit(double factor) const {
    double largest_part = 0.0;
    for (Eigen::Index r = 0; r < sixth.size(); ++r) {
      const double beyond = disagreement(r) - 8.0 * loss(r);
      if (beyond <= 0.0) continue;
      const double part = beyond / size(r, factor);
      largest_part = std::isfinite(part) ? std::max(largest_part, part) : HUGE_VAL;
    }
    return largest_part;
  }
  /// Whether f is a smooth function of some δ, as far as its odd and its even part show.
  bool resolved(Eigen::Index r) const {
    const double apart = disagreement(r) + std::abs(bend[r] - bend_near[r]);
    return apart <= resolution * (std::abs(sixth[r]) + std::abs(bend[r])) + 8.0 * loss(r);
  }
  /// Whether f is a straight line over some δ, of a slope that is known: it says nothing of how far it stays
  /// one.
  bool known_straight(Eigen::Index r) const {
    return std::abs(bend[r]) <= 8.0 * loss(r) && loss(r) <= slope_known_to * std::abs(sixth[r]);
  }
  bool agree(double factor) const { return misfit(factor) <= agreement; }
};

/// What differences of `rows` functions of n variables are computed in.
struct Workspace {
  Workspace(Eigen::Index n, Eigen::Index rows)
      : shifted(n), deltas(n), ahead(rows), behind(rows), sums(rows), next(rows) {}
  bool fits(Eigen::Index n, Eigen::Index rows) const {
    return !taken && shifted.size() == n && ahead.size() == rows;
  }

  Vector shifted, deltas, ahead, behind;
  Sums sums, next;
  bool taken = false;
};

/// A workspace of the thread, for functions with this noise or with none, lent as long as this lives:
/// differences of differences take two, and after the first ones of a size none allocates any more.
class Lent {
 public:
  Lent(Eigen::Index n, Eigen::Index rows, const Vector& noise = {}) : work_(free_one(n, rows)) {
    work_.taken = true;
    for (Sums* sums : {&work_.sums, &work_.next})
      if (noise.size() > 0)
        sums->noise = noise;
      else
        sums->noise.setZero();
  }
  Lent(const Lent&) = delete;
  Lent& operator=(const Lent&) = delete;
  ~Lent() { work_.taken = false; }

  Workspace* operator->() { return &work_; }
  Workspace& operator*() { return work_; }

 private:
  static Workspace& free_one(Eigen::Index n, Eigen::Index rows) {
    thread_local std::deque<Workspace> all;  // none moves when one is added
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const Workspace& work) { return work.fits(n, rows); });
    if (found != all.end()) return *found;
    if (all.size() >= most_lent && std::none_of(all.begin(), all.end(), std::mem_fn(&Workspace::taken)))
      all.clear();
    return all.emplace_back(n, rows);
  }

  static constexpr std::size_t most_lent = 64;
  Workspace& work_;
};

/// The sums of f(k · factor, out), which evaluates at k increments.
template <class F>
void take(const F& f, double factor, Vector& ahead, Vector& behind, Sums& sums) {
  constexpr std::array<double, 3> sixth{45.0 / 60.0, -9.0 / 60.0, 1.0 / 60.0};
  constexpr std::array<double, 3> fourth{8.0 / 12.0, -1.0 / 12.0, 0.0};
  constexpr std::array<double, 3> bend{-1.0 / 8.0, 0.0, 1.0 / 8.0};
  constexpr std::array<double, 3> bend_near{-1.0 / 3.0, 1.0 / 3.0, 0.0};
  for (Vector* column : {&sums.sixth, &sums.fourth, &sums.bend, &sums.bend_near, &sums.largest})
    column->setZero();
  for (std::size_t k = 0; k < 3; ++k) {
    const double shift = static_cast<double>(k + 1) * factor;
    f(shift, ahead);
    f(-shift, behind);
    sums.sixth += sixth[k] * (ahead - behind);
    sums.fourth += fourth[k] * (ahead - behind);
    sums.bend += bend[k] * (ahead + behind);
    sums.bend_near += bend_near[k] * (ahead + behind);
    sums.largest = sums.largest.cwiseMax(ahead.cwiseAbs()).cwiseMax(behind.cwiseAbs());
  }
}

/// The same with increments that both formulas agree at; returns the factor of the increments, or of those
/// with the smallest misfit where none do: what is not smooth, or lost in round-off, only becomes worse.
template <class F>
double take_checked(const F& f, Workspace& work) {
  Vector &ahead = work.ahead, &behind = work.behind;
  Sums &sums = work.sums, &next = work.next;
  double factor = 1.0;
  take(f, factor, ahead, behind, sums);
  double misfit = sums.misfit(factor);
  if (misfit <= agreement) return factor;
  double smaller = factor;
  for (int k = 0; k < most_divisions && misfit > agreement; ++k) {
    smaller /= divisor;
    take(f, smaller, ahead, behind, next);
    const double found = next.misfit(smaller);
    if (found > 4.0 * misfit) break;
    if (found > misfit) continue;
    misfit = found;
    factor = smaller;
    sums = next;
  }
  return factor;
}

bool disjoint(const std::vector<bool>& taken, std::span<const int> rows) {
  return std::ranges::none_of(rows, [&](int row) { return taken[static_cast<std::size_t>(row)]; });
}

std::span<const int> rows_of(const SparsityPattern& pattern, int column) {
  const auto j = static_cast<std::size_t>(column);
  const int begin = pattern.column_starts()[j], end = pattern.column_starts()[j + 1];
  return pattern.row_indices().subspan(static_cast<std::size_t>(begin),
                                       static_cast<std::size_t>(end - begin));
}

void raise(std::atomic<double>& largest, double value) {
  double known = largest.load();
  while (value > known && !largest.compare_exchange_weak(known, value)) {
  }
}

}  // namespace

void DifferenceQuality::note_energy(double derivative, double error) {
  raise(largest_, std::abs(derivative));
  raise(error_, error);
}

void DifferenceQuality::note_size(double energy) {
  if (std::isfinite(energy)) raise(largest_, std::abs(energy));
}

void DifferenceQuality::note_disagreement(double part) { raise(disagreement_, part); }

std::string DifferenceQuality::doubt() const {
  const double largest = largest_.load(), error = error_.load();
  const double of_energies = error > 0.0 ? std::min(error / largest, 1.0) : 0.0;  // 1: nothing is left
  const double part = std::max(of_energies, disagreement_.load());
  if (!(part > known_to)) return {};
  std::ostringstream text;
  text.precision(1);
  text << "derivatives of the scene's functions are taken by differences, and two step sizes agree to "
       << part << " only: give the derivatives, or functions that lose less in round-off";
  return text.str();
}

DifferenceScales find_scales(const std::function<double(ConstVectorRef)>& f, ConstVectorRef x,
                             const Vector& guesses) {
  DifferenceScales scales = guesses;
  Lent work(x.size(), 1);
  Vector& shifted = work->shifted = x;
  Sums& sums = work->sums;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    double terms = 0.0;    // of f, the largest that a scale has shown so far
    bool changes = false;  // f with this variable: else it says nothing of its scale
    const auto error = [&](double scale) {
      const double delta = increment(scale);
      const auto at = [&](double k, VectorRef out) {
        shifted[i] = x[i] + k * delta;
        out[0] = f(shifted);
      };
      take(at, 1.0, work->ahead, work->behind, sums);
      shifted[i] = x[i];
      changes = changes || std::max(std::abs(sums.sixth[0]), std::abs(sums.bend[0])) > 8.0 * sums.loss(0);
      if (!sums.resolved(0)) return HUGE_VAL;
      terms = std::max(terms, sums.terms(0, 1.0));
      const double sum = (sums.disagreement(0) + round_off * terms) / delta;
      return std::isfinite(sum) ? sum : HUGE_VAL;
    };
    double best = error(scales[i]);
    for (int rung = 1; rung <= most_rungs && best == HUGE_VAL; ++rung) {
      const double smaller = guesses[i] * std::pow(divisor, -rung);
      best = error(smaller);
      if (best < HUGE_VAL) scales[i] = smaller;
    }
    if (best == HUGE_VAL) continue;
    const double terms_at_first = terms;
    for (const double factor : {divisor, 1.0 / divisor}) {
      terms = terms_at_first;
      for (int rung = 0; rung < most_rungs; ++rung) {
        if (factor > 1.0 && sums.known_straight(0)) break;
        const double next = error(scales[i] * factor);
        if (!(next < worth_a_rung * best)) break;
        best = next;
        scales[i] *= factor;
      }
    }
    if (!changes) scales[i] = guesses[i];
  }
  return scales;
}

void gradient_by_differences(const std::function<double(ConstVectorRef)>& f, ConstVectorRef x, VectorRef g,
                             const DifferenceScales& scales, DifferenceQuality* quality, Vector* noise) {
  Lent work(x.size(), 1);
  Vector& shifted = work->shifted = x;
  const Sums& sums = work->sums;
  if (noise != nullptr) noise->resize(x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double scale = scale_at(scales, i, x[i]), delta = increment(scale);
    const auto at = [&](double k, VectorRef out) {
      shifted[i] = x[i] + k * delta;
      out[0] = f(shifted);
    };
    const double factor = take_checked(at, *work);
    shifted[i] = x[i];
    g[i] = sums.sixth[0] / (factor * delta);
    if (noise != nullptr) (*noise)[i] = round_off * sums.terms(0, factor) / (factor * delta);
    if (quality == nullptr) continue;
    const double wrong = sums.agree(factor) ? sums.loss(0) : sums.disagreement(0);
    const double per_scale = scale_over_increment / factor;
    quality->note_size(sums.bend[0] * per_scale * per_scale);  // near a zero of f', what it is a scale away
    quality->note_energy(g[i] * scale, wrong / (factor * delta) * scale);
  }
}

void rate_by_differences(const std::function<void(double, VectorRef)>& f, double t, VectorRef rate,
                         double scale, const Vector& noise) {
  Lent work(1, rate.size(), noise);
  const Sums& sums = work->sums;
  const double delta = increment(std::max(scale, std::ldexp(std::abs(t), -20)));
  const auto at = [&](double k, VectorRef out) { f(t + k * delta, out); };
  const double factor = take_checked(at, *work);
  for (Eigen::Index r = 0; r < rate.size(); ++r) rate[r] = sums.change(r) / (factor * delta);
}

JacobianByDifferences::JacobianByDifferences(SparsityPattern pattern) : pattern_(std::move(pattern)) {
  std::vector<std::vector<bool>> taken;
  for (int column = 0; column < pattern_.columns(); ++column) {
    const auto rows = rows_of(pattern_, column);
    std::size_t group = 0;
    while (group < groups_.size() && !disjoint(taken[group], rows)) ++group;
    if (group == groups_.size()) {
      groups_.emplace_back();
      taken.emplace_back(static_cast<std::size_t>(pattern_.rows()), false);
    }
    groups_[group].push_back(column);
    for (const int row : rows) taken[group][static_cast<std::size_t>(row)] = true;
  }
}

void JacobianByDifferences::evaluate(const std::function<void(ConstVectorRef, VectorRef)>& f,
                                     ConstVectorRef x, VectorRef values, const DifferenceScales& scales,
                                     DifferenceQuality* quality, const Vector& noise) const {
  Lent work(x.size(), pattern_.rows(), noise);
  Vector &shifted = work->shifted = x, &deltas = work->deltas;
  const Sums& sums = work->sums;
  for (Eigen::Index i = 0; i < x.size(); ++i) deltas[i] = increment(scale_at(scales, i, x[i]));
  for (const std::vector<int>& group : groups_) {
    const auto at = [&](double k, VectorRef out) {
      for (const int column : group) shifted[column] = x[column] + k * deltas[column];
      f(shifted, out);
    };
    const double factor = take_checked(at, *work);
    for (const int column : group) {
      shifted[column] = x[column];
      const int begin = pattern_.column_starts()[static_cast<std::size_t>(column)];
      const auto rows = rows_of(pattern_, column);
      for (std::size_t r = 0; r < rows.size(); ++r)
        values[begin + static_cast<Eigen::Index>(r)] = sums.change(rows[r]) / (factor * deltas[column]);
    }
    if (quality == nullptr || sums.agree(factor)) continue;
    for (Eigen::Index r = 0; r < sums.sixth.size(); ++r)
      if (const double size = sums.size(r, factor); size > 0.0)
        quality->note_disagreement(sums.disagreement(r) / size);
  }
}

}  // namespace diracstep
