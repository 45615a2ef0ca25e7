#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/detail/differenced.hpp>
#include <numeric>

namespace diracstep {

namespace {

constexpr std::size_t most_levels = 2;
constexpr double independent_by = 1e-6, solving_difference = 1e-6;

std::vector<int> others(const std::vector<int>& taken, int count) {
  std::vector<int> rest;
  for (int r = 0; r < count; ++r)
    if (std::ranges::find(taken, r) == taken.end()) rest.push_back(r);
  return rest;
}

/// Rows of a matrix, those of `first` before others, that are independent; in the order they were taken.
std::vector<int> independent_rows(Columns matrix, const std::vector<int>& first) {
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) matrix.row(r) /= size_or_one(matrix.row(r).norm());
  std::vector<int> taken;
  for (std::vector<int> group : {first, others(first, static_cast<int>(matrix.rows()))})
    while (!group.empty()) {
      const auto best = std::ranges::max_element(group, {}, [&](int r) { return matrix.row(r).norm(); });
      if (!(matrix.row(*best).norm() > independent_by)) break;
      const Vector along = matrix.row(*best).transpose().normalized();
      taken.push_back(*best);
      group.erase(best);
      matrix -= (matrix * along) * along.transpose();
    }
  return taken;
}

std::vector<int> first_numbers(int count) {
  std::vector<int> numbers(static_cast<std::size_t>(count));
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

/// A point near the start that shares no special position with it.
struct Place {
  Place(const Scene& scene, double phase) : t(scene.start.time + 0.37 * phase), q(scene.start.q) {
    const Start& start = scene.start;
    v = start.v;
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      const double wave = std::sin(phase + 1.7 * static_cast<double>(i));
      q[i] += 1e-2 * size_or_one(max_norm(start.q)) * wave;
      v[i] += 0.3 * size_or_one(max_norm(start.v)) * std::cos(phase + 2.3 * static_cast<double>(i));
    }
    w.resize(q.size() + scene.rows());
    w << v, Vector::LinSpaced(scene.rows(), 0.3 * phase, 0.5 + phase);
    p.resize(q.size());
    Vector lq(q.size());
    scene.lagrangian->gradient(t, q, v, lq, p);
  }

  double t;
  Vector q, v, p, w;
};

/// Moves w so that the kept equations of a level hold, the unknowns that none of them determines left alone.
void solve_kept(LevelledEquations& equations, std::size_t number, const ConstraintLevel& level, double t,
                const Vector& z, Vector& w) {
  for (int iteration = 0; iteration < 20; ++iteration) {
    const auto of = [&](const Vector& there) {
      return Vector(equations.at(number, t, z, there)(level.kept));
    };
    const Columns by_w = differenced(of, w, w.size(), solving_difference, false);
    const Vector change = Columns(by_w(Eigen::all, level.by)).partialPivLu().solve(of(w));
    w(level.by) -= change;
    if (!(max_norm(change) > 1e-14 * size_or_one(max_norm(w)))) return;
  }
}

bool affine_at(LevelledEquations& equations, const Place& place, const Vector& z) {
  for (Eigen::Index j = 0; j < place.w.size(); ++j) {
    const Vector step = size_or_one(max_norm(place.w)) * Vector::Unit(place.w.size(), j);
    Vector w = place.w;
    if (j + 1 < w.size()) w[j + 1] += 0.7 * step[j];
    const Vector behind = equations.at(0, place.t, z, w - step),
                 ahead = equations.at(0, place.t, z, w + step);
    const Vector bent = ahead + behind - 2.0 * equations.at(0, place.t, z, w);
    if (!(max_norm(bent) <= 1e-12 * size_or_one(std::max(max_norm(ahead), max_norm(behind))))) return false;
  }
  return true;
}

/// Kernel, `along`, `inert` and `affine` of a scene; none where ∂²L/∂v² is regular at a place, or cannot be
/// taken.
FirstOrderMotions without_levels(const Scene& scene, const std::array<Place, 2>& places) {
  const Place& at = places.front();
  LagrangianDerivatives l(*scene.lagrangian);
  l.take_second(*scene.lagrangian, at.t, at.q, at.v);
  const Columns mass = scene.lagrangian->pattern().full(l.vv);
  FirstOrderMotions motions;
  if (!mass.allFinite()) return {};
  divide_coordinates(mass, motions);
  if (motions.along.empty()) return {};
  KernelPoint point(scene, motions);
  point.evaluate(at.t, at.q, at.v, Vector::Zero(scene.rows()));
  const Columns& w = point.kernel();
  if (!w.allFinite() || max_norm(mass * w) > 1e-9 * max_norm(mass) * max_norm(w)) return {};
  motions.w = w;
  motions.u = Columns(Columns::Identity(w.rows(), w.rows()))(Eigen::all, motions.inert);
  LevelledEquations equations(scene, motions);
  motions.affine = std::ranges::all_of(places, [&](const Place& place) {
    return affine_at(equations, place, equations.state(place.q, place.p));
  });
  return motions;
}

/// Of the level after those of `motions`, the same at both places; nothing kept where it is not.  Equations
/// of motion are kept before rows of the scene, and solved for velocities before forces: so the choice stays
/// good along the motion.
ConstraintLevel next_level(const Scene& scene, const FirstOrderMotions& motions,
                           const std::array<Place, 2>& places) {
  const int n = scene.dimension(), unknowns = n + scene.rows();
  const std::size_t number = motions.levels.size();
  LevelledEquations equations(scene, motions);
  ConstraintLevel level;
  for (const Place& place : places) {
    const auto of = [&](const Vector& w) {
      return equations.at(number, place.t, equations.state(place.q, place.p), w);
    };
    const Columns by_w = differenced(of, place.w, n, 1e-4, number > 0);
    if (!by_w.allFinite()) return {};
    const std::vector<int> kept =
        independent_rows(by_w, number > 0 ? motions.levels.back().kept : first_numbers(n));
    if (&place == places.data()) {
      const Columns rows = by_w(kept, Eigen::all);
      level = {kept, others(kept, unknowns), independent_rows(rows.transpose(), first_numbers(n))};
    }
    const Columns solved = by_w(level.kept, level.by);
    if (kept.size() != level.kept.size() || level.by.size() != kept.size() ||
        independent_rows(solved, {}).size() != kept.size())
      return {};
  }
  return level;
}

}  // namespace

FirstOrderMotions levelled_motions(const Scene& scene) {
  if (scene.dimension() + scene.rows() > most_with_levels) return {};
  std::array places{Place(scene, 0.8), Place(scene, 1.9)};
  FirstOrderMotions motions = without_levels(scene, places);
  if (!motions.exist()) return {};
  for (std::size_t number = 0; number <= most_levels; ++number) {
    ConstraintLevel level = next_level(scene, motions, places);
    if (level.kept.empty()) return {};
    if (level.left.empty()) return number > 0 ? motions : FirstOrderMotions{};
    LevelledEquations equations(scene, motions);
    for (Place& place : places)
      solve_kept(equations, number, level, place.t, equations.state(place.q, place.p), place.w);
    motions.levels.push_back(std::move(level));
  }
  return {};
}

}  // namespace diracstep
