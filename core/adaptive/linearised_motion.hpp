#pragma once

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/integrator/sample.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// The motion linearised about its points.
class LinearisedMotion {
 public:
  static constexpr double damping_probe = 1e-6;  // in units of the sizes
  static constexpr double least_size = 1e-6;     // of the largest position or velocity

  LinearisedMotion(const Scene& scene, const SolverFactory& solvers)
      : scene_(scene), n_(scene.dimension()), motion_(scene, solvers), sizes_(Vector::Zero(2 * n_)) {}

  struct Rates {
    double decay = 0.0, undamped = 0.0;
  };

  /// The largest rates at a point; NaN where there is no acceleration, 0 before anything has moved.
  Rates rates(const Sample& at) {
    const Vector here = state(at);
    sizes_ = sizes_.cwiseMax(here.cwiseAbs());
    if (max_norm(sizes_.head(n_)) == 0.0 || max_norm(sizes_.tail(n_)) == 0.0 || !damps(at)) return {};
    take_units();
    const Columns basis = tangent_space(at);
    Rates largest;
    for (const double side : {damping_probe, -damping_probe}) {
      Columns image(2 * n_, basis.cols());
      for (Eigen::Index k = 0; k < basis.cols(); ++k) image.col(k) = change(at, here, basis.col(k), side);
      if (!image.allFinite()) return {std::nan(""), 0.0};
      const Eigen::EigenSolver<Columns> solver(basis.transpose() * image, false);
      if (solver.info() != Eigen::Success) return {std::nan(""), 0.0};
      for (const auto& value : solver.eigenvalues()) {
        largest.decay = std::max(largest.decay, -value.real());
        if (std::abs(value.real()) < hardly_damped * std::abs(value.imag()))
          largest.undamped = std::max(largest.undamped, std::abs(value.imag()));
      }
    }
    return largest;
  }

 private:
  /// A force without velocities dissipates nothing, although a motion that it drives has rates with real
  /// parts.
  bool damps(const Sample& at) {
    by_position_.setZero(scene_.force->pattern().nonzeros());
    by_velocity_.setZero(by_position_.size());
    scene_.force->derivatives(at.time, at.q, at.v, by_position_, by_velocity_);
    return !(max_norm(by_velocity_) == 0.0);
  }

  Vector state(const Sample& at) const {
    Vector both(2 * n_);
    both << at.q, at.v;
    return both;
  }

  /// What counts as large in a coordinate and its velocity.
  void take_units() {
    units_ = sizes_;
    const auto raise = [](auto part) {
      const double largest = max_norm(part);
      part = part.cwiseMax(least_size * largest);
    };
    raise(units_.head(n_));
    raise(units_.tail(n_));
  }

  /// A basis of the (δq, δv) that keep φ = 0 and A v + b = 0, in units and orthonormal.
  Columns tangent_space(const Sample& at) const {
    const int m = scene_.rows();
    if (m == 0) return Columns::Identity(2 * n_, 2 * n_);
    ConstraintsAtPoint rows(scene_.constraints, n_), positions(only_holonomic(scene_.constraints), n_);
    rows.evaluate(at.time, at.q);
    Vector by_position(rows.pattern().nonzeros());
    rows.distribution().derivative(at.time, at.q, at.v, 1.0, by_position);
    Columns all = Columns::Zero(m + positions.rows(), 2 * n_);
    all.topLeftCorner(m, n_) = rows.pattern().full(by_position);
    all.topRightCorner(m, n_) = rows.pattern().full(rows.coefficients());
    if (positions.rows() > 0) {
      positions.evaluate(at.time, at.q);
      all.bottomLeftCorner(positions.rows(), n_) = positions.pattern().full(positions.coefficients());
    }
    all = all * units_.asDiagonal();
    for (Eigen::Index r = 0; r < all.rows(); ++r) all.row(r) /= size_or_one(max_norm(all.row(r).transpose()));
    const Columns kernel = Eigen::FullPivLU<Columns>(all).kernel();
    return Eigen::HouseholderQR<Columns>(kernel).householderQ() *
           Columns::Identity(kernel.rows(), kernel.cols());
  }

  /// (δv, δa)/side in units, for (δq, δv) = side · direction.
  Vector change(const Sample& at, const Vector& here, const Vector& direction, double side) {
    const Vector there = here + side * direction.cwiseProduct(units_);
    Vector a0(n_), a1(n_), result(2 * n_);
    const bool ok = motion_.acceleration(at.time, here.head(n_), here.tail(n_), a0).ok() &&
                    motion_.acceleration(at.time, there.head(n_), there.tail(n_), a1).ok();
    if (!ok) return Vector::Constant(2 * n_, std::nan(""));
    result << there.tail(n_) - here.tail(n_), a1 - a0;
    return result.cwiseQuotient(units_) / side;
  }

  static constexpr double hardly_damped = 1e-2;  // |Re λ| beside |Im λ|

  const Scene& scene_;
  Eigen::Index n_;
  PointwiseMotion motion_;
  Vector sizes_, units_, by_position_, by_velocity_;
};

}  // namespace diracstep
