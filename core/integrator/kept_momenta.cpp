#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/kept_momenta.hpp>
#include <diracstep/core/spaces/space.hpp>

namespace diracstep {

namespace {

constexpr int points_looked_at = 3;
constexpr double turned_round_off = 1e-12;  // of a covector that was turned into space

/// Numbers near those of a start without a pattern, the same in every run.
Vector beside_start(const Vector& start, int point) {
  Vector there = start;
  for (Eigen::Index i = 0; i < there.size(); ++i)
    there[i] += (0.01 * std::abs(start[i]) + 0.02) * std::sin(1.0 + 2.3 * static_cast<double>(i) + point);
  return there;
}

/// The derivative of L or H, the force and the one-form of each row at a point, in turn.
template <class Visit>
void for_each_covector(const Scene& scene, const Vector& q, const Vector& y, Visit visit) {
  const double t = scene.start.time;
  Vector covector(scene.dimension()), other(scene.dimension());
  scene.stepped_function().gradient(t, q, y, covector, other);
  visit(covector);
  if (scene.force) {
    scene.force->value(t, q, y, covector);
    visit(covector);
  }
  for (const auto& rows : scene.constraints) {
    Vector a(rows->pattern().nonzeros()), b(rows->rows());
    rows->coefficients(t, q, a, b);
    covector.setZero();  // the sizes of all rows: what acts along a coordinate is all that is asked
    if (!scene.space) {
      rows->pattern().for_each([&](Eigen::Index e, int, int c) {
        if (a[e] != 0.0) covector[c] = a[e];  // NaN as well
      });
      visit(covector);
    } else {
      const Columns forms = rows->pattern().full(a);
      for (Eigen::Index r = 0; r < forms.rows(); ++r) visit(Vector(forms.row(r)));
    }
  }
}

/// Of a component of the Lie algebra; a turn of a sphere, which no coordinate stands for, follows its two.
std::string name_of(const Scene& scene, int component) {
  const std::vector<int>& tangent = scene.space->tangent();
  const auto found = std::ranges::find(tangent, component);
  if (found != tangent.end()) return scene.coordinates[static_cast<std::size_t>(found - tangent.begin())];
  if (component < 2) return "turn";
  return name_of(scene, component - 2) + " x " + name_of(scene, component - 1);
}

std::vector<std::string> kept_on_space(const Scene& scene) {
  const Space& space = *scene.space;
  const Eigen::Index d = space.group_dimension();
  std::vector<bool> acted_on(static_cast<std::size_t>(d), false);
  Columns adjoint(d, d), back(d, d), dtau(d, d), dtau_back(d, d);
  for (int k = 0; k < points_looked_at; ++k) {
    const Vector q = space.moved(scene.start.q, beside_start(Vector::Zero(d), k));
    const Vector x = space.difference(space.identity(), q);
    if (!x.allFinite()) return {};
    space.maps(x, adjoint, back, dtau, dtau_back);
    for_each_covector(scene, q, beside_start(scene.start.v, k), [&](const Vector& covector) {
      Vector column(d);
      space.embed(covector, column);
      const Vector in_space = back.transpose() * column;
      const double size = turned_round_off * in_space.lpNorm<Eigen::Infinity>();
      for (Eigen::Index i = 0; i < d; ++i)
        if (!(std::abs(in_space[i]) <= size)) acted_on[static_cast<std::size_t>(i)] = true;
    });
  }
  std::vector<std::string> names;
  for (int i = 0; i < d; ++i)
    if (!acted_on[static_cast<std::size_t>(i)]) names.push_back(name_of(scene, i));
  return names;
}

}  // namespace

std::vector<std::string> kept_momenta(const Scene& scene) {
  if (scene.space) return kept_on_space(scene);
  std::vector<bool> acted_on(scene.coordinates.size(), false);
  const Vector& y = scene.by_hamiltonian() ? scene.start.p : scene.start.v;
  if (y.size() != scene.dimension()) return {};
  for (int k = 0; k < points_looked_at; ++k)
    for_each_covector(scene, beside_start(scene.start.q, k), beside_start(y, k), [&](const Vector& covector) {
      for (std::size_t i = 0; i < acted_on.size(); ++i)
        if (covector[static_cast<Eigen::Index>(i)] != 0.0) acted_on[i] = true;
    });
  std::vector<std::string> names;
  for (std::size_t i = 0; i < acted_on.size(); ++i)
    if (!acted_on[i]) names.push_back(scene.coordinates[i]);
  return names;
}

}  // namespace diracstep
