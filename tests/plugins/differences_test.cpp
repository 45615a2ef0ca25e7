#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/plugins/differences.hpp>

/// Derivatives by differences follow the scales of the variables.
namespace diracstep::testing {
namespace {

/// A spring of rest length l in the plane, its Lagrangian alone: the derivatives hold for any l.
TEST(Differences, FollowTheSizeOfTheCoordinates) {
  for (const double l : {1.0, 1e-3, 1e-9, 1e6}) {
    const auto f = [l](ConstVectorRef x) {
      const double r = std::hypot(x[0], x[1]);
      return -50.0 * (r - l) * (r - l);
    };
    const Vector x{{1.1 * l, 0.3 * l}};
    const DifferenceScales scales = find_scales(f, x, Vector{{l, l}});
    Vector g(2);
    DifferenceQuality quality;
    gradient_by_differences(f, x, g, scales, &quality);
    const double r = std::hypot(x[0], x[1]);
    for (int i = 0; i < 2; ++i) EXPECT_NEAR(g[i], -100.0 * (r - l) * x[i] / r, 1e-9 * 100.0 * l) << l;
    EXPECT_EQ(quality.doubt(), "");
  }
}

TEST(Differences, ScalesAreFoundFromGuessesThatAreFarOff) {
  const auto f = [](ConstVectorRef x) { return std::cos(1e4 * x[0]); };
  const Vector x{{3e-5}};
  for (const double guess : {1.0, 1e-9}) {
    const DifferenceScales scales = find_scales(f, x, Vector{{guess}});
    Vector g(1);
    gradient_by_differences(f, x, g, scales);
    EXPECT_NEAR(g[0], -1e4 * std::sin(0.3), 1e-6) << guess;
  }
}

TEST(Differences, AConstantAndAStraightLineAskForNoLargerScale) {
  const auto f = [](ConstVectorRef x) { return 0.7 * x[0] + 2.5 + 0.0 * x[1]; };
  const DifferenceScales scales = find_scales(f, Vector{{0.3, 0.2}}, Vector{{1.0, 0.4}});
  EXPECT_EQ(scales[0], 1.0);
  EXPECT_EQ(scales[1], 0.4);
}

TEST(Differences, AParabolaThatIsZeroAtThePointAsksForNoSmallerScale) {
  const auto f = [](ConstVectorRef v) { return 0.5 * v[0] * v[0]; };
  EXPECT_GE(find_scales(f, Vector{{0.0}}, Vector{{1.5}})[0], 1.5);
}

TEST(Differences, AngleOfManyTurnsIsNoScale) {
  const auto f = [](ConstVectorRef x) { return std::cos(x[0]); };
  Vector g(1);
  gradient_by_differences(f, Vector{{1e4}}, g, Vector{{1.0}});
  EXPECT_NEAR(g[0], -std::sin(1e4), 1e-9);
}

TEST(Differences, AreDoubtedWhereRoundOffLeavesNothing) {
  const auto f = [](ConstVectorRef x) { return 1e12 + 1e-3 * std::sin(x[0]); };
  Vector g(1);
  DifferenceQuality quality;
  gradient_by_differences(f, Vector{{0.3}}, g, Vector{{1.0}}, &quality);
  EXPECT_NE(quality.doubt().find("differences"), std::string::npos);
}

}  // namespace
}  // namespace diracstep::testing
