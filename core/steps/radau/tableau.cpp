#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/steps/radau/tableau.hpp>
#include <string>
#include <vector>

namespace diracstep {

namespace {

using Extended = long double;

/// P_s − P_{s−1}.
Extended radau_polynomial(int s, Extended x) {
  Extended before = 1.0L, value = x;
  for (int k = 2; k <= s; ++k) {
    const Extended next = ((2 * k - 1) * x * value - (k - 1) * before) / k;
    before = value;
    value = next;
  }
  return value - before;
}

/// The zeros below 1 are simple and far apart for so few stages: each shows as a change of sign on a grid.
std::vector<Extended> radau_nodes(int s) {
  constexpr int cells = 1000;
  std::vector<Extended> nodes;
  for (int i = 0; i < cells - 1; ++i) {
    Extended low = -1.0L + 2.0L * i / cells, high = -1.0L + 2.0L * (i + 1) / cells;
    const bool rising = radau_polynomial(s, low) < 0.0L;
    if (rising == (radau_polynomial(s, high) < 0.0L)) continue;
    for (int k = 0; k < 100; ++k) {
      const Extended middle = (low + high) / 2.0L;
      (rising == (radau_polynomial(s, middle) < 0.0L) ? low : high) = middle;
    }
    nodes.push_back((1.0L + low) / 2.0L);
  }
  nodes.push_back(1.0L);
  return nodes;
}

Extended radau_basis(const std::vector<Extended>& nodes, std::size_t j, Extended x) {
  Extended product = 1.0L;
  for (std::size_t k = 0; k < nodes.size(); ++k)
    if (k != j) product *= (x - nodes[k]) / (nodes[j] - nodes[k]);
  return product;
}

}  // namespace

RadauTableau radau_tableau(int s) {
  if (s < 1 || s > most_radau_stages)
    throw Misuse("damped/radau:" + std::to_string(s) + ": the number of stages must be 1 to " +
                 std::to_string(most_radau_stages));
  const std::vector<Extended> nodes = radau_nodes(s);
  const ExtendedGaussLobattoTableau& gauss = extended_gauss_lobatto_tableau(s);
  RadauTableau table{Vector(s), Columns(s, s)};
  for (int i = 0; i < s; ++i) {
    const Extended end = nodes[static_cast<std::size_t>(i)];
    table.c[i] = static_cast<double>(end);
    for (int j = 0; j < s; ++j) {
      Extended sum = 0.0L;  // exact: the basis is of degree s − 1
      for (int k = 0; k < s; ++k)
        sum += gauss.b[k] * radau_basis(nodes, static_cast<std::size_t>(j), end * gauss.c[k]);
      table.a(i, j) = static_cast<double>(end * sum);
    }
  }
  return table;
}

}  // namespace diracstep
