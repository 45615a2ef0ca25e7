#pragma once

#include <cstdint>

namespace diracstep {

/// A number in (0, 1) that depends on these three alone: the output function of SplitMix64 (Steele, Lea,
/// Flood 2014) on a counter, so that any member can be drawn without those before it.
double uniform_number(std::uint64_t seed, std::uint64_t member, std::uint64_t variable);

/// Dimensions of the sequence below.
inline constexpr int sobol_dimensions = 10;

/// Coordinate `dimension` of point `index`, below 2^32, of the Sobol sequence with the direction numbers of
/// Joe and Kuo (2008), file new-joe-kuo-6.21201: 32 bits.
std::uint32_t sobol_bits(std::uint64_t index, int dimension);

/// The same in (0, 1), its bits changed by those of a random number of the seed and the dimension: the points
/// stay as evenly spread, and none is 0.
double sobol_number(std::uint64_t seed, std::uint64_t index, int dimension);

/// x with Φ(x) = u, for u in (0, 1), to a few units of round-off.
double normal_quantile(double u);

}  // namespace diracstep
