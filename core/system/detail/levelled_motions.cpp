#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <numeric>

namespace diracstep {

namespace {

constexpr double independent_by = 1e-7, least_row = 1e-2;

std::vector<int> numbers(int first, int count) {
  std::vector<int> all(static_cast<std::size_t>(count));
  std::iota(all.begin(), all.end(), first);
  return all;
}

/// Rows of a matrix that are independent, those of earlier groups before others.  Small rows count by their
/// size beside the largest: they may be round-off.
std::vector<int> independent_rows(Columns matrix, const std::vector<std::vector<int>>& groups) {
  const double least = matrix.rows() > 0 ? least_row * matrix.rowwise().norm().maxCoeff() : 0.0;
  for (Eigen::Index r = 0; r < matrix.rows(); ++r)
    matrix.row(r) /= size_or_one(std::max(matrix.row(r).norm(), least));
  std::vector<int> taken;
  for (std::vector<int> group : groups)
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
    p.resize(q.size());
    Vector lq(q.size());
    scene.lagrangian->gradient(t, q, v, lq, p);
  }

  double t;
  Vector q, v, p;
  Vector z = {}, w = {};
};

/// Kernel, `along` and `inert` of a scene; none where ∂²L/∂v² is regular at a place, or cannot be taken.
FirstOrderMotions without_levels(const Scene& scene, const Place& at) {
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
  return motions;
}

/// Sizes of the rows of an array by what their derivatives are, where this is more than round-off of terms.
Vector row_sizes(const EquationArray& array, const Place& place) {
  constexpr double part_of_terms = 1e-6;
  const double size = size_or_one(std::max(max_norm(place.z), max_norm(place.w)));
  Vector sizes = part_of_terms / size * array.round_off();
  for (Eigen::Index r = 0; r < sizes.size(); ++r)
    sizes[r] = size_or_one(
        std::max(sizes[r], std::hypot(array.by_state().row(r).norm(), array.by_unknowns().row(r).norm())));
  return sizes;
}

Columns scaled_by_unknowns(const EquationArray& array, const Place& place) {
  return row_sizes(array, place).cwiseInverse().asDiagonal() * array.by_unknowns();
}

/// Moves a place, z and W of it, to a solution of all equations of an array by Gauss-Newton steps, the least
/// ones.  Gives the number of the row that is off most where there is none near it, -1 where there is.
int moved_onto(const Scene& scene, EquationArray& array, Place& place) {
  const ConstraintBlocks holonomic = only_holonomic(scene.constraints);
  ConstraintsAtPoint forms(holonomic, scene.dimension());
  const int rows = array.rows(), states = array.states(), n = scene.dimension();
  int worst = 0;
  for (int iteration = 0; iteration < 60; ++iteration) {
    array.evaluate(place.t, place.z, place.w, true);
    Columns by = Columns::Zero(rows + forms.rows(), states + array.unknowns());
    by.topRows(rows) << array.by_state(), array.by_unknowns();
    Vector off(by.rows());
    off.head(rows) = array.values();
    forms.evaluate(place.t, place.z.head(n));
    by.bottomLeftCorner(forms.rows(), n) = forms.pattern().full(forms.coefficients());
    Eigen::Index row = rows;
    for (const auto& block : holonomic) {
      block->position(place.t, place.z.head(n), off.segment(row, block->rows()));
      row += block->rows();
    }
    if (!off.allFinite() || !by.allFinite()) return 0;
    const Vector sizes = row_sizes(array, place);
    for (Eigen::Index r = 0; r < by.rows(); ++r) {
      const double size = r < rows ? sizes[r] : size_or_one(by.row(r).norm());
      by.row(r) /= size;
      off[r] /= size;
    }
    Eigen::CompleteOrthogonalDecomposition<Columns> solver;
    solver.setThreshold(1e-9);
    solver.compute(by);
    const Vector change = solver.solve(off);
    place.z -= change.head(states);
    place.w -= change.tail(array.unknowns());
    const Vector rest = off - by * change;
    const double size = size_or_one(std::max(max_norm(place.z), max_norm(place.w)));
    rest.cwiseAbs().maxCoeff(&worst);
    if (max_norm(change) <= 1e-11 * size || (iteration > 2 && max_norm(off) <= 1e-9 * size))
      return max_norm(rest) <= 1e-8 * size ? -1 : std::min(worst, rows - 1);
  }
  return worst;
}

/// Groups of rows of an array, in the order that they are kept in: of low order before others, equations of
/// motion before rows of the scene, so that the choice stays good along the motion.
std::vector<std::vector<int>> groups_of(const EquationArray& array, int n, int m) {
  std::vector<std::vector<int>> groups;
  for (int k = 0; k <= array.orders(); ++k) {
    std::vector<int> motion = numbers(array.place_of_motion(k), n);
    if (k == 0)
      for (const int r : numbers(0, array.inert_count())) motion.push_back(r);
    groups.push_back(std::move(motion));
    groups.push_back(numbers(array.place_of_row(k), m));
  }
  return groups;
}

/// `kept` and `by` at a place; `open` are the directions of (v_0, Λ_0) that stay open.
ConstraintLevels levels_at(const EquationArray& array, const Place& place, int n, int m, Columns& open) {
  const int leading = n + m;
  ConstraintLevels levels;
  levels.count = array.orders();
  const Columns all = scaled_by_unknowns(array, place);
  levels.kept = independent_rows(all, groups_of(array, n, m));
  std::ranges::sort(levels.kept);
  const Columns rows = all(levels.kept, Eigen::all);
  const Columns others = rows.rightCols(rows.cols() - leading);
  std::vector<int> beside =
      independent_rows(others.transpose(), {numbers(0, static_cast<int>(others.cols()))});
  open.resize(leading, 0);
  if (std::ssize(levels.kept) != std::ssize(beside) + leading) {
    // Of what the others cannot make up for.
    Columns left = rows.leftCols(leading);
    const Columns basis = Eigen::HouseholderQR<Columns>(Columns(others(Eigen::all, beside))).householderQ() *
                          Columns::Identity(others.rows(), std::ssize(beside));
    left -= basis * (basis.transpose() * left);
    open = kernel_basis(left, independent_by);
  }
  levels.by = numbers(0, leading);
  std::ranges::sort(beside);
  for (const int c : beside) levels.by.push_back(leading + c);
  return levels;
}

/// Of the rows that are not kept, those that together with holonomic rows say something of the state.
std::vector<int> constraints_at(const Scene& scene, const FirstOrderMotions& motions, const Place& place) {
  LevelledEquations equations(scene, motions);
  LevelledPoint at;
  if (!equations.begin(place.t, place.z, place.w.head(scene.dimension()), at)) return {};
  equations.differentiate(place.t, place.z, at);
  const int holonomic = row_count(only_holonomic(scene.constraints));
  const auto count = static_cast<int>(motions.levels.left.size());
  std::vector<int> left;
  for (const int r :
       independent_rows(at.constraints_by_state, {numbers(0, holonomic), numbers(holonomic, count)}))
    if (r >= holonomic) left.push_back(motions.levels.left[static_cast<std::size_t>(r - holonomic)]);
  std::ranges::sort(left);
  return left;
}

bool regular_at(const EquationArray& array, const Place& place, int n, int m,
                const ConstraintLevels& levels) {
  Columns open;
  const ConstraintLevels here = levels_at(array, place, n, m, open);
  if (open.cols() > 0 || here.kept.size() != levels.kept.size()) return false;
  const Columns solved = scaled_by_unknowns(array, place)(levels.kept, levels.by);
  return independent_rows(solved, {numbers(0, static_cast<int>(solved.rows()))}).size() == levels.kept.size();
}

}  // namespace

