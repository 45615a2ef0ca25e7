#include <array>
#include <cmath>
#include <diracstep/sweeps/random_numbers.hpp>
#include <limits>
#include <numbers>

namespace diracstep {

namespace {

std::uint64_t mixed(std::uint64_t z) {
  z += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

std::uint64_t random_bits(std::uint64_t seed, std::uint64_t member, std::uint64_t variable) {
  return mixed(mixed(mixed(seed) ^ member) ^ variable);
}

/// A primitive polynomial x^s + a_1 x^(s-1) + … + 1, its inner coefficients as bits, and m_1 … m_s.
struct Polynomial {
  unsigned degree, coefficients;
  std::array<std::uint32_t, 5> m;
};
constexpr std::array<Polynomial, sobol_dimensions - 1> polynomials{{{1, 0, {1}},
                                                                    {2, 1, {1, 3}},
                                                                    {3, 1, {1, 3, 1}},
                                                                    {3, 2, {1, 1, 1}},
                                                                    {4, 1, {1, 1, 3, 3}},
                                                                    {4, 4, {1, 3, 5, 13}},
                                                                    {5, 2, {1, 1, 5, 5, 17}},
                                                                    {5, 4, {1, 1, 5, 5, 5}},
                                                                    {5, 7, {1, 1, 7, 11, 19}}}};

using SobolDirections = std::array<std::uint32_t, 32>;

SobolDirections directions(int dimension) {
  SobolDirections v{};
  if (dimension == 0) {
    for (unsigned k = 0; k < 32; ++k) v[k] = 1u << (31 - k);
    return v;
  }
  const Polynomial& p = polynomials[static_cast<std::size_t>(dimension) - 1];
  for (unsigned k = 0; k < 32; ++k) {
    if (k < p.degree) {
      v[k] = p.m[k] << (31 - k);
      continue;
    }
    v[k] = v[k - p.degree] ^ (v[k - p.degree] >> p.degree);
    for (unsigned j = 1; j < p.degree; ++j)
      if (((p.coefficients >> (p.degree - 1 - j)) & 1u) != 0) v[k] ^= v[k - j];
  }
  return v;
}

const std::array<SobolDirections, sobol_dimensions>& all_directions() {
  static const auto all = [] {
    std::array<SobolDirections, sobol_dimensions> made{};
    for (int d = 0; d < sobol_dimensions; ++d) made[static_cast<std::size_t>(d)] = directions(d);
    return made;
  }();
  return all;
}

}  // namespace

double uniform_number(std::uint64_t seed, std::uint64_t member, std::uint64_t variable) {
  return (static_cast<double>(random_bits(seed, member, variable) >> 12) + 0.5) * 0x1p-52;
}

std::uint32_t sobol_bits(std::uint64_t index, int dimension) {
  const SobolDirections& v = all_directions()[static_cast<std::size_t>(dimension)];
  std::uint64_t gray = index ^ (index >> 1);
  std::uint32_t bits = 0;
  for (std::size_t k = 0; gray != 0 && k < v.size(); ++k, gray >>= 1)
    if ((gray & 1u) != 0) bits ^= v[k];
  return bits;
}

double sobol_number(std::uint64_t seed, std::uint64_t index, int dimension) {
  const auto shift = static_cast<std::uint32_t>(random_bits(seed, 0, static_cast<std::uint64_t>(dimension)));
  return (static_cast<double>(sobol_bits(index, dimension) ^ shift) + 0.5) * 0x1p-32;
}

double normal_quantile(double u) {
  if (u > 0.5) return -normal_quantile(1.0 - u);
  // Φ is convex here, so that Newton's iterates fall towards the root from the right.
  double x = 0.0;
  for (int i = 0; i < 2000; ++i) {  // x²/2 of them lead to where Newton's method is fast
    const double value = 0.5 * std::erfc(-x / std::numbers::sqrt2) - u;
    const double slope = std::exp(-0.5 * x * x) / std::sqrt(2.0 * std::numbers::pi);
    const double change = value / slope;
    x -= change;
    if (std::abs(change) <= 4.0 * std::numeric_limits<double>::epsilon() * std::abs(x)) break;
  }
  return x;
}

}  // namespace diracstep
