#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/sparsity_pattern.hpp>

#include "differences.hpp"

namespace diracstep {
namespace {

using testing::full;

const SparsityPattern wide(2, 3, {{1, 2}, {0, 0}, {1, 0}, {0, 0}});

Vector values(const SparsityPattern& pattern) {
  return Vector::LinSpaced(pattern.nonzeros(), 1.0, static_cast<double>(pattern.nonzeros()));
}

TEST(SparsityPattern, KeepsSortedUniqueEntries) {
  EXPECT_EQ(wide.nonzeros(), 3);
  EXPECT_EQ(wide.position(0, 0), 0);
  EXPECT_EQ(wide.position(1, 0), 1);
  EXPECT_EQ(wide.position(1, 2), 2);
  EXPECT_EQ(wide.position(0, 2), -1);
  EXPECT_FALSE(wide.is_dense());
  EXPECT_TRUE(SparsityPattern::dense(2, 3).is_dense());
  EXPECT_THROW(SparsityPattern(2, 2, {{2, 0}}), Misuse);
}

TEST(SparsityPattern, ProductsWithVectorsAreThoseOfTheFullMatrix) {
  const Vector m = values(wide), x = Vector::LinSpaced(3, 1.0, 2.0), z = Vector::LinSpaced(2, -1.0, 3.0);
  Vector y = Vector::Ones(2), w = Vector::Ones(3);
  wide.multiply_add(m.data(), x.data(), y.data(), 2.0);
  wide.transposed_multiply_add(m.data(), z.data(), w.data(), -1.0);
  EXPECT_TRUE(y.isApprox(Vector(Vector::Ones(2) + 2.0 * full(wide, m) * x)));
  EXPECT_TRUE(w.isApprox(Vector(Vector::Ones(3) - full(wide, m).transpose() * z)));
}

TEST(SparsityPattern, TransposedPositionsNeedASymmetricPattern) {
  EXPECT_THROW((void)SparsityPattern(2, 2, {{0, 1}}).transposed_positions(), Misuse);
  const SparsityPattern symmetric(2, 2, {{0, 1}, {1, 0}, {1, 1}});
  EXPECT_EQ(symmetric.transposed_positions(), (std::vector<int>{1, 0, 2}));
}

TEST(PatternProduct, IsTheProductOfTheFullMatricesInEveryTransposition) {
  const SparsityPattern a(2, 3, {{0, 0}, {1, 1}, {1, 2}}), b(3, 2, {{0, 1}, {1, 0}, {2, 1}});
  const Eigen::MatrixXd ma = full(a, values(a)), mb = full(b, values(b));
  const auto check = [&](const SparsityPattern& left, bool tl, const SparsityPattern& right, bool tr,
                         const Eigen::MatrixXd& expected) {
    const PatternProduct product(left, tl, right, tr);
    Vector c(product.pattern().nonzeros());
    product.multiply(values(left).data(), values(right).data(), c.data());
    EXPECT_TRUE(full(product.pattern(), c).isApprox(expected));
  };
  check(a, false, b, false, ma * mb);
  check(a, true, b, true, ma.transpose() * mb.transpose());
  check(a, false, a, true, ma * ma.transpose());
  check(b, true, b, false, mb.transpose() * mb);
}

TEST(BlockPattern, PutsBlocksInTheirPlaces) {
  for (const bool dense : {false, true}) {
    BlockPattern layout(5, 5);
    const int upper = layout.add(wide, 0, 2), lower = layout.add(wide, 2, 0, true);
    const SparsityPattern whole = layout.assemble(dense);
    Vector all = Vector::Zero(whole.nonzeros());
    const Vector m = values(wide);
    for (Eigen::Index k = 0; k < m.size(); ++k) {
      all[layout.positions(upper)[static_cast<std::size_t>(k)]] += m[k];
      all[layout.positions(lower)[static_cast<std::size_t>(k)]] += m[k];
    }
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(5, 5);
    expected.block(0, 2, 2, 3) = full(wide, m);
    expected.block(2, 0, 3, 2) = full(wide, m).transpose();
    EXPECT_TRUE(full(whole, all).isApprox(expected));
    EXPECT_EQ(whole.is_dense(), dense);
  }
}

}  // namespace
}  // namespace diracstep
