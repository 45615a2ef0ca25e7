#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/detail/differenced.hpp>

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

/// The unknowns that rows are solved for.
std::vector<int> pivots_of(const Columns& rows) {
  Eigen::ColPivHouseholderQR<Columns> qr(rows);
  const auto& order = qr.colsPermutation().indices();
  return {order.data(), order.data() + rows.rows()};
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
    const Columns by_w = differenced(of, w, z.size(), solving_difference, false);
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

}  // namespace

FirstOrderMotions levelled_motions(const Scene& scene) {
  const int n = scene.dimension(), unknowns = n + scene.rows();
  if (unknowns > most_with_levels) return {};
  std::array places{Place(scene, 0.8), Place(scene, 1.9)};
  LagrangianDerivatives l(*scene.lagrangian);
  l.take_second(*scene.lagrangian, places[0].t, places[0].q, places[0].v);
  const Columns mass = scene.lagrangian->pattern().full(l.vv);
  FirstOrderMotions motions;
  if (!mass.allFinite()) return {};
  divide_coordinates(mass, motions);
  if (motions.along.empty()) return {};
  KernelPoint point(scene, motions);
  point.evaluate(places[0].t, places[0].q, places[0].v, Vector::Zero(scene.rows()));
  motions.w = point.kernel();
  motions.u = Columns(Columns::Identity(n, n))(Eigen::all, motions.inert);
  if (!motions.w.allFinite() || max_norm(mass * motions.w) > 1e-9 * max_norm(mass) * max_norm(motions.w))
    return {};
  motions.affine = true;
  for (const Place& place : places) {
    LevelledEquations equations(scene, motions);
    motions.affine = motions.affine && affine_at(equations, place, equations.state(place.q, place.p));
  }
  for (std::size_t number = 0;; ++number) {
    LevelledEquations equations(scene, motions);
    ConstraintLevel level;
    for (const Place& place : places) {
      const bool first = &place == places.data();
      const auto of = [&](const Vector& w) {
        return equations.at(number, place.t, equations.state(place.q, place.p), w);
      };
      const Columns by_w = differenced(of, place.w, n, 1e-4, number > 0);
      if (!by_w.allFinite()) return {};
      const std::vector<int> kept =
          independent_rows(by_w, number > 0 ? motions.levels.back().kept : std::vector<int>());
      if (first) {
        level = {kept, others(kept, unknowns), pivots_of(by_w(kept, Eigen::all))};
      } else if (kept.size() != level.kept.size() ||
                 independent_rows(by_w(level.kept, level.by), {}).size() != kept.size()) {
        return {};
      }
    }
    if (level.left.empty()) return number > 0 ? motions : FirstOrderMotions{};
    if (number == most_levels) return {};
    for (Place& place : places)
      solve_kept(equations, number, level, place.t, equations.state(place.q, place.p), place.w);
    motions.levels.push_back(std::move(level));
  }
}

}  // namespace diracstep
