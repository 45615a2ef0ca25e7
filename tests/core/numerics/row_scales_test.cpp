#include <gtest/gtest.h>

#include <diracstep/core/numerics/row_scales.hpp>

namespace diracstep {
namespace {

constexpr double level = 1e-15;

TEST(RowScales, ARowSharesTheScaleOfItsBlockUnlessItsTermsAreFarSmaller) {
  RowScales scales(3);
  scales.set(0, Vector{{1.0, 1e-2, 1e-6}}, Vector::Zero(3), 1.0);
  EXPECT_EQ(scales.unsolved(Vector{{1e-15, 1e-15, 1e-18}}, level), nullptr);
  const double* const found = scales.unsolved(Vector{{0.0, 0.0, 2e-18}}, level);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found[0], 1.0);
  EXPECT_EQ(found[1], 1.0);
  EXPECT_EQ(found[2], RowScales::margin * 1e-6);
}

TEST(RowScales, OtherCoordinatesAndTolerancesSetABoundBelow) {
  RowScales scales(2);
  Vector largest(2);
  RowScales::set_largest(largest, 1e-4, Vector{{0.0, 1e-22}}, level);
  scales.set(0, Vector{{1e-12, 1e-12}}, largest, 1.0);
  const double* const found = scales.unsolved(Vector{{1e-18, 1e-18}}, level);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found[0], 1e-4);
  EXPECT_DOUBLE_EQ(found[1], 1e-7);
}

TEST(RowScales, ARowWithoutTermsMustVanishAndWhatIsNoNumberDoesNotCount) {
  RowScales scales(2);
  scales.set(0, Vector{{0.0, std::nan("")}}, Vector::Zero(2), 1.0);
  EXPECT_EQ(scales.unsolved(Vector{{0.0, 1e-15}}, level), nullptr);
  EXPECT_NE(scales.unsolved(Vector{{1e-40, 0.0}}, level), nullptr);
}

TEST(RowScales, RowsAreSmallBesideATermTheyHold) {
  const Vector terms{{1.0, -1e-9}};
  EXPECT_TRUE(RowScales::solved(Vector{{1e-13, 1e-22}}.data(), terms.data(), 2, level));
  EXPECT_FALSE(RowScales::solved(Vector{{1e-13, 1e-20}}.data(), terms.data(), 2, level));
}

}  // namespace
}  // namespace diracstep
