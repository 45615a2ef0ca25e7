#include <array>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/gauss_rule.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <mutex>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

namespace {

using Extended = long double;
using Row = std::vector<Extended>;
using ExtendedColumns = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic>;

/// The ends and the zeros of P_s', moved to [0,1]; P_s'' from Legendre's equation.
Row lobatto_nodes(int s) {
  Row nodes{0.0L};
  for (int i = 1; i < s; ++i) {
    Extended x = -std::cos(std::numbers::pi_v<Extended> * i / s);
    for (int k = 0; k < 100; ++k) {
      const LegendrePoint p = legendre_polynomial(s, x);
      const Extended second = (2.0L * x * p.derivative - s * (s + 1) * p.value) / (1.0L - x * x),
                     change = p.derivative / second;
      x -= change;
      if (std::abs(change) < 1e-20L) break;
    }
    nodes.push_back((1.0L + x) / 2.0L);
  }
  nodes.push_back(1.0L);
  return nodes;
}

Extended basis(const Row& nodes, std::size_t j, Extended x) {
  Extended product = 1.0L;
  for (std::size_t k = 0; k < nodes.size(); ++k)
    if (k != j) product *= (x - nodes[k]) / (nodes[j] - nodes[k]);
  return product;
}

Row lobatto_weights(const Row& nodes) {
  const int s = static_cast<int>(nodes.size()) - 1;
  Row weights;
  for (const Extended c : nodes) {
    const Extended p = c == 0.0L || c == 1.0L ? 1.0L : legendre_polynomial(s, 2.0L * c - 1.0L).value;
    weights.push_back(1.0L / (s * (s + 1) * p * p));
  }
  return weights;
}

/// ∫_0^end of basis polynomial j, exact: the Gauss rule itself integrates it.
Extended integral(const Row& nodes, const Row& weights, std::size_t j, Extended end) {
  Extended sum = 0.0L;
  for (std::size_t k = 0; k < nodes.size(); ++k) sum += weights[k] * basis(nodes, j, end * nodes[k]);
  return end * sum;
}

ExtendedVector column(const Row& row) {
  return ExtendedVector::Map(row.data(), static_cast<Eigen::Index>(row.size()));
}

ExtendedGaussLobattoTableau computed_tableau(int s) {
  const GaussRule gauss = gauss_rule(s);
  const Row c(gauss.places.begin(), gauss.places.end()), b(gauss.weights.begin(), gauss.weights.end()),
      lc = lobatto_nodes(s), lb = lobatto_weights(lc);
  ExtendedGaussLobattoTableau t{gauss.places,
                                gauss.weights,
                                column(lc),
                                column(lb),
                                ExtendedColumns(s, s),
                                ExtendedColumns(s, s),
                                ExtendedColumns(s + 1, s),
                                ExtendedColumns(s, s + 1)};
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  for (int i = 0; i < s; ++i)
    for (int j = 0; j < s; ++j) {
      t.a(i, j) = integral(c, b, at(j), c[at(i)]);
      t.a_hat(i, j) = b[at(j)] * (1.0L - integral(c, b, at(i), c[at(j)]) / b[at(i)]);
    }
  for (int j = 0; j <= s; ++j)
    for (int i = 0; i < s; ++i) {
      const Extended to_node = integral(c, b, at(i), lc[at(j)]);
      t.lobatto_a(j, i) = to_node;
      t.e(i, j) = j == s ? 0.0L : lb[at(j)] * (1.0L - to_node / b[at(i)]);
    }
  return t;
}

constexpr int stages_kept = 20;

}  // namespace

/// Each is computed once in a program: a search for an error makes ten integrators.
const ExtendedGaussLobattoTableau& extended_gauss_lobatto_tableau(int s) {
  if (s < 1 || s > stages_kept)
    throw Misuse("GL(" + std::to_string(s) + "): the number of stages must be 1 to 20");
  static std::mutex one_at_a_time;  // glibc aborts where what std::call_once calls throws and memory is short
  static std::array<std::optional<ExtendedGaussLobattoTableau>, stages_kept> tableaux;
  const std::scoped_lock lock(one_at_a_time);
  auto& tableau = tableaux[static_cast<std::size_t>(s - 1)];
  if (!tableau) tableau = computed_tableau(s);
  return *tableau;
}

GaussLobattoTableau gauss_lobatto_tableau(int s) {
  const ExtendedGaussLobattoTableau& t = extended_gauss_lobatto_tableau(s);
  return {t.c.cast<double>(), t.b.cast<double>(),     t.lobatto_c.cast<double>(), t.lobatto_b.cast<double>(),
          t.a.cast<double>(), t.a_hat.cast<double>(), t.lobatto_a.cast<double>(), t.e.cast<double>()};
}

Columns lagrange_basis(const Vector& nodes, const Vector& points) {
  const Row row(nodes.begin(), nodes.end());
  Columns values(points.size(), nodes.size());
  for (Eigen::Index i = 0; i < points.size(); ++i)
    for (Eigen::Index j = 0; j < nodes.size(); ++j)
      values(i, j) = static_cast<double>(basis(row, static_cast<std::size_t>(j), points[i]));
  return values;
}

}  // namespace diracstep