FirstOrderMotions levelled_motions(const Scene& scene) {
  const int n = scene.dimension(), m = scene.rows();
  if (n + m > most_with_levels) return {};
  std::array places{Place(scene, 0.8), Place(scene, 1.9)};
  FirstOrderMotions motions = without_levels(scene, places.front());
  if (!motions.exist()) return {};
  for (int count = 0; count <= most_levels; ++count) {
    std::vector<ConstraintLevels> found;
    for (Place& place : places) {
      EquationArray array(scene, motions.inert, count);
      place.z.resize(array.states());
      place.z << place.q, Vector(place.p(motions.inert));
      place.w.setZero(array.unknowns());
      place.w.head(n) = place.v;
      array.choose_reach(place.t, place.z, place.w);
      if (const int off = moved_onto(scene, array, place); off >= 0) {
        motions.contradiction = name_of_equation(scene, motions.inert, off);
        return motions;
      }
      array.evaluate(place.t, place.z, place.w, true);
      if (found.empty()) {
        found.push_back(levels_at(array, place, n, m, motions.open));
        if (motions.open.cols() > 0) break;
      } else if (!regular_at(array, place, n, m, found.front())) {
        return {};
      }
    }
    if (motions.open.cols() > 0) continue;
    if (count == 0) return {};
    motions.levels = found.front();
    const int rows = static_cast<int>(motions.inert.size()) + (n + m) * (count + 1);
    for (const int r : numbers(0, rows))
      if (!std::ranges::binary_search(motions.levels.kept, r)) motions.levels.left.push_back(r);
    motions.levels.left = constraints_at(scene, motions, places.front());
    return motions;
  }
  return motions;
}

}  // namespace diracstep
