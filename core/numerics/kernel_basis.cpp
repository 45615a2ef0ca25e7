#include <Eigen/LU>
#include <Eigen/QR>
#include <diracstep/core/numerics/kernel_basis.hpp>

namespace diracstep {

Columns kernel_basis(const Columns& matrix, double threshold) {
  if (matrix.size() == 0) return Columns::Identity(matrix.cols(), matrix.cols());
  Eigen::FullPivLU<Columns> lu;
  lu.setThreshold(threshold);
  lu.compute(matrix);
  return lu.dimensionOfKernel() == 0 ? Columns(matrix.cols(), 0) : Columns(lu.kernel());
}

Columns orthonormal_kernel_basis(const Columns& matrix) {
  const Columns kernel = Eigen::FullPivLU<Columns>(matrix).kernel();
  return Eigen::HouseholderQR<Columns>(kernel).householderQ() *
         Columns::Identity(kernel.rows(), kernel.cols());
}

}  // namespace diracstep
