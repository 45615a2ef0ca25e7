#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/equilibrium/operating_point.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/monotone_newton.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/first_order_motions.hpp>

namespace diracstep {

namespace {

constexpr Eigen::Index most_unknowns_of_operating_point = 2000;
constexpr double contradicted_from = 1e-7;  // of the terms of an equation

constexpr double no_pivot = 1e-12;  // of the largest, of what stays as it is at the start

/// The equations of the header.  Unknowns x: of each coordinate its position where it rests, else its
/// velocity; then λ.  Coordinates behind those of `resting` are parameters.
class OperatingPointEquations {
 public:
  OperatingPointEquations(const Scene& scene, const Start& start, const std::vector<bool>& resting)
      : scene_(scene),
        start_(start),
        n_(static_cast<Eigen::Index>(resting.size())),
        m_(scene.rows()),
        point_(scene, FirstOrderMotions{}) {
    if (n_ + m_ > most_unknowns_of_operating_point)
      throw Misuse("scene '" + scene.name + "': its operating point is looked for with full matrices, for " +
                   std::to_string(most_unknowns_of_operating_point) +
                   " coordinates and rows at most; state the start instead");
    for (Eigen::Index i = 0; i < n_; ++i)
      (resting[static_cast<std::size_t>(i)] ? resting_ : moving_).push_back(static_cast<int>(i));
    find_what_stays();
  }

  Vector first_guess() const {
    Vector x = Vector::Zero(n_ + m_);
    for (const int i : resting_) x[i] = start_.q[i];
    for (const int i : moving_) x[i] = start_.v[i];
    return x;
  }

  Start start_at(const Vector& x) const {
    Start at = start_;
    for (const int i : resting_) {
      at.q[i] = x[i];
      at.v[i] = 0.0;
    }
    for (const int i : moving_) at.v[i] = x[i];
    return at;
  }

  Vector residual(const Vector& x) {
    const Start at = start_at(x);
    point_.evaluate(at.time, at.q, at.v, x.tail(m_));
    Vector values(n_ + m_ + kept_charges_.rows() + kept_fluxes_.rows());
    values << (point_.force() - point_.momentum_rate()).head(n_), point_.row_residual(),
        kept_charges_ * (at.q - start_.q), kept_fluxes_ * (point_.momentum() - momentum_);
    return values;
  }

  /// Of residual(), at the same point.
  Columns jacobian() {
    point_.differentiate();
    const Columns by_v = point_.force_by_v() - point_.momentum_by_q(),
                  by_q = point_.force_by_q() - point_.rate_by_q();
    const Eigen::Index c = kept_charges_.rows(), f = kept_fluxes_.rows();
    Columns matrix = Columns::Zero(n_ + m_ + c + f, n_ + m_);
    for (const int i : moving_)
      matrix.col(i) << by_v.col(i).head(n_), point_.rows().col(i), Vector::Zero(c),
          kept_fluxes_ * point_.mass().col(i);
    for (const int i : resting_)
      matrix.col(i) << by_q.col(i).head(n_), point_.row_by_q().col(i), kept_charges_.col(i),
          kept_fluxes_ * point_.momentum_by_q().col(i);
    matrix.topRightCorner(n_, m_) = point_.rows().leftCols(n_).transpose();
    return matrix;
  }

  /// ∂ residual()/∂θ at the same point, after jacobian(), where the start changes with θ by dq and dv.
  Columns parameter_derivatives(const Columns& dq, const Columns& dv) {
    const Eigen::Index count = scene_.dimension() - n_;
    const Columns flux_rates = kept_fluxes_ * point_.momentum_by_q().rightCols(count);
    Columns values(n_ + m_ + kept_charges_.rows() + kept_fluxes_.rows(), count);
    values << (point_.force_by_q() - point_.rate_by_q()).topRightCorner(n_, count),
        point_.row_by_q().rightCols(count), -kept_charges_.leftCols(n_) * dq,
        flux_rates - kept_fluxes_ * (momentum_by_q_.rightCols(count) + mass_.leftCols(n_) * dv);
    return values;
  }

  /// The equations that are met worst beside their terms; empty where all are met.
  std::string contradiction(const Vector& x, const Vector& residual, const Columns& jacobian,
                            const BalancedMatrix& matrix) const {
    constexpr double beside_the_largest = 1e-6;  // round-off of what is zero
    const Vector terms = jacobian.cwiseAbs() * x.cwiseAbs() + residual.cwiseAbs() +
                         beside_the_largest * matrix.sizes_in_rows(x) +
                         Vector::Constant(residual.size(), smallest_scale);
    const Vector parts = residual.cwiseAbs().cwiseQuotient(terms);
    const double worst = max_norm(parts);
    if (worst <= contradicted_from) return {};
    std::string text;
    for (Eigen::Index i = 0; i < parts.size(); ++i)
      if (parts[i] >= 0.5 * worst)
        text += (text.empty() ? "" : ", ") + to_text(residual[i], 3) + " is left " + equation(i);
    return text;
  }

