#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/motion_rates.hpp>
#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/integrator/point_reader.hpp>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <vector>

namespace diracstep {

namespace {

constexpr double damping_probe = 1e-6;  // in units of the sizes
constexpr double least_size = 1e-6;     // of the largest position or velocity
constexpr double hardly_damped = 1e-2;  // |Re λ| beside |Im λ|

/// An orthonormal basis of what all rows allow.
Columns tangents_of(Columns rows) {
  for (Eigen::Index r = 0; r < rows.rows(); ++r)
    rows.row(r) /= size_or_one(max_norm(rows.row(r).transpose()));
  return orthonormal_kernel_basis(rows);
}

}  // namespace

/// The motion linearised about its points.
class PointwiseLinearisation {
 public:
  PointwiseLinearisation(const Scene& scene, const SolverFactory& solvers)
      : scene_(scene), n_(scene.dimension()), motion_(scene, solvers), sizes_(Vector::Zero(2 * n_)) {}

  /// The largest rates at a point; NaN where there is no acceleration, 0 before anything has moved.
  MotionRates::Rates rates(const Sample& at) {
    const Vector here = state(at);
    sizes_ = sizes_.cwiseMax(here.cwiseAbs());
    if (max_norm(sizes_.head(n_)) == 0.0 || max_norm(sizes_.tail(n_)) == 0.0 || !damps(at)) return {};
    take_units();
    const Columns basis = tangent_space(at);
    MotionRates::Rates largest;
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
  /// parts; a state may, whatever it drives.
  bool damps(const Sample& at) {
    if (has_states(scene_)) return true;
    if (!scene_.force) return false;
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
    return tangents_of(all);
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

  const Scene& scene_;
  int n_;
  PointwiseMotion motion_;
  Vector sizes_, units_, by_position_, by_velocity_;
};

/// A motion without mass, whose velocity is a function v(t, q): linearised about its points, δq̇ = ∂v/∂q δq.
class MasslessMotion {
 public:
  MasslessMotion(const Scene& scene, const SolverFactory& solvers)
      : scene_(scene),
        reader_(std::make_shared<const Scene>(scene), solvers,
                scene.dimension() <= MotionRates::most_coordinates),
        sizes_(Vector::Zero(scene.dimension())) {}

  /// The largest decay rate at a point; NaN where there is no velocity, 0 before anything has moved.
  double decay_rate(const Sample& at) {
    sizes_ = sizes_.cwiseMax(at.q.cwiseAbs());
    const double largest = max_norm(sizes_);
    if (largest == 0.0) return 0.0;  // nothing has moved yet
    units_ = sizes_.cwiseMax(least_size * largest);
    return scene_.dimension() <= MotionRates::most_coordinates ? of_all_modes(at) : of_the_fastest_mode(at);
  }

 private:
  double of_all_modes(const Sample& at) {
    const Columns basis = tangent_space(at);
    double largest = 0.0;
    Vector here = at.v;
    if (!reader_.velocity(at.time, at.q, at.p, here).ok()) return std::nan("");
    for (const double side : {damping_probe, -damping_probe}) {
      Columns image(basis.rows(), basis.cols());
      for (Eigen::Index k = 0; k < basis.cols(); ++k) image.col(k) = change(at, here, basis.col(k), side);
      if (!image.allFinite()) return std::nan("");
      const Eigen::EigenSolver<Columns> solver(basis.transpose() * image, false);
      if (solver.info() != Eigen::Success) return std::nan("");
      for (const auto& value : solver.eigenvalues()) largest = std::max(largest, -value.real());
    }
    return largest;
  }

  /// By power iterations: for many coordinates.
  double of_the_fastest_mode(const Sample& at) {
    constexpr int iterations = 6;  // the mode of the node before is a good start
    if (mode_.size() == 0) {
      mode_.resize(scene_.dimension());
      for (Eigen::Index i = 0; i < mode_.size(); ++i) mode_[i] = std::sin(1.0 + 1.7 * static_cast<double>(i));
    }
    double rate = 0.0;
    Vector here = at.v;
    if (!reader_.velocity(at.time, at.q, at.p, here).ok()) return std::nan("");
    for (int k = 0; k < iterations; ++k) {
      mode_.normalize();
      const Vector image = change(at, here, mode_, damping_probe);
      if (!image.allFinite() || !(image.norm() > 0.0)) return std::nan("");
      rate = -mode_.dot(image);
      mode_ = image;
    }
    return rate;
  }

  /// A basis of the δq that keep φ = 0, in units and orthonormal.
  Columns tangent_space(const Sample& at) const {
    const Eigen::Index n = scene_.dimension();
    ConstraintsAtPoint positions(only_holonomic(scene_.constraints), scene_.dimension());
    if (positions.rows() == 0) return Columns::Identity(n, n);
    positions.evaluate(at.time, at.q);
    Columns all = positions.pattern().full(positions.coefficients()) * units_.asDiagonal();
    return tangents_of(all);
  }

  /// δv/side in units, for δq = side · direction, where v is `here` without it.
  Vector change(const Sample& at, const Vector& here, const Vector& direction, double side) {
    Vector there = here;
    if (!reader_.velocity(at.time, at.q + side * direction.cwiseProduct(units_), at.p, there).ok())
      return Vector::Constant(here.size(), std::nan(""));
    return (there - here).cwiseQuotient(units_) / side;
  }

  const Scene& scene_;
  PointReader reader_;
  Vector sizes_, units_, mode_;
};

bool has_states(const Scene& scene) {
  if (!scene.lagrangian) return false;
  std::vector<bool> in_lagrangian(static_cast<std::size_t>(scene.dimension()), false);
  scene.lagrangian->pattern().for_each([&](Eigen::Index, int r, int c) {
    in_lagrangian[static_cast<std::size_t>(r)] = in_lagrangian[static_cast<std::size_t>(c)] = true;
  });
  bool found = false;
  for (const auto& rows : scene.constraints) {
    if (rows->holonomic() || rows->constant()) continue;
    rows->pattern().for_each(
        [&](Eigen::Index, int, int c) { found = found || !in_lagrangian[static_cast<std::size_t>(c)]; });
  }
  return found;
}

MotionRates::MotionRates(const Scene& scene, const SolverFactory& solvers) {
  if (has_accelerations(scene))
    with_mass_ = std::make_unique<PointwiseLinearisation>(scene, solvers);
  else
    massless_ = std::make_unique<MasslessMotion>(scene, solvers);
}

MotionRates::~MotionRates() = default;

MotionRates::Rates MotionRates::at(const Sample& point) {
  return with_mass_ ? with_mass_->rates(point) : Rates{massless_->decay_rate(point), 0.0};
}

}  // namespace diracstep
