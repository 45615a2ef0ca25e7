#include <algorithm>
#include <diracstep/core/numerics/sparse_columns.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>
#include <diracstep/core/system/detail/combined_rows.hpp>

namespace diracstep {

CombinedRows::CombinedRows(const Scene& scene, double t, const Vector& q, std::size_t known) {
  const std::vector<std::string> own = scene.row_names(), all = scene.whole->row_names();
  for (std::size_t r = 0; r < all.size(); ++r) {
    const bool kept = kept_.size() < known && all[r] == own[kept_.size()];
    (kept ? kept_ : left_).push_back(static_cast<int>(r));
  }
  ConstraintsAtPoint rows(scene.whole->constraints, scene.whole->dimension());
  rows.evaluate(t, q);
  const Eigen::SparseMatrix<double> one_forms =
      sparse_map(rows.pattern(), rows.coefficients().data()).transpose();
  of_kept_ = columns_at(one_forms, kept_);
  of_left_ = columns_at(one_forms, left_);
  size_ = Vector::Ones(of_kept_.cols());
  for (Eigen::Index k = 0; k < of_kept_.cols(); ++k)
    if (const double size = of_kept_.col(k).norm(); size > 0.0) {
      size_[k] = size;
      of_kept_.col(k) /= size;
    }
  products_ = of_kept_.transpose() * of_kept_;
  factors_.setShift(1e-14);  // at poses where rows that are kept depend on each other
  factors_.compute(products_);
}

Vector CombinedRows::times(const Vector& x) const {
  return of_left_.transpose() * (of_kept_ * solved(x.cwiseQuotient(size_)));
}

Vector CombinedRows::transposed_times(const Vector& y) const {
  return solved(of_kept_.transpose() * (of_left_ * y)).cwiseQuotient(size_);
}

Vector CombinedRows::solved(const Vector& right) const {
  Vector x = factors_.solve(right);
  for (int refinement = 0; refinement < 2; ++refinement) x += factors_.solve(right - products_ * x);
  return x;
}

/// Exact after as many iterations as D has rows, and one.
Vector CombinedRows::share_of_kept(const Vector& x) const {
  constexpr double round_off = 1e-15;
  Vector solution = Vector::Zero(x.size()), residual = x, direction = x;
  double squared = residual.squaredNorm();
  const double small = round_off * round_off * squared;
  const auto most = 3 * (std::ssize(left_) + 1);
  for (std::ptrdiff_t k = 0; k < most && squared > small; ++k) {
    const Vector product = direction + transposed_times(times(direction));
    const double length = squared / direction.dot(product);
    solution += length * direction;
    residual -= length * product;
    const double next = residual.squaredNorm();
    direction = residual + (next / squared) * direction;
    squared = next;
  }
  return solution;
}

Vector forces_of_whole(const Scene& scene, double t, const Vector& q, const Vector& lambda) {
  if (!scene.whole) return lambda;
  const CombinedRows rows(scene, t, q,
                          static_cast<std::size_t>(std::min<Eigen::Index>(lambda.size(), scene.rows())));
  const Vector own = rows.share_of_kept(lambda.head(std::ssize(rows.kept())));
  Vector forces(scene.whole->rows());
  forces(rows.kept()) = own;
  forces(rows.left()) = rows.times(own);
  return forces;
}

Vector forces_of_kept(const Scene& scene, double t, const Vector& q, const Vector& of_whole) {
  if (!scene.whole) return of_whole;
  const CombinedRows rows(scene, t, q, static_cast<std::size_t>(scene.rows()));
  return of_whole(rows.kept()) + rows.transposed_times(of_whole(rows.left()));
}

}  // namespace diracstep
