#include <Eigen/LU>
#include <Eigen/QR>
#include <diracstep/core/numerics/balance.hpp>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <limits>

namespace diracstep {

Columns kernel_basis(const Columns& matrix, double threshold) {
  if (matrix.size() == 0) return Columns::Identity(matrix.cols(), matrix.cols());
  Eigen::FullPivLU<Columns> lu;
  lu.setThreshold(threshold);
  lu.compute(matrix);
  return lu.dimensionOfKernel() == 0 ? Columns(matrix.cols(), 0) : Columns(lu.kernel());
}

Columns balanced_kernel_basis(Columns matrix, double threshold) {
  constexpr double round_off = 4.0 * std::numeric_limits<double>::epsilon();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    const double least = round_off * max_norm(matrix.row(r).transpose());
    matrix.row(r) = (matrix.row(r).array().abs() <= least).select(0.0, matrix.row(r));
  }
  const Balance by = balance(matrix);
  return by.columns.asDiagonal() * kernel_basis(matrix, threshold);
}

Columns orthonormal_kernel_basis(const Columns& matrix) {
  const Columns kernel = Eigen::FullPivLU<Columns>(matrix).kernel();
  return Eigen::HouseholderQR<Columns>(kernel).householderQ() *
         Columns::Identity(kernel.rows(), kernel.cols());
}

}  // namespace diracstep
