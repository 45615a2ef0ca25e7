#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <sstream>

namespace diracstep {

namespace {

constexpr int largest_full_matrix = 1500;
constexpr double rank_tolerance = 1e-10;  // of a pivot, in relation to the largest
constexpr double zero_tolerance = 1e-12;  // of an entry, in relation to the terms of its row

/// Where derivatives of the scene's functions are taken.
struct Point {
  double t;
  Vector q, v;
};

/// The derivatives of L and f that decide, as full matrices.
struct Derivatives {
  Derivatives(const Scene& scene, const Point& at) {
    const Lagrangian& lagrangian = *scene.lagrangian;
    const SparsityPattern& pattern = lagrangian.pattern();
    Vector qq(pattern.nonzeros()), qv = qq, vv = qq;
    lagrangian.hessian(at.t, at.q, at.v, qq, qv, vv);
    lqq = pattern.full(qq);
    lqv = pattern.full(qv);
    lvv = pattern.full(vv);
    lvt.setZero(at.q.size());
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

/// Whether ∂²L/∂v² at the start is positive definite whatever the units of the coordinates: the cheap test
/// that nearly every scene passes.
bool positive_definite(const Lagrangian& lagrangian, const Start& start) {
  const SparsityPattern& pattern = lagrangian.pattern();
  Vector lqq(pattern.nonzeros()), lqv = lqq, lvv = lqq;
  lagrangian.hessian(start.time, start.q, start.v, lqq, lqv, lvv);
  const int n = pattern.rows();
  const Eigen::Map<const Eigen::SparseMatrix<double>> mass(
      n, n, pattern.nonzeros(), pattern.column_starts().data(), pattern.row_indices().data(), lvv.data());
  Vector size(n);
  for (int i = 0; i < n; ++i) size[i] = mass.coeff(i, i);
  if (!(size.minCoeff() > 0.0)) return false;
  size = size.cwiseSqrt().cwiseInverse();
  const Eigen::SparseMatrix<double> scaled = size.asDiagonal() * mass * size.asDiagonal();
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(scaled);
  return factors.info() == Eigen::Success && factors.vectorD().minCoeff() > 1e-12;
}

/// A basis of the kernel, without a column where there is none.
Columns kernel(const Columns& matrix) {
  Eigen::FullPivLU<Columns> lu;
  lu.setThreshold(rank_tolerance);
  lu.compute(matrix);
  if (lu.dimensionOfKernel() == 0) return Columns(matrix.cols(), 0);
  Columns basis = lu.kernel();
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
Columns stacked(const Scene& scene, const Point& at, const Derivatives& d) {
  Columns all(scene.dimension() + scene.rows(), scene.dimension());
  all.topRows(scene.dimension()) = d.lvv;
  if (scene.rows() > 0) all.bottomRows(scene.rows()) = row_matrix(scene, at);
  for (Eigen::Index r = 0; r < all.rows(); ++r) all.row(r) /= usable_scale(max_norm(all.row(r).transpose()));
  return all;
}

bool vanishes(const Columns& product, const Columns& factor) {
  return max_norm(product) <= zero_tolerance * usable_scale(max_norm(factor));
}

/// A point near the start that shares no special position with it.
Point near(const Start& start) {
  Point point{start.time + 0.37, start.q, start.v};
  const double q_size = usable_scale(max_norm(start.q)), v_size = usable_scale(max_norm(start.v));
  for (Eigen::Index i = 0; i < start.q.size(); ++i) {
    point.q[i] += 1e-2 * q_size * std::sin(1.0 + 1.7 * static_cast<double>(i));
    point.v[i] += 0.3 * v_size * std::cos(0.3 + 2.3 * static_cast<double>(i));
  }
  return point;
}

/// "qC1-qC3": a motion in words.
std::string motion(const Scene& scene, const Vector& w) {
  std::ostringstream text;
  for (Eigen::Index i = 0; i < w.size(); ++i) {
    if (w[i] == 0.0) continue;
    text << (w[i] < 0.0 ? "-" : text.str().empty() ? "" : "+");
    if (std::abs(w[i]) != 1.0) text << std::abs(w[i]) << "*";
    text << scene.coordinates[static_cast<std::size_t>(i)];
  }
  return text.str();
}

[[noreturn]] void refuse(const Scene& scene, const Columns& w, const char* why) {
  std::string motions;
  for (Eigen::Index k = 0; k < w.cols(); ++k)
    motions += (k == 0 ? "'" : ", '") + motion(scene, w.col(k)) + "'";
  throw Misuse("scene '" + scene.name + "': the Lagrangian is degenerate along the rows: a motion along " +
               motions + " carries no momentum, and " + why);
}

/// The rows Wᵀ(∂L/∂q + f), each divided by the size of its coefficients at the start.
class HiddenRows final : public ConstraintRows {
 public:
  HiddenRows(const Scene& scene, bool holonomic, const Columns& directions, const Vector& units)
      : HiddenRows(scene, holonomic, in_units(directions, units), directions, pattern_of(directions)) {}

  /// They follow from the equations of motion, so that their forces are zero.
  bool workless() const override { return true; }

  void position(double t, ConstVectorRef q, VectorRef phi) const override { force_along(t, q, phi); }

  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    const Vector rest = Vector::Zero(dimension());
    if (holonomic()) {
      by_position(t, q, rest, 1.0, a);
      Vector lqt(dimension());
      lagrangian_->position_gradient_rate(t, q, rest, lqt);
      b = w_.transpose() * lqt;
      return;
    }
    Vector fq(force_->pattern().nonzeros()), fv = fq;
    force_->derivatives(t, q, rest, fq, fv);
    a.setZero();
    add(1, by_force_, fv, 1.0, a);
    force_along(t, q, b);
  }

  /// For rows on velocities  ∂(f_v w + s (L_q + f))/∂q = f_q(w) + s L_qq + (s − 1) f_q(0).
  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    d.setZero();
    if (holonomic()) return;
    by_position(t, q, w, s, d);
    Vector fq(force_->pattern().nonzeros()), fv = fq;
    force_->derivatives(t, q, Vector::Zero(dimension()), fq, fv);
    add(1, by_force_, fq, s - 1.0, d);
  }

  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    d.setZero();
    if (holonomic()) return;
    Vector lqt(dimension());
    lagrangian_->position_gradient_rate(t, q, v, lqt);
    d = w_.transpose() * lqt;
  }

