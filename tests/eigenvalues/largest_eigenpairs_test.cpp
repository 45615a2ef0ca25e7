#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/eigenvalues/largest_eigenpairs.hpp>
#include <numbers>

namespace diracstep {
namespace {

/// T x of the matrix with 1 below and −1 above the diagonal, whose eigenvalues are 2 i cos(kπ/(n + 1)).
void antisymmetric(ConstVectorRef x, VectorRef y) {
  const Eigen::Index last = x.size() - 1;
  y.setZero();
  y.tail(last) += x.head(last);
  y.head(last) -= x.tail(last);
}

TEST(LargestEigenpairs, AreThoseOfAKnownMatrix) {
  constexpr Eigen::Index n = 60, count = 6;
  Eigenpairs found;
  try {
    found = largest_eigenpairs(antisymmetric, Vector::LinSpaced(n, 1.0, 2.0), count);
  } catch (const Misuse& misuse) {
    if (std::string(misuse.what()).find("made without") == std::string::npos) throw;
    GTEST_SKIP() << "built without Spectra";
  }
  EXPECT_EQ(found.failure, "");
  ASSERT_EQ(found.values.size(), count);
  for (Eigen::Index k = 0; k < count; ++k) {  // each size twice, as ±
    const Eigen::Index pair = k / 2 + 1;
    const double size = 2.0 * std::cos(static_cast<double>(pair) * std::numbers::pi / (n + 1));
    EXPECT_NEAR(found.values[k].real(), 0.0, 1e-12);
    EXPECT_NEAR(std::abs(found.values[k].imag()), size, 1e-12);
    Vector real(n), imaginary(n);
    antisymmetric(found.vectors.col(k).real(), real);
    antisymmetric(found.vectors.col(k).imag(), imaginary);
    const Eigen::VectorXcd image = real + std::complex<double>(0.0, 1.0) * imaginary;
    EXPECT_LT((image - found.values[k] * found.vectors.col(k)).norm(), 1e-11);
  }
  EXPECT_NE(found.values[0].imag() > 0.0, found.values[1].imag() > 0.0);
}

}  // namespace
}  // namespace diracstep
