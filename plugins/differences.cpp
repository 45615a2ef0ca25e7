#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/plugins/differences.hpp>

namespace diracstep {

namespace {

constexpr std::array<double, 3> weights{45.0 / 60.0, -9.0 / 60.0, 1.0 / 60.0};

/// A power of two, so that x + kδ is exact for most x.
double increment(double x) { return std::exp2(std::ceil(std::log2(std::max(1.0, std::abs(x)))) - 9.0); }

bool disjoint(const std::vector<bool>& taken, std::span<const int> rows) {
  return std::ranges::none_of(rows, [&](int row) { return taken[static_cast<std::size_t>(row)]; });
}

std::span<const int> rows_of(const SparsityPattern& pattern, int column) {
  const auto j = static_cast<std::size_t>(column);
  const int begin = pattern.column_starts()[j], end = pattern.column_starts()[j + 1];
  return pattern.row_indices().subspan(static_cast<std::size_t>(begin),
                                       static_cast<std::size_t>(end - begin));
}

}  // namespace

void gradient_by_differences(const std::function<double(ConstVectorRef)>& f, ConstVectorRef x, VectorRef g) {
  Vector shifted = x;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double delta = std::isfinite(x[i]) ? increment(x[i]) : 1.0;
    double sum = 0.0;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      const double shift = static_cast<double>(k + 1) * delta;
      shifted[i] = x[i] + shift;
      const double ahead = f(shifted);
      shifted[i] = x[i] - shift;
      sum += weights[k] * (ahead - f(shifted));
    }
    shifted[i] = x[i];
    g[i] = sum / delta;
  }
}

void rate_by_differences(const std::function<void(double, VectorRef)>& f, double t, VectorRef rate) {
  Vector ahead(rate.size()), behind(rate.size());
  const double delta = increment(t);
  rate.setZero();
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const double shift = static_cast<double>(k + 1) * delta;
    f(t + shift, ahead);
    f(t - shift, behind);
    rate += weights[k] / delta * (ahead - behind);
  }
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
                                     ConstVectorRef x, VectorRef values) const {
  Vector shifted = x, ahead(pattern_.rows()), behind(pattern_.rows()), sum(pattern_.rows());
  for (const std::vector<int>& group : groups_) {
    double delta = 0.0;
    for (const int column : group) delta = std::max(delta, increment(x[column]));
    sum.setZero();
    for (std::size_t k = 0; k < weights.size(); ++k) {
      const double shift = static_cast<double>(k + 1) * delta;
      for (const int column : group) shifted[column] = x[column] + shift;
      f(shifted, ahead);
      for (const int column : group) shifted[column] = x[column] - shift;
      f(shifted, behind);
      sum += weights[k] * (ahead - behind);
    }
    for (const int column : group) {
      shifted[column] = x[column];
      const int begin = pattern_.column_starts()[static_cast<std::size_t>(column)];
      const auto rows = rows_of(pattern_, column);
      for (std::size_t r = 0; r < rows.size(); ++r)
        values[begin + static_cast<Eigen::Index>(r)] = sum[rows[r]] / delta;
    }
  }
}

}  // namespace diracstep