  void annihilator_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const override {
    d.setZero();
  }

 private:
  HiddenRows(const Scene& scene, bool holonomic, Columns w, const Columns& directions,
             const SparsityPattern& places)
      : HiddenRows(
            scene, holonomic, std::move(w), directions, places,
            PatternProduct(places, true, scene.lagrangian->pattern(), false),
            scene.force ? PatternProduct(places, true, scene.force->pattern(), false) : PatternProduct()) {}

  HiddenRows(const Scene& scene, bool holonomic, Columns w, const Columns& directions,
             const SparsityPattern& places, PatternProduct by_lagrangian, PatternProduct by_force)
      : ConstraintRows(holonomic, union_of(scene, directions, by_lagrangian, by_force, nullptr),
                       SparsityPattern(scene.dimension(), scene.dimension(), {}),
                       names_of(scene, directions)),
        lagrangian_(scene.lagrangian),
        force_(scene.force),
        w_(std::move(w)),
        by_lagrangian_(std::move(by_lagrangian)),
        by_force_(std::move(by_force)),
        layout_(static_cast<int>(w_.cols()), scene.dimension()) {
    union_of(scene, directions, by_lagrangian_, by_force_, &layout_);
    for (const auto& [i, k] : places.entries()) w_values_.push_back(w_(i, k));
  }

