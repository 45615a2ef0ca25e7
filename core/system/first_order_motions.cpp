#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/numerics/sparse_columns.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <diracstep/core/system/rows_along_motions.hpp>
#include <utility>

namespace diracstep {

namespace {

Columns stack(const Columns& upper, const Columns& lower) {
  Columns both(upper.rows() + lower.rows(), upper.cols());
  both << upper, lower;
  return both;
}

/// ∂²L/∂v² and ∂²L/∂v∂q, and the rows, at the start and at a point near it that shares no special position.
struct AtTwoPoints {
  explicit AtTwoPoints(const Scene& scene) {
    const Lagrangian& lagrangian = *scene.lagrangian;
    const Start& start = scene.start;
    LagrangianDerivatives l(lagrangian);
    Vector q = start.q, v = start.v;
    double t = start.time;
    for (const int k : {0, 1}) {
      l.take_second(lagrangian, t, q, v);
      ConstraintsAtPoint rows(scene.constraints, scene.dimension());
      rows.evaluate(t, q);
      const Columns mass_here = lagrangian.pattern().full(l.vv),
                    by_q_here = lagrangian.pattern().full(l.qv).transpose(),
                    rows_here = rows.pattern().full(rows.coefficients());
      mass = k == 0 ? mass_here : stack(mass, mass_here);
      by_q = k == 0 ? by_q_here : stack(by_q, by_q_here);
      one_forms = k == 0 ? rows_here : stack(one_forms, rows_here);
      t += 0.37;
      for (Eigen::Index i = 0; i < q.size(); ++i) {
        q[i] += 1e-2 * size_or_one(max_norm(start.q)) * std::sin(1.0 + 1.7 * static_cast<double>(i));
        v[i] += 0.3 * size_or_one(max_norm(start.v)) * std::cos(0.3 + 2.3 * static_cast<double>(i));
      }
    }
  }
  bool finite() const { return mass.allFinite() && by_q.allFinite() && one_forms.allFinite(); }

  Columns mass, by_q, one_forms;
};

/// Whether the force on coordinates that move along the columns of `free` is anything but linear in v: each
/// component in its own units, and to both sides, since a diode blocks on one.  Near the start and about
/// rest: a diode that blocks 12 V there is a resistor for 12 V around.  By unit velocities and large ones as
/// well, since at small ones a diode is a resistor to round-off, and below its breakdown another one.
bool non_linear_in_velocity(const Scene& scene, const Columns& free) {
  constexpr double linear_to = 1e-9, large = 100.0;
  const Start& start = scene.start;
  const Eigen::Index n = start.v.size();
  Vector once(n), twice(n), none(n);
  scene.force->value(start.time, start.q, Vector::Zero(n), none);
  const double size = size_or_one(max_norm(start.v));
  const auto shows_at = [&](const Vector& v) {
    scene.force->value(start.time, start.q, v, once);
    scene.force->value(start.time, start.q, 2.0 * v, twice);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double off = std::abs(twice[i] - 2.0 * once[i] + none[i]);
      const double terms = std::abs(twice[i]) + 2.0 * std::abs(once[i]) + std::abs(none[i]);
      if (!(off <= linear_to * terms) && max_norm(free.row(i).transpose()) > 0.0) return true;
    }
    return false;
  };
  for (const double step : {size, -size, 1.0, -1.0, large, -large}) {
    Vector beside(n);
    for (Eigen::Index i = 0; i < n; ++i) beside[i] = step * std::cos(0.3 + 2.3 * static_cast<double>(i));
    if (shows_at(start.v + beside) || shows_at(beside)) return true;
  }
  return false;
}

/// Whether a scene may have motions by_force: the test without matrices that most scenes end with.
bool may_be_by_force(const Scene& scene) {
  return scene.force &&
         non_linear_in_velocity(scene, Columns::Identity(scene.dimension(), scene.dimension()));
}

}  // namespace

bool positive_definite(const Lagrangian& lagrangian, const Start& start) {
  const SparsityPattern& pattern = lagrangian.pattern();
  LagrangianDerivatives l(lagrangian);
  l.take_second(lagrangian, start.time, start.q, start.v);
  const int n = pattern.rows();
  const auto mass = sparse_map(pattern, l.vv.data());
  Vector size(n);
  for (int i = 0; i < n; ++i) size[i] = mass.coeff(i, i);
  if (!(size.minCoeff() > 0.0)) return false;
  size = size.cwiseSqrt().cwiseInverse();
  const Eigen::SparseMatrix<double> scaled = size.asDiagonal() * mass * size.asDiagonal();
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(scaled);
  return factors.info() == Eigen::Success && factors.vectorD().minCoeff() > 1e-12;
}

