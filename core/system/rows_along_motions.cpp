#include <Eigen/QR>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>
#include <diracstep/core/system/multiplier_rows.hpp>
#include <diracstep/core/system/rows_along_motions.hpp>
#include <sstream>
#include <string_view>
#include <utility>

namespace diracstep {

namespace {

constexpr std::string_view prefix = "hidden_";  // of the names of these rows

/// The rows Wᵀ(∂L/∂q + f), each divided by the size of its coefficients at the start.
class RowsAlongMotions final : public ConstraintRows {
 public:
  RowsAlongMotions(const Scene& scene, bool holonomic, const Columns& directions, const Vector& units)
      : RowsAlongMotions(scene, holonomic, in_units(directions, units), directions, pattern_of(directions)) {
    motions_ = directions;
    units_ = units;
  }

  const Columns& motions() const { return motions_; }
  const Vector& units() const { return units_; }

  std::string origin(int row) const override {
    const std::string& name = names()[static_cast<std::size_t>(row)];
    return "not in the file: the balance of forces along " + name.substr(prefix.size()) +
           ", which carries no momentum";
  }

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
  RowsAlongMotions(const Scene& scene, bool holonomic, Columns w, const Columns& directions,
                   const SparsityPattern& places)
      : RowsAlongMotions(
            scene, holonomic, std::move(w), directions, places,
            PatternProduct(places, true, scene.lagrangian->pattern(), false),
            scene.force ? PatternProduct(places, true, scene.force->pattern(), false) : PatternProduct()) {}

  RowsAlongMotions(const Scene& scene, bool holonomic, Columns w, const Columns& directions,
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
    return {static_cast<int>(w.rows()), static_cast<int>(w.cols()), entries};
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
    for (Eigen::Index k = 0; k < w.cols(); ++k)
      names.push_back(std::string(prefix) + motion_along(scene, w.col(k)));
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
  Columns motions_;  ///< as they were given
  Vector units_;
};

}  // namespace

Vector largest_of_rows(const Columns& matrix) {
  Vector largest(matrix.rows());
  for (Eigen::Index r = 0; r < matrix.rows(); ++r)
    largest[r] = size_or_one(max_norm(matrix.row(r).transpose()));
  return largest;
}

Columns with_rows_apart(Columns w, const Columns& fv, const Columns& motions) {
  constexpr double nearly = 1e-6;
  Columns forms = w.transpose() * fv;
  if (w.cols() < 2) return w;
  const Columns rows = largest_of_rows(forms).cwiseInverse().asDiagonal() * forms * motions;
  const Vector pivots =
      Eigen::ColPivHouseholderQR<Columns>(rows.transpose()).matrixQR().diagonal().cwiseAbs();
  if (pivots.minCoeff() > nearly * pivots.maxCoeff()) return w;
  for (Eigen::Index k = 0; k + 1 < w.cols(); ++k) {
    Eigen::Index row = 0, column = 0;
    if (forms.bottomRows(w.cols() - k).cwiseAbs().maxCoeff(&row, &column) == 0.0) break;
    w.col(k).swap(w.col(k + row));
    forms.row(k).swap(forms.row(k + row));
    for (Eigen::Index r = k + 1; r < w.cols(); ++r) {
      const double factor = forms(r, column) / forms(k, column);
      w.col(r) -= factor * w.col(k);
      forms.row(r) -= factor * forms.row(k);
    }
  }
  return w;
}

std::string motion_along(const Scene& scene, const Vector& w) {
  std::ostringstream text;
  for (Eigen::Index i = 0; i < w.size(); ++i) {
    if (w[i] == 0.0) continue;
    text << (w[i] < 0.0 ? "-" : text.str().empty() ? "" : "+");
    if (std::abs(w[i]) != 1.0) text << std::abs(w[i]) << "*";
    text << scene.coordinates[static_cast<std::size_t>(i)];
  }
  return text.str();
}

std::shared_ptr<const ConstraintRows> rows_along_motions_in(const ConstraintRows& rows,
                                                            const Scene& extended) {
  if (dynamic_cast<const MultiplierRows*>(&rows) != nullptr)
    throw Misuse(
        "scene '" + extended.name +
        "': derivatives of motions with multipliers among the coordinates are not supported; write what "
        "they multiply as rows");
  const auto* const hidden = dynamic_cast<const RowsAlongMotions*>(&rows);
  if (hidden == nullptr) return nullptr;
  Columns motions = Columns::Zero(extended.dimension(), hidden->rows());
  motions.topRows(hidden->dimension()) = hidden->motions();
  return std::make_shared<RowsAlongMotions>(extended, hidden->holonomic(), motions, hidden->units());
}

std::shared_ptr<const ConstraintRows> rows_along_motions(const Scene& scene, bool holonomic,
                                                         const Columns& directions, const Vector& units) {
  return std::make_shared<RowsAlongMotions>(scene, holonomic, directions, units);
}

}  // namespace diracstep
