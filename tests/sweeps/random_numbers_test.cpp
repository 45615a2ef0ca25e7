#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <diracstep/sweeps/random_numbers.hpp>
#include <set>
#include <utility>

namespace diracstep::testing {
namespace {

/// scipy.stats.qmc.Sobol(10, scramble=False, bits=32) of SciPy 1.10.1, times 2^32.
TEST(RandomNumbers, TheSobolSequenceIsThatOfJoeAndKuo) {
  const std::array<std::pair<std::uint64_t, std::array<std::uint32_t, sobol_dimensions>>, 4> points{
      {{5,
        {3758096384, 3758096384, 536870912, 1610612736, 3758096384, 2684354560, 3758096384, 1610612736,
         1610612736, 536870912}},
       {37,
        {3959422976, 2751463424, 2483027968, 3959422976, 3288334336, 1275068416, 738197504, 3422552064,
         2617245696, 738197504}},
       {1000,
        {943718400, 415236096, 2227175424, 2906652672, 1203765248, 3896508416, 197132288, 3862953984,
         2151677952, 297795584}},
       {1023,
        {4194304, 3233808384, 2629828608, 624951296, 801112064, 1883242496, 599785472, 2654994432, 1480589312,
         3653238784}}}};
  for (const auto& [index, point] : points)
    for (int d = 0; d < sobol_dimensions; ++d)
      EXPECT_EQ(sobol_bits(index, d), point[static_cast<std::size_t>(d)]) << index << ' ' << d;
}

/// Of 2^k points one lies in each of 2^k equal intervals; the shift keeps that.
TEST(RandomNumbers, AShiftedSobolSequenceFillsEveryInterval) {
  for (int d = 0; d < sobol_dimensions; ++d) {
    std::set<int> filled;
    for (std::uint64_t k = 0; k < 256; ++k) {
      const double u = sobol_number(7, k, d);
      EXPECT_GT(u, 0.0);
      EXPECT_LT(u, 1.0);
      filled.insert(static_cast<int>(256.0 * u));
    }
    EXPECT_EQ(filled.size(), 256u) << d;
  }
  EXPECT_NE(sobol_number(7, 0, 0), sobol_number(8, 0, 0));
}

/// scipy.stats.norm.ppf of SciPy 1.10.1.
TEST(RandomNumbers, QuantilesOfTheNormalLaw) {
  const std::array<std::pair<double, double>, 6> quantiles{{{1e-300, -37.0470962993612},
                                                            {1e-10, -6.361340902404056},
                                                            {0.025, -1.9599639845400545},
                                                            {0.3, -0.5244005127080409},
                                                            {0.5, 0.0},
                                                            {0.975, 1.959963984540054}}};
  for (const auto& [u, x] : quantiles) EXPECT_NEAR(normal_quantile(u), x, 4e-15 * std::abs(x)) << u;
}

/// Moments of the uniform law, within five standard deviations of their estimates; and no correlation between
/// neighbouring members, variables or seeds.
TEST(RandomNumbers, AreUniformAndIndependent) {
  constexpr int count = 100000;
  double mean = 0.0, square = 0.0, members = 0.0, variables = 0.0, seeds = 0.0;
  for (int k = 0; k < count; ++k) {
    const auto member = static_cast<std::uint64_t>(k);
    const double u = uniform_number(3, member, 0) - 0.5;
    mean += u / count;
    square += u * u / count;
    members += u * (uniform_number(3, member + 1, 0) - 0.5) / count;
    variables += u * (uniform_number(3, member, 1) - 0.5) / count;
    seeds += u * (uniform_number(4, member, 0) - 0.5) / count;
  }
  const double root = std::sqrt(count);
  EXPECT_NEAR(mean, 0.0, 5.0 * std::sqrt(1.0 / 12.0) / root);
  EXPECT_NEAR(square, 1.0 / 12.0, 5.0 * std::sqrt(1.0 / 180.0) / root);
  for (const double correlation : {members, variables, seeds})
    EXPECT_NEAR(correlation, 0.0, 5.0 / 12.0 / root);
}

}  // namespace
}  // namespace diracstep::testing
