#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/scene_format/fields/field_elements.hpp>

namespace diracstep::scene_compiler {

namespace {

/// Derivatives at `points` of the polynomials that are 1 at one of `nodes` and 0 at the others.
Columns lagrange_slopes(const Vector& nodes, const Vector& points) {
  Columns slopes = Columns::Zero(points.size(), nodes.size());
  for (Eigen::Index k = 0; k < points.size(); ++k)
    for (Eigen::Index j = 0; j < nodes.size(); ++j)
      for (Eigen::Index left_out = 0; left_out < nodes.size(); ++left_out) {
        if (left_out == j) continue;
        double product = 1.0 / (nodes[j] - nodes[left_out]);
        for (Eigen::Index m = 0; m < nodes.size(); ++m)
          if (m != j && m != left_out) product *= (points[k] - nodes[m]) / (nodes[j] - nodes[m]);
        slopes(k, j) += product;
      }
  return slopes;
}

}  // namespace

FieldElement field_element(const std::string& name) {
  const bool gauss = name.starts_with("gauss:"), lobatto = name.starts_with("lobatto:");
  const char digit = name.empty() ? '0' : name.back();
  if (!(gauss || lobatto) || name.size() != (gauss ? 7 : 9) || digit < '1' || digit > '8')
    throw Misuse("'" + name + "': expected \"gauss:S\" or \"lobatto:S\", S = 1 … 8");
  FieldElement element{gauss, digit - '0', {}, {}, {}, {}, {}};
  const GaussLobattoTableau tableau = gauss_lobatto_tableau(element.degree);
  element.nodes = tableau.lobatto_c;
  element.points = gauss ? tableau.c : tableau.lobatto_c;
  element.weights = gauss ? tableau.b : tableau.lobatto_b;
  element.values = lagrange_basis(element.nodes, element.points);
  element.slopes = lagrange_slopes(element.nodes, element.points);
  return element;
}

}  // namespace diracstep::scene_compiler