  static Columns in_units(const Columns& directions, const Vector& units) {
    return directions * units.cwiseInverse().asDiagonal();
  }
  static SparsityPattern pattern_of(const Columns& w) {
    std::vector<std::pair<int, int>> entries;
    for (int k = 0; k < w.cols(); ++k)
      for (int i = 0; i < w.rows(); ++i)
        if (w(i, k) != 0.0) entries.emplace_back(i, k);
    return {static_cast<int>(w.rows()), static_cast<int>(w.cols()), std::move(entries)};
  }
  static SparsityPattern union_of(const Scene& scene, const Columns& w, const PatternProduct& by_lagrangian,
                                  const PatternProduct& by_force, BlockPattern* layout) {
    BlockPattern own(static_cast<int>(w.cols()), scene.dimension());
    BlockPattern& both = layout != nullptr ? *layout : own;
    both.add(by_lagrangian.pattern(), 0, 0);
    if (scene.force) both.add(by_force.pattern(), 0, 0);
    return both.assemble(false);
  }
  static std::vector<std::string> names_of(const Scene& scene, const Columns& w) {
    std::vector<std::string> names;
    for (Eigen::Index k = 0; k < w.cols(); ++k) names.push_back("hidden_" + motion(scene, w.col(k)));
    return names;
  }

  /// Wᵀ(∂L/∂q + f) at v = 0.
  void force_along(double t, ConstVectorRef q, VectorRef out) const {
    Vector rest = Vector::Zero(dimension()), lq(dimension()), other(dimension());
    lagrangian_->gradient(t, q, rest, lq, other);
    if (force_) {
      force_->value(t, q, rest, other);
      lq += other;
    }
    out = w_.transpose() * lq;
  }

  /// Wᵀ(s ∂²L/∂q² + ∂f/∂q) at (t, q, v).
  void by_position(double t, ConstVectorRef q, ConstVectorRef v, double s, VectorRef out) const {
    Vector lqq(lagrangian_->pattern().nonzeros()), lqv = lqq, lvv = lqq;
    lagrangian_->hessian(t, q, v, lqq, lqv, lvv);
    out.setZero();
    add(0, by_lagrangian_, lqq, s, out);
    if (!force_) return;
    Vector fq(force_->pattern().nonzeros()), fv = fq;
    force_->derivatives(t, q, v, fq, fv);
    add(1, by_force_, fq, 1.0, out);
  }

  /// out += factor · Wᵀ M.
  void add(int block, const PatternProduct& product, const Vector& m, double factor, VectorRef out) const {
    Vector values = Vector::Zero(product.pattern().nonzeros());
    product.multiply(w_values_.data(), m.data(), values.data());
    const auto& places = layout_.positions(block);
    for (std::size_t k = 0; k < places.size(); ++k)
      out[places[k]] += factor * values[static_cast<Eigen::Index>(k)];
  }

