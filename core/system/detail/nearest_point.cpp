#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/nearest_point.hpp>
#include <diracstep/core/system/detail/poses.hpp>
#include <utility>

namespace diracstep {

NearestPointProblem::NearestPointProblem(ConstraintBlocks blocks, double t, const Vector& given,
                                         std::vector<int> held)
    : blocks_(std::move(blocks)),
      held_(std::move(held)),
      rows_(blocks_, static_cast<int>(given.size())),
      t_(t),
      given_(given),
      n_(static_cast<int>(given.size())),
      m_(rows_.rows()),
      pattern_(SparsityPattern::dense(n_ + m_, n_ + m_)),
      residual_blocks_{{"distance", n_, scale_of(max_norm(given))}, {"constraint", m_, smallest_scale}},
      row_scales_(n_ + m_),
      row_sizes_(Vector::Zero(m_)) {}

void NearestPointProblem::residual(ConstVectorRef x, VectorRef f) {
  rows_.evaluate(t_, x.head(n_));
  f.head(n_) = x.head(n_) - given_;
  rows_.add_annihilator(x.tail(m_), f.head(n_));
  for (const int i : held_) f[i] = x[i] - given_[i];
  raise_scales(x);
  positions_of(blocks_, t_, x.head(n_), f.tail(m_));
}

const double* NearestPointProblem::scales_of_unsolved_rows(ConstVectorRef f, double level) {
  const double distance = residual_blocks_[0].scale;
  Vector largest = Vector::Zero(m_);
  rows_.pattern().for_each(
      [&](Eigen::Index e, int r, int) { largest[r] += std::abs(rows_.coefficients()[e]) * distance; });
  row_scales_.set(0, Vector::Constant(n_, distance), Vector::Zero(n_), distance);
  row_scales_.set(n_, row_sizes_, largest, residual_blocks_[1].scale);
  return row_scales_.unsolved(f, level);
}

void NearestPointProblem::jacobian(ConstVectorRef x, VectorRef values) {
  rows_.evaluate(t_, x.head(n_));
  auto j = values.reshaped(size(), size());
  j.setZero();
  j.topLeftCorner(n_, n_).setIdentity();
  int row = n_;
  for (const auto& block : blocks_) {
    Vector curvature(block->curvature_pattern().nonzeros());
    block->annihilator_derivative(t_, x.head(n_), x.segment(row, block->rows()), curvature);
    Eigen::Index k = 0;
    for (const auto& [i, c] : block->curvature_pattern().entries()) j(i, c) += curvature[k++];
    row += block->rows();
  }
  Eigen::Index k = 0;
  for (const auto& [i, c] : rows_.pattern().entries()) {
    j(n_ + i, c) = j(c, n_ + i) = rows_.coefficients()[k];
    ++k;
  }
  for (const int i : held_) {
    j.row(i).setZero();
    j(i, i) = 1.0;
  }
}

/// The scales cover the terms at x: positions, and rows times positions.
void NearestPointProblem::raise_scales(ConstVectorRef x) {
  ResidualBlock &distance = residual_blocks_[0], &constraint = residual_blocks_[1];
  const double size = max_norm(x.head(n_));
  if (std::isfinite(size)) distance.scale = std::max(distance.scale, scale_of(size));
  Vector sizes = Vector::Zero(m_);
  rows_.pattern().for_each([&](Eigen::Index e, int r, int c) {
    sizes[r] += std::abs(rows_.coefficients()[e]) * (std::abs(x[c]) + std::abs(given_[c]));
  });
  row_sizes_ = row_sizes_.cwiseMax(sizes);
  const double largest = max_norm(row_sizes_);
  if (std::isfinite(largest)) constraint.scale = std::max(constraint.scale, scale_of(largest));
}

}  // namespace diracstep
