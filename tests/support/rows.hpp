#pragma once

#include <array>
#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <memory>

/// Constraint rows in three coordinates that depend on the time as well, two of each kind.
namespace diracstep::testing {

struct MovingForms {
  template <class T>
  std::array<std::array<T, 3>, 2> operator()(const std::array<T, 3>& q, const T& t) const {
    using std::cos, std::sin;
    return {{{sin(q[2] + t), -cos(q[2]), q[0] * q[1]}, {T(1.0), t * q[0], exp(0.3 * q[1])}}};
  }
};

struct MovingOffset {
  template <class T>
  std::array<T, 2> operator()(const std::array<T, 3>& q, const T& t) const {
    return {0.5 * t * t * q[1], q[0] * q[2] - 2.0 * t};
  }
};

struct MovingSurfaces {
  template <class T>
  std::array<T, 2> operator()(const std::array<T, 3>& q, const T& t) const {
    using std::cos, std::sin;
    return {q[0] * q[0] + q[1] * q[2] - t * q[0], sin(q[2] * t) + q[1] - 0.3 * t * t * t};
  }
};

inline std::shared_ptr<const ConstraintRows> moving_pfaffian() { return pfaffian<3, 2>(MovingForms{}); }
inline std::shared_ptr<const ConstraintRows> moving_affine() {
  return affine<3, 2>(MovingForms{}, MovingOffset{});
}
inline std::shared_ptr<const ConstraintRows> moving_holonomic() { return holonomic<3, 2>(MovingSurfaces{}); }

/// A and b of rows at a point.
struct RowsAt {
  RowsAt(const ConstraintRows& rows, double t, const Vector& q)
      : values(rows.pattern().nonzeros()), b(rows.rows()) {
    rows.coefficients(t, q, values, b);
  }
  Vector values, b;
};

}  // namespace diracstep::testing
