#include <gtest/gtest.h>

#include <diracstep/core/numerics/kernel_basis.hpp>

namespace diracstep {
namespace {

/// Two inductors of coupling k beside a diode of 1e-12 A/V that blocks: pivots of the matrix as it is go down
/// to 1e-12 (1 - k²).
TEST(KernelBasis, UnitsOfRowsAndColumnsDecideNothing) {
  const double k = 0.9999, slope = 1e-12;
  Columns matrix(3, 3);
  matrix << 5e-5, 2.5e-5 * k, 0, 2.5e-5 * k, 1.25e-5, 1, 0, -1, slope;
  Columns regular = matrix;
  regular.col(2) *= 1e-3;
  EXPECT_EQ(balanced_kernel_basis(regular, 1e-13).cols(), 0);
  regular.row(1) *= 1e9;
  EXPECT_EQ(balanced_kernel_basis(regular, 1e-13).cols(), 0);
}

TEST(KernelBasis, AKernelIsFoundInTheUnitsOfTheMatrix) {
  Columns matrix(2, 3);
  matrix << 1e-9, 2e3, 0, 1e-9, 2e3, 1e5;
  const Columns kernel = balanced_kernel_basis(matrix, 1e-13);
  ASSERT_EQ(kernel.cols(), 1);
  const Vector x = kernel.col(0) / kernel(0, 0);
  EXPECT_NEAR(x[1] / -5e-13, 1.0, 1e-14);
  EXPECT_NEAR(x[2], 0.0, 1e-25);
}

TEST(KernelBasis, RoundOffOfARowIsNoEntry) {
  Columns matrix(2, 2);
  matrix << 1, 1e-17, 3, -2e-17;
  EXPECT_EQ(balanced_kernel_basis(matrix, 1e-13).cols(), 1);
}

}  // namespace
}  // namespace diracstep
