#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/validation/references/ida_reference.hpp>
#include <limits>
#include <string>

/// Scenes with closed forms for the tests of IDA, and what is measured on its runs.
namespace diracstep::reference_scenes {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

inline ReferenceOptions at(double rtol) {
  ReferenceOptions options;
  options.rtol = rtol;
  options.max_steps = 50'000;  // twice what the longest run needs: a broken system fails soon
  return options;
}

inline double largest(const Vector& column) {
  return column.size() == 0 ? 0.0 : column.lpNorm<Eigen::Infinity>();
}

inline double error(const CatalogueScene& entry, const Sample& sample) {
  const auto exact = entry.reference.at(sample.time);
  return std::max(largest(sample.q - exact->q), largest(sample.v - exact->v));
}

/// The largest of A v + b, and of φ for holonomic rows.
inline double row_residual(const Scene& scene, const Sample& sample) {
  double size = 0.0;
  for (const auto& rows : scene.constraints) {
    Vector a(rows->pattern().nonzeros()), residual(rows->rows());
    rows->coefficients(sample.time, sample.q, a, residual);
    rows->pattern().multiply_add(a.data(), sample.v.data(), residual.data());
    size = std::max(size, largest(residual));
    if (!rows->holonomic()) continue;
    rows->position(sample.time, sample.q, residual);
    size = std::max(size, largest(residual));
  }
  return size;
}

template <int N, class L>
inline Scene make(L formula, ConstraintBlocks constraints, const std::array<double, N>& q,
                  const std::array<double, N>& v) {
  Scene scene;
  scene.name = "test";
  for (int i = 0; i < N; ++i) scene.coordinates.push_back("q" + std::to_string(i));
  scene.lagrangian = lagrangian<N>(formula);
  scene.constraints = std::move(constraints);
  scene.start = {0.0, Eigen::Map<const Vector>(q.data(), N), Eigen::Map<const Vector>(v.data(), N)};
  return scene;
}

struct UnitMass {
  template <class T, std::size_t N>
  T operator()(const std::array<T, N>&, const std::array<T, N>& v) const {
    T energy = 0.5 * v[0] * v[0];
    for (std::size_t i = 1; i < N; ++i) energy += 0.5 * v[i] * v[i];
    return energy;
  }
};

/// v_x + sin t = 0.
inline Scene driven_particle() {
  const auto rows = []<class T>(const std::array<T, 2>&) {
    return std::array<std::array<T, 2>, 1>{{{T(1.0), T(0.0)}}};
  };
  const auto offset = []<class T>(const std::array<T, 2>&, const T& t) {
    using std::sin;
    return std::array<T, 1>{sin(t)};
  };
  return make<2>(UnitMass{}, {affine<2, 1>(rows, offset)}, {0.0, 0.0}, {0.0, 1.0});
}

/// A bead on a line through the origin that turns at unit rate: y cos t − x sin t = 0.
inline Scene bead_on_turning_line() {
  const auto line = []<class T>(const std::array<T, 2>& q, const T& t) {
    using std::cos, std::sin;
    return std::array<T, 1>{q[1] * cos(t) - q[0] * sin(t)};
  };
  return make<2>(UnitMass{}, {holonomic<2, 1>(line)}, {1.0, 0.0}, {0.0, 1.0});
}

/// e^t (v² − q²)/2: a damped oscillator, q̈ + q̇ + q = 0.
inline Scene damped_oscillator() {
  const auto formula = []<class T>(const std::array<T, 1>& q, const std::array<T, 1>& v, const T& t) {
    using std::exp;
    return 0.5 * exp(t) * (v[0] * v[0] - q[0] * q[0]);
  };
  return make<1>(formula, {}, {1.0}, {0.0});
}

/// Pairs of unit masses on springs 1, 2, … tied together by q_2k = q_2k+1: 3·14 + 2·7 = 56 unknowns.
constexpr int tied = 14;
inline Scene tied_oscillators() {
  const auto formula = []<class T>(const std::array<T, tied>& q, const std::array<T, tied>& v) {
    T sum = UnitMass{}(q, v);
    for (std::size_t i = 0; i < tied; ++i) sum -= 0.5 * (1.0 + static_cast<double>(i)) * q[i] * q[i];
    return sum;
  };
  const auto ties = []<class T>(const std::array<T, tied>& q) {
    std::array<T, tied / 2> phi;
    for (std::size_t k = 0; k < phi.size(); ++k) phi[k] = q[2 * k] - q[2 * k + 1];
    return phi;
  };
  std::array<double, tied> ones;
  ones.fill(1.0);
  return make<tied>(formula, {holonomic<tied, tied / 2>(ties)}, ones, {});
}

}  // namespace diracstep::reference_scenes
