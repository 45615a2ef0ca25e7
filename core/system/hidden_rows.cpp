#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/fewer_entries.hpp>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>
#include <diracstep/core/system/multiplier_rows.hpp>
#include <diracstep/core/system/rows_along_motions.hpp>
#include <limits>
#include <memory>
#include <string>
#include <utility>

namespace diracstep {

namespace {

constexpr int largest_full_matrix = 1500;
constexpr int several = 10;               // motions: from there on the rows along them are to be sparse
constexpr double zero_tolerance = 1e-12;  // of an entry, in relation to the terms of its row

/// What round-off leaves of a zero pivot, in relation to the largest: a mass ratio of 1e-13 is no degeneracy.
double rank_tolerance(const Columns& matrix) {
  return 16.0 * std::numeric_limits<double>::epsilon() *
         static_cast<double>(std::max(matrix.rows(), matrix.cols()));
}

/// Where derivatives of the scene's functions are taken.
struct Point {
  double t;
  Vector q, v;
};

/// The derivatives of L and f that decide, as full matrices.
struct FullDerivatives {
  FullDerivatives(const Scene& scene, const Point& at) {
    const Lagrangian& lagrangian = *scene.lagrangian;
    const SparsityPattern& pattern = lagrangian.pattern();
    LagrangianDerivatives l(lagrangian);
    l.take_second(lagrangian, at.t, at.q, at.v);
    lqq = pattern.full(l.qq);
    lqv = pattern.full(l.qv);
    lvv = pattern.full(l.vv);
    lvt.setZero(at.v.size());
    lagrangian.gradient_rate(at.t, at.q, at.v, lvt);
    fq = fv = Columns::Zero(lqq.rows(), lqq.cols());
    if (!scene.force) return;
    Vector by_q(scene.force->pattern().nonzeros()), by_v = by_q;
    scene.force->derivatives(at.t, at.q, at.v, by_q, by_v);
    fq = scene.force->pattern().full(by_q);
    fv = scene.force->pattern().full(by_v);
  }
  Columns lqq, lqv, lvv, fq, fv;
  Vector lvt;
};

/// A basis of the kernel, without a column where there is none.
Columns kernel(const Columns& matrix) {
  Columns basis = kernel_basis(matrix, rank_tolerance(matrix));
  for (Eigen::Index j = 0; j < basis.cols(); ++j) {
    basis.col(j) /= max_norm(basis.col(j));
    Eigen::Index first = 0;
    while (std::abs(basis(first, j)) < zero_tolerance) ++first;
    if (basis(first, j) < 0.0) basis.col(j) *= -1.0;  // names begin without a sign
  }
  return (basis.array().abs() < zero_tolerance).select(0.0, basis);
}

Columns row_matrix(const Scene& scene, const Point& at) {
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(at.t, at.q);
  return rows.pattern().full(rows.coefficients());
}

/// Rows of ∂²L/∂v² and A, each in its own units.
Columns stacked(const Scene& scene, const Point& at, const FullDerivatives& d) {
  Columns all(scene.dimension() + scene.rows(), scene.dimension());
  all.topRows(scene.dimension()) = d.lvv;
  if (scene.rows() > 0) all.bottomRows(scene.rows()) = row_matrix(scene, at);
  for (Eigen::Index r = 0; r < all.rows(); ++r) all.row(r) /= size_or_one(max_norm(all.row(r).transpose()));
  return all;
}

bool vanishes(const Columns& product, const Columns& factor) {
  return max_norm(product) <= zero_tolerance * size_or_one(max_norm(factor));
}

/// A point near the start that shares no special position with it.
Point near(const Start& start) {
  Point point{start.time + 0.37, start.q, start.v};
  const double q_size = size_or_one(max_norm(start.q)), v_size = size_or_one(max_norm(start.v));
  for (Eigen::Index i = 0; i < start.q.size(); ++i) {
    point.q[i] += 1e-2 * q_size * std::sin(1.0 + 1.7 * static_cast<double>(i));
    point.v[i] += 0.3 * v_size * std::cos(0.3 + 2.3 * static_cast<double>(i));
  }
  return point;
}

[[noreturn]] void refuse(const Scene& scene, const Columns& w, const std::string& why) {
  std::string motions;
  for (Eigen::Index k = 0; k < w.cols(); ++k)
    motions += (k == 0 ? "'" : ", '") + motion_along(scene, w.col(k)) + "'";
  throw Misuse("scene '" + scene.name + "': the Lagrangian is degenerate along the rows: a motion along " +
               motions + " carries no momentum, and " + why);
}

/// The directions W, those along which f resists apart from the others.
struct Directions {
  Columns resisted, free;
};

/// `each_in_its_units`: the conductance of a diode, 1e-12 A/V, counts beside a resistance of 1e3 V/A.
Directions split(const Columns& w, const Columns& fv, bool each_in_its_units) {
  Columns resistance = w.transpose() * fv * w;
  const Vector units = each_in_its_units ? largest_of_rows(resistance) : Vector(Vector::Ones(w.cols()));
  resistance = units.cwiseInverse().asDiagonal() * resistance;
  Eigen::FullPivLU<Columns> lu;
  lu.setThreshold(rank_tolerance(resistance));
  lu.compute(resistance);
  Directions result{Columns(w.rows(), lu.rank()),
                    w * (units.cwiseInverse().asDiagonal() * kernel(resistance.transpose()))};
  const auto& order = lu.permutationP().indices();
  for (Eigen::Index r = 0; r < w.cols(); ++r)
    if (order[r] < lu.rank()) result.resisted.col(order[r]) = w.col(r);
  return result;
}

Vector force_of(const Scene& scene, const Point& at) {
  Vector f = Vector::Zero(scene.dimension());
  if (scene.force) scene.force->value(at.t, at.q, at.v, f);
  return f;
}

/// Whether a form on velocities vanishes on those that the rows allow, where these are linear, A v = 0.
bool vanishes_on_rows(const Scene& scene, const Point& at, const Columns& form, const Columns& factor) {
  if (scene.rows() == 0) return false;
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(at.t, at.q);
  Vector off(rows.rows());
  rows.velocity_residual(Vector::Zero(scene.dimension()), off);
  const Columns allowed = kernel(rows.pattern().full(rows.coefficients()));
  return max_norm(off) == 0.0 && vanishes(form * allowed, factor);
}

/// What the equations at the top of the header take for granted.
void require_described(const Scene& scene, const Columns& w, const Directions& split, const Point& at,
                       const FullDerivatives& d) {
  if (!vanishes(d.lqv * w, d.lqv) || !vanishes(w.transpose() * d.lvt, d.lvt))
    refuse(scene, w, "its momentum ∂L/∂v is not constant, which is not supported");
  const Columns by_velocity = split.free.transpose() * d.fv;
  const bool free = vanishes(by_velocity, d.fv) || vanishes_on_rows(scene, at, by_velocity, d.fv);
  if (!vanishes(w.transpose() * d.lqv, d.lqv) || !free)
    refuse(scene, w, "the force along it depends on other velocities, which is not supported");
  if (!scene.force) return;
  const Vector f = force_of(scene, at), later = force_of(scene, {at.t + 0.61, at.q, at.v});
  if (!vanishes(split.free.transpose() * (later - f), f))
    refuse(scene, w, "the force f along it depends on the time; put it into the Lagrangian as a potential");
}

/// W, without a column where ∂²L/∂v² is regular along the rows at the start or near it: what is singular at
/// the start alone is no degeneracy.
Columns directions(const Scene& scene, const Point& start, const FullDerivatives& at_start,
                   const Point& other, const FullDerivatives& at_other) {
  const Columns here = stacked(scene, start, at_start), elsewhere = stacked(scene, other, at_other);
  Columns w = kernel(here);
  if (w.cols() == 0 || !elsewhere.allFinite()) return w;
  Columns both(here.rows() + elsewhere.rows(), here.cols());
  both << here, elsewhere;
  Columns constant = kernel(both);
  if (constant.cols() > several) constant = fewer_entries(std::move(constant), zero_tolerance);
  if (kernel(elsewhere).cols() > constant.cols())
    refuse(scene, w,
           "elsewhere another motion does: a direction without momentum that moves is not supported");
  return constant;
}

/// Nearer to the start where diodes would conduct so much that all else is round-off beside it.
Point conducting(const Scene& scene, Point near_start, const FullDerivatives& at_start) {
  constexpr int halvings = 12;
  const double most = 1e3 * size_or_one(max_norm(at_start.fv));
  for (int k = 0; k < halvings && !(max_norm(FullDerivatives(scene, near_start).fv) <= most); ++k)
    near_start.v = 0.5 * (near_start.v + scene.start.v);
  return near_start;
}

Columns hidden_matrix(const Directions& w, const FullDerivatives& d) {
  Columns matrix(w.resisted.cols() + w.free.cols(), d.lqq.cols());
  matrix << w.resisted.transpose() * d.fv, w.free.transpose() * (d.lqq + d.fq);
  return matrix;
}

}  // namespace

ConstraintBlocks hidden_rows(const Scene& scene) {
  if (scene.by_hamiltonian() || scene.space) return {};
  const FirstOrderMotions first_order = first_order_motions(scene);
  if (first_order.exist() && !first_order.by_force) return {};
  const Start& start = scene.start;
  const bool sized = start.q.size() == scene.storage_size() && start.v.size() == scene.dimension();
  if (!sized || !start.q.allFinite() || !start.v.allFinite()) return {};  // told by require_consistent
  if (scene.lagrangian->structure().phase_space() || positive_definite(*scene.lagrangian, start)) return {};
  if (scene.dimension() > largest_full_matrix) return {};
  const Point first{start.time, start.q, start.v}, other = near(start);
  const FullDerivatives at_first(scene, first), at_other(scene, other);
  if (!at_first.lvv.allFinite()) return {};  // told where the momentum is taken
  const Columns w = directions(scene, first, at_first, other, at_other);
  if (w.cols() == 0) return {};
  const Point aside = first_order.by_force ? conducting(scene, other, at_first) : other;
  const FullDerivatives at_aside(scene, aside);
  const FullDerivatives& resisting = first_order.by_force ? at_aside : at_first;
  Directions parts = split(w, resisting.fv, first_order.by_force);
  if (!first_order.by_force) parts.resisted = with_rows_apart(parts.resisted, resisting.fv, w);
  require_described(scene, w, parts, aside, at_aside);
  const Columns matrix = hidden_matrix(parts, resisting);
  const Vector units = largest_of_rows(matrix);
  const Columns undetermined = kernel(units.cwiseInverse().asDiagonal() * matrix * w);
  const bool multipliers = undetermined.cols() > 0 && undetermined.cols() == parts.free.cols() &&
                           are_multipliers(scene, parts.free);
  if (undetermined.cols() > 0 && !multipliers) {
    const std::string fault = fault_of_multipliers(scene, w * undetermined);
    refuse(scene, w * undetermined,
           fault.empty() ? "neither a potential nor a force determines it; is a term missing in L?" : fault);
  }
  ConstraintBlocks blocks;
  const Eigen::Index r = parts.resisted.cols(), c = parts.free.cols();
  if (r > 0 && !first_order.by_force)
    blocks.push_back(rows_along_motions(scene, false, parts.resisted, units.head(r)));
  if (multipliers) {
    auto rows = std::make_shared<MultiplierRows>(scene, parts.free, units.tail(c));
    if (const std::string twice = rows_said_twice(scene, *rows); !twice.empty())
      refuse(scene, parts.free,
             "what it is a multiplier of says the same as " + twice + ": leave out the one or the other");
    blocks.push_back(std::move(rows));
  } else if (c > 0)
    blocks.push_back(rows_along_motions(scene, true, parts.free, units.tail(c)));
  return blocks;
}

std::shared_ptr<const Scene> with_hidden_rows(std::shared_ptr<const Scene> scene) {
  const ConstraintBlocks blocks = hidden_rows(*scene);
  if (blocks.empty()) return scene;
  auto extended = std::make_shared<Scene>(*scene);
  const Point start{scene->start.time, scene->start.q, scene->start.v};
  ConstraintsAtPoint hidden(blocks, scene->dimension());
  hidden.evaluate(start.t, start.q);
  const Point other = near(scene->start);
  const Columns w =
      directions(*scene, start, FullDerivatives(*scene, start), other, FullDerivatives(*scene, other));
  Vector off(hidden.rows());
  hidden.velocity_residual(start.v, off);
  const Columns response = hidden.pattern().full(hidden.coefficients()) * w;
  extended->start.v -= w * response.fullPivLu().solve(off);
  extended->constraints.insert(extended->constraints.end(), blocks.begin(), blocks.end());
  return extended;
}

}  // namespace diracstep
