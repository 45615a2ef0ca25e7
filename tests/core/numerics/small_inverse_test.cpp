#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <diracstep/core/numerics/small_inverse.hpp>

namespace diracstep {
namespace {

template <int N>
void expect_solutions() {
  using Matrix = Eigen::Matrix<double, N, N>;
  Eigen::Matrix<double, N, 1> b;
  SmallInverse<N> inverse;
  for (int k = 0; k < 20; ++k) {
    Matrix matrix = Matrix::Random();
    if (k % 2 == 0) matrix(0, 0) = 0.0;  // rows have to be exchanged
    b.setRandom();
    const Eigen::Matrix<double, N, 1> expected = matrix.fullPivLu().solve(b);
    inverse.invert(matrix.data());
    inverse.solve(b.data());
    const double condition = matrix.norm() * matrix.inverse().norm();
    EXPECT_LT((b - expected).norm(), 1e-15 * N * condition * expected.norm()) << N;
  }
}

TEST(SmallInverse, SolvesWithRowExchanges) {
  expect_solutions<2>();
  expect_solutions<3>();
  expect_solutions<5>();
  expect_solutions<12>();
}

TEST(SmallInverse, OfASingularMatrixIsNoNumber) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Random();
  matrix.col(2) = matrix.col(0) - 2.0 * matrix.col(1);
  SmallInverse<3> inverse;
  inverse.invert(matrix.data());
  Eigen::Vector3d b = Eigen::Vector3d::Ones();
  inverse.solve(b.data());
  EXPECT_TRUE(std::isnan(b[0]));
  matrix.setIdentity();  // and nothing of it stays
  inverse.invert(matrix.data());
  b.setOnes();
  inverse.solve(b.data());
  EXPECT_EQ(b, Eigen::Vector3d::Ones());
}

}  // namespace
}  // namespace diracstep