  std::shared_ptr<const Lagrangian> lagrangian_;
  std::shared_ptr<const Force> force_;  ///< may be null
  Columns w_;                           ///< n×d, in the units of the rows
  std::vector<double> w_values_;        ///< its entries other than zero
  PatternProduct by_lagrangian_, by_force_;
  BlockPattern layout_;
};

/// The directions W, those along which f resists apart from the others.
struct Directions {
  Columns resisted, free;
};

Directions split(const Columns& w, const Columns& fv) {
  const Columns resistance = w.transpose() * fv * w;
  Eigen::FullPivLU<Columns> lu;
  lu.setThreshold(rank_tolerance);
  lu.compute(resistance);
  Directions result{Columns(w.rows(), lu.rank()), w * kernel(resistance.transpose())};
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

/// What the equations at the top of the header take for granted.
void require_described(const Scene& scene, const Columns& w, const Directions& split, const Point& at,
                       const Derivatives& d) {
  if (!vanishes(d.lqv * w, d.lqv) || !vanishes(w.transpose() * d.lvt, d.lvt))
    refuse(scene, w, "its momentum ∂L/∂v is not constant, which is not supported");
  if (!vanishes(w.transpose() * d.lqv, d.lqv) || !vanishes(split.free.transpose() * d.fv, d.fv))
    refuse(scene, w, "the force along it depends on other velocities, which is not supported");
  if (!scene.force) return;
  const Vector rest = Vector::Zero(scene.dimension());
  const Vector f = force_of(scene, at), later = force_of(scene, {at.t + 0.61, at.q, at.v});
  if (!vanishes(split.free.transpose() * (later - f), f))
    refuse(scene, w, "the force f along it depends on the time; put it into the Lagrangian as a potential");
  const Vector affine =
      force_of(scene, {at.t, at.q, 2.0 * at.v}) - 2.0 * f + force_of(scene, {at.t, at.q, rest});
  if (!vanishes(split.resisted.transpose() * affine, f))
    refuse(scene, w, "the force along it is not linear in v, which is not supported; add a small inertia");
}

/// W, or nothing where ∂²L/∂v² is regular along the rows at the start or near it.
Columns directions(const Scene& scene, const Point& start, const Derivatives& at_start, const Point& other,
                   const Derivatives& at_other) {
  Columns w = kernel(stacked(scene, start, at_start));
  if (w.cols() == 0) return w;
  const Columns elsewhere = stacked(scene, other, at_other);
  if (elsewhere.allFinite() && !vanishes(elsewhere * w, elsewhere)) return Columns(w.rows(), 0);
  return w;
}

Columns hidden_matrix(const Directions& w, const Derivatives& d) {
  Columns matrix(w.resisted.cols() + w.free.cols(), d.lqq.cols());
  matrix << w.resisted.transpose() * d.fv, w.free.transpose() * (d.lqq + d.fq);
  return matrix;
}

Vector largest_of_rows(const Columns& matrix) {
  Vector largest(matrix.rows());
  for (Eigen::Index r = 0; r < matrix.rows(); ++r)
    largest[r] = usable_scale(max_norm(matrix.row(r).transpose()));
  return largest;
}

}  // namespace

ConstraintBlocks hidden_rows(const Scene& scene) {
  const Start& start = scene.start;
  const bool sized = start.q.size() == scene.dimension() && start.v.size() == scene.dimension();
  if (!sized || !start.q.allFinite() || !start.v.allFinite()) return {};  // told by require_consistent
  if (scene.lagrangian->structure().phase_space() || positive_definite(*scene.lagrangian, start)) return {};
  if (scene.dimension() > largest_full_matrix) return {};
  const Point first{start.time, start.q, start.v}, other = near(start);
  const Derivatives at_first(scene, first), at_other(scene, other);
  const Columns w = directions(scene, first, at_first, other, at_other);
  if (w.cols() == 0) return {};
  const Directions parts = split(w, at_first.fv);
  require_described(scene, w, parts, other, at_other);
  const Columns matrix = hidden_matrix(parts, at_first);
  const Vector units = largest_of_rows(matrix);
  const Columns undetermined = kernel(units.cwiseInverse().asDiagonal() * matrix * w);
  if (undetermined.cols() > 0)
    refuse(scene, w * undetermined, "neither a potential nor a force determines it; is a term missing in L?");
  ConstraintBlocks blocks;
  const Eigen::Index r = parts.resisted.cols(), c = parts.free.cols();
  if (r > 0) blocks.push_back(std::make_shared<HiddenRows>(scene, false, parts.resisted, units.head(r)));
  if (c > 0) blocks.push_back(std::make_shared<HiddenRows>(scene, true, parts.free, units.tail(c)));
  return blocks;
}

std::shared_ptr<const Scene> with_hidden_rows(std::shared_ptr<const Scene> scene) {
  const ConstraintBlocks blocks = hidden_rows(*scene);
  if (blocks.empty()) return scene;
  auto extended = std::make_shared<Scene>(*scene);
  const Point start{scene->start.time, scene->start.q, scene->start.v};
  ConstraintsAtPoint hidden(blocks, scene->dimension());
  hidden.evaluate(start.t, start.q);
  const Columns w = kernel(stacked(*scene, start, Derivatives(*scene, start)));
  Vector off(hidden.rows());
  hidden.velocity_residual(start.v, off);
  const Columns response = hidden.pattern().full(hidden.coefficients()) * w;
  extended->start.v -= w * response.fullPivLu().solve(off);
  extended->constraints.insert(extended->constraints.end(), blocks.begin(), blocks.end());
  return extended;
}

}  // namespace diracstep