 private:
  std::string equation(Eigen::Index i) const {
    if (i < n_) return "along '" + scene_.coordinates[static_cast<std::size_t>(i)] + "'";
    if (i < n_ + m_) return "of " + row_label(scene_.constraints, static_cast<int>(i - n_));
    return "of what stays as it is at the start";
  }

  void find_what_stays() {
    const Vector none = Vector::Zero(m_);
    Vector generic = start_.v;
    for (const int i : moving_) generic[i] += 0.1 * std::cos(0.3 + 2.3 * static_cast<double>(i));
    point_.evaluate(start_.time, start_.q, generic, none);
    point_.differentiate();
    const Columns a = point_.rows(), moved = a(Eigen::all, moving_);
    const Columns by_v = point_.force_by_v() - point_.momentum_by_q();
    kept_charges_ = Columns::Zero(0, scene_.dimension());
    if (m_ > 0) {
      Columns charges = Columns::Zero(m_, scene_.dimension());
      charges(Eigen::all, resting_) = a(Eigen::all, resting_);
      charges = Columns(balanced_kernel_basis(moved.transpose(), no_pivot).transpose() * charges);
      if (max_norm(charges) > 0.0) kept_charges_ = charges;
    }
    Columns resisting(m_ + n_, static_cast<Eigen::Index>(moving_.size()));
    resisting << moved, by_v(Eigen::all, moving_).topRows(n_);
    const Columns free = balanced_kernel_basis(resisting, no_pivot);
    kept_fluxes_ = Columns::Zero(free.cols(), scene_.dimension());
    kept_fluxes_(Eigen::all, moving_) = free.transpose();
    point_.evaluate(start_.time, start_.q, start_.v, none);
    point_.differentiate();
    momentum_ = point_.momentum();
    mass_ = point_.mass();
    momentum_by_q_ = point_.momentum_by_q();
  }

  const Scene& scene_;
  Start start_;
  Eigen::Index n_, m_;
  FirstOrderPoint point_;
  std::vector<int> resting_, moving_;
  Columns kept_charges_, kept_fluxes_;  ///< yᵀA and zᵀ of the header
  Columns mass_, momentum_by_q_;        ///< at the start
  Vector momentum_;
};

[[noreturn]] void refuse_operating_point(const Scene& scene, const std::string& why) {
  throw Misuse("scene '" + scene.name + "': no operating point: " + why +
               "; state where the motion starts instead (of a netlist: uic and IC=)");
}

Vector solve_for_operating_point(OperatingPointEquations& equations, const Scene& scene) {
  Vector x = equations.first_guess();
  const MonotoneNewton end = solve_monotonically([&](const Vector& at) { return equations.residual(at); },
                                                 [&](const Vector&) { return equations.jacobian(); }, x);
  if (!end.failure.empty()) refuse_operating_point(scene, end.failure);
  const Vector residual = equations.residual(x);
  const Columns jacobian = equations.jacobian();
  const std::string left = equations.contradiction(x, residual, jacobian, BalancedMatrix(jacobian));
  if (!left.empty()) refuse_operating_point(scene, left);
  return x;
}

}  // namespace

Start operating_point(const Scene& scene, const Start& start, const std::vector<bool>& resting) {
  if (scene.by_hamiltonian())
    throw Misuse("scene '" + scene.name + "': an operating point needs a Lagrangian");
  OperatingPointEquations equations(scene, start, resting);
  return equations.start_at(solve_for_operating_point(equations, scene));
}

void operating_point_derivatives(const Scene& extended, const Vector& parameters, const Start& found,
                                 const std::vector<bool>& resting, Columns& dq, Columns& dv) {
  Start start = found;
  const Eigen::Index n = found.q.size();
  start.q.conservativeResize(n + parameters.size());
  start.q.tail(parameters.size()) = parameters;
  start.v.conservativeResizeLike(Vector::Zero(n + parameters.size()));
  OperatingPointEquations equations(extended, start, resting);
  const Vector x = solve_for_operating_point(equations, extended);
  (void)equations.residual(x);
  const BalancedMatrix matrix(equations.jacobian());
  const Columns change = -matrix.solve(equations.parameter_derivatives(dq, dv));
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool rests = resting[static_cast<std::size_t>(i)];
    if (rests) dv.row(i).setZero();
    (rests ? dq : dv).row(i) = change.row(i);
  }
}

}  // namespace diracstep
