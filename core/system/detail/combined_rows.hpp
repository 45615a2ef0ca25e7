#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <diracstep/core/system/scene.hpp>
#include <vector>

namespace diracstep {

/// The one-forms of the rows that were left out of a scene with Scene::whole as combinations of those of its
/// own, A_d = D A_k at a point: products with D and Dᵀ by the factors of A_k A_kᵀ, of rows of size 1 since
/// rows come in any units.  The first `known` rows of the scene count.
class CombinedRows {
 public:
  CombinedRows(const Scene& scene, double t, const Vector& q, std::size_t known);

  const std::vector<int>& kept() const { return kept_; }  ///< numbers among all rows
  const std::vector<int>& left() const { return left_; }

  /// D x.
  Vector times(const Vector& x) const;
  /// Dᵀ y.
  Vector transposed_times(const Vector& y) const;
  /// (1 + DᵀD)⁻¹ x, by conjugate gradients.
  Vector share_of_kept(const Vector& x) const;

 private:
  Vector solved(const Vector& right) const;

  std::vector<int> kept_, left_;
  Eigen::SparseMatrix<double> of_kept_, of_left_;  ///< with a row in each column
  Vector size_;
  Eigen::SparseMatrix<double> products_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
};

}  // namespace diracstep