namespace {

/// Those whose equations determine (v, Λ) as they are, or with the rates of those that hide.
FirstOrderMotions motions_of_one_level(const Scene& scene) {
  const int n = scene.dimension();
  if (scene.by_hamiltonian() || scene.space) return {};
  const PhaseStructure& structure = scene.lagrangian->structure();
  if (structure.phase_space()) return {Columns::Identity(n, n), Columns(n, 0)};
  const Start& start = scene.start;
  const bool sized = start.q.size() == scene.storage_size() && start.v.size() == n;
  if (n > most_coordinates_of_first_order || !sized || !start.q.allFinite() || !start.v.allFinite() ||
      positive_definite(*scene.lagrangian, start))
    return {};
  const bool by_force = may_be_by_force(scene);
  if (structure.separable && !by_force) return {};
  const AtTwoPoints at(scene);
  if (!at.finite()) return {};
  const Columns w = kernel_basis(at.mass, regular_to),
                free = kernel_basis(stack(at.mass, at.one_forms), regular_to);
  const Columns reached = at.by_q.topRows(n).transpose() * free;  // momenta along `free` by positions
  const bool constant = max_norm(reached) <= 1e-12 * size_or_one(max_norm(at.by_q));
  if (FirstOrderMotions motions = kernel_motions(scene, !constant); motions.exist()) return motions;
  if (free.cols() == 0) return {};
  if (constant && !(by_force && non_linear_in_velocity(scene, free))) return {};
  const Columns& along = constant ? free : w;
  const Eigen::HouseholderQR<Columns> qr(along);
  const Columns q = qr.householderQ() * Columns::Identity(n, n);
  return {along, q.rightCols(n - along.cols()), constant};
}

}  // namespace

bool by_two_form_alone(const Scene& scene, const FirstOrderMotions& motions) {
  const bool refused = motions.open.cols() > 0 || !motions.contradiction.empty();
  return !refused && !motions.hide_equations() && motions.u.cols() == 0 && scene.rows() == 0 && !scene.force;
}

FirstOrderMotions first_order_motions(const Scene& scene) {
  FirstOrderMotions motions = motions_of_one_level(scene);
  const Start& start = scene.start;
  const bool sized = start.q.size() == scene.storage_size() && start.v.size() == scene.dimension();
  if (!motions.exist() || motions.by_force || !sized || !start.q.allFinite() || !start.v.allFinite() ||
      scene.dimension() + scene.rows() > most_with_levels || open_directions(scene, motions).cols() == 0)
    return motions;
  FirstOrderMotions levelled = levelled_motions(scene);
  if (!levelled.levels.empty()) return levelled;
  motions.open = levelled.open;
  motions.contradiction = levelled.contradiction;
  return motions;
}

FirstOrderPoint::FirstOrderPoint(const Scene& scene, FirstOrderMotions motions)
    : scene_(scene),
      motions_(std::move(motions)),
      constraints_(scene.constraints, scene.dimension()),
      l_(*scene.lagrangian),
      f_(Vector::Zero(scene.dimension())),
      rate_(f_),
      row_residual_(Vector::Zero(scene.rows())) {}

void FirstOrderPoint::evaluate(double t, ConstVectorRef q, ConstVectorRef v, ConstVectorRef lambda) {
  t_ = t;
  q_ = q;
  v_ = v;
  lambda_ = lambda;
  l_.take_first(*scene_.lagrangian, t, q, v);
  l_.take_second(*scene_.lagrangian, t, q, v);
  scene_.lagrangian->gradient_rate(t, q, v, rate_);
  scene_.lagrangian->pattern().transposed_multiply_add(l_.qv.data(), v_.data(), rate_.data());
  force_ = l_.q;
  if (scene_.force) {
    scene_.force->value(t, q, v, f_);
    force_ += f_;
  }
  if (scene_.rows() == 0) return;
  constraints_.evaluate(t, q);
  constraints_.add_annihilator(lambda, force_);
  constraints_.velocity_residual(v, row_residual_);
}

void FirstOrderPoint::differentiate() {
  const Lagrangian& lagrangian = *scene_.lagrangian;
  const SparsityPattern& pattern = lagrangian.pattern();
  mass_ = pattern.full(l_.vv);
  by_q_ = pattern.full(l_.qv).transpose();
  force_by_q_ = pattern.full(l_.qq);
  force_by_v_ = pattern.full(l_.qv);
  rate_by_q_.setZero(mass_.rows(), mass_.cols());
  if (!lagrangian.structure().quadratic) {
    const double width = 1e-5 * size_or_one(max_norm(q_)) / size_or_one(max_norm(v_));
    LagrangianDerivatives before(lagrangian), after(lagrangian);
    before.take_second(lagrangian, t_ - width, q_ - width * v_, v_);
    after.take_second(lagrangian, t_ + width, q_ + width * v_, v_);
    rate_by_q_ = pattern.full((after.qv - before.qv) / (2.0 * width)).transpose();
  }
  if (scene_.force) {
    const SparsityPattern& of_force = scene_.force->pattern();
    Vector fq(of_force.nonzeros()), fv = fq;
    scene_.force->derivatives(t_, q_, v_, fq, fv);
    force_by_q_ += of_force.full(fq);
    force_by_v_ += of_force.full(fv);
  }
  a_ = constraints_.pattern().full(constraints_.coefficients());
  Vector derivative(constraints_.pattern().nonzeros());
  constraints_.distribution().derivative(t_, q_, v_, 1.0, derivative);
  row_by_t_.resize(scene_.rows());
  if (scene_.rows() > 0) constraints_.distribution().time_derivative(t_, q_, v_, row_by_t_);
  row_by_q_ = constraints_.pattern().full(derivative);
  Eigen::Index row = 0;
  for (const auto& block : scene_.constraints) {
    Vector curvature(block->curvature_pattern().nonzeros());
    block->annihilator_derivative(t_, q_, lambda_.segment(row, block->rows()), curvature);
    force_by_q_ += block->curvature_pattern().full(curvature);
    row += block->rows();
  }
}

}  // namespace diracstep
