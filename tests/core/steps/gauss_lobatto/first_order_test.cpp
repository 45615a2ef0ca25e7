#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <tuple>

#include "degenerate_cases.hpp"
#include "extrapolation.hpp"
#include "methods.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::DegenerateCase;
using testing::distance;
using testing::gl;
using testing::LongMatrix;
using testing::LongReal;
using testing::LongVector;
using testing::samples_of;

template <class T>
using Three = std::array<T, 3>;

/// Parts of L = θ(t,q)·v − H(q), whose two-form has rank 2 in three coordinates, and a force.
struct OneForm {
  template <class T>
  Three<T> operator()(const Three<T>& q, const T& t) const {
    using std::sin;
    const auto& [x, y, z] = q;
    return {-0.5 * y * (1.0 + 0.3 * x * x) + 0.2 * sin(z) * x + 0.1 * sin(t) * y, 0.5 * x + 0.1 * x * y * z,
            0.3 * x * y + 0.1 * z * z};
  }
};
struct Energy {
  template <class T>
  T operator()(const Three<T>& q) const {
    using std::cos;
    const auto& [x, y, z] = q;
    return 0.5 * (x * x + 1.3 * y * y) + 0.2 * x * x * x * x + 0.3 * cos(z) * x + 0.4 * z * z;
  }
};
struct Damping {
  template <class T>
  Three<T> operator()(const Three<T>& q, const Three<T>& v, const T& t) const {
    using std::cos;
    return {-0.1 * v[0] + 0.05 * q[1], -0.2 * v[1] * (1.0 + q[0]), -0.1 * v[2] + 0.1 * cos(t)};
  }
};
struct NoForce {
  template <class T>
  Three<T> operator()(const Three<T>&, const Three<T>&, const T&) const {
    return {T(0.0), T(0.0), T(0.0)};
  }
};

/// Rows: A and b, and φ where they are holonomic.
struct Moving {
  static constexpr bool holonomic = false;
  template <class T>
  Three<T> form(const Three<T>& q, const T&) const {
    using std::sin;
    return {0.3 * q[1], 0.2 * sin(q[0] + q[2]), T(1.0)};
  }
  template <class T>
  T offset(const Three<T>& q, const T& t) const {
    using std::cos;
    return -0.4 * cos(2.0 * t) + 0.1 * q[0];
  }
};
struct Still {
  static constexpr bool holonomic = false;
  template <class T>
  Three<T> form(const Three<T>& q, const T&) const {
    return {0.2 * q[2], T(0.1), 1.0 + 0.1 * q[0] * q[0]};
  }
  template <class T>
  T offset(const Three<T>&, const T&) const {
    return T(0.0);
  }
};
struct Surface {
  static constexpr bool holonomic = true;
  template <class T>
  T position(const Three<T>& q, const T& t) const {
    using std::sin;
    return q[2] + 0.3 * q[0] * q[0] - 0.2 * sin(q[1]) - 0.5 * sin(t) - 0.3;
  }
  template <class T>
  Three<T> form(const Three<T>& q, const T&) const {
    using std::cos;
    return {0.6 * q[0], -0.2 * cos(q[1]), T(1.0)};
  }
  template <class T>
  T offset(const Three<T>&, const T& t) const {
    using std::cos;
    return -0.5 * cos(t);
  }
};
struct Bowl {
  static constexpr bool holonomic = true;
  template <class T>
  T position(const Three<T>& q, const T&) const {
    return q[2] - 0.2 * q[0] * q[0] - 0.3 * q[1] * q[1] + 0.1 * q[2] * q[2];
  }
  template <class T>
  Three<T> form(const Three<T>& q, const T&) const {
    return {-0.4 * q[0], -0.6 * q[1], 1.0 + 0.2 * q[2]};
  }
  template <class T>
  T offset(const Three<T>&, const T&) const {
    return T(0.0);
  }
};

Three<LongReal> array_of(const LongVector& q) { return {q[0], q[1], q[2]}; }
LongVector column_of(const Three<LongReal>& q) { return LongVector{{q[0], q[1], q[2]}}; }

/// (v, Λ) of (Dθ − Dθᵀ) v = −∇H − ∂θ/∂t + f + AᵀΛ, A v + b = 0.
template <class Rows, class Push>
LongVector reduced(LongReal t, const LongVector& q) {
  const auto theta = [](const LongVector& at) {
    return column_of(OneForm()(Three<LongReal>{at[0], at[1], at[2]}, at[3]));
  };
  LongVector qt(4);
  qt << q, t;
  const LongMatrix d = testing::long_jacobian(theta, qt);
  const LongMatrix gradient = testing::long_jacobian(
      [](const LongVector& at) { return LongVector::Constant(1, Energy()(array_of(at))); }, q);
  const auto push = [&](const LongVector& v) { return column_of(Push()(array_of(q), array_of(v), t)); };
  const LongVector rest = push(LongVector::Zero(3)), form = column_of(Rows().form(array_of(q), t));
  LongMatrix system = LongMatrix::Zero(4, 4);
  system.topLeftCorner(3, 3) = d.leftCols(3) - d.leftCols(3).transpose();
  for (int j = 0; j < 3; ++j) system.col(j).head(3) -= push(LongVector::Unit(3, j)) - rest;
  system.topRightCorner(3, 1) = -form;
  system.bottomLeftCorner(1, 3) = form.transpose();
  LongVector right(4);
  right << -gradient.transpose() - d.col(3) + rest, -Rows().offset(array_of(q), t);
  return system.fullPivLu().solve(right);
}

template <class Rows, class Push>
DegenerateCase phase_space_case(const std::string& name) {
  Scene scene;
  scene.name = name;
  scene.coordinates = {"x", "y", "z"};
  scene.lagrangian = lagrangian<3>([]<class T>(const Three<T>& q, const Three<T>& v, const T& t) {
    const Three<T> theta = OneForm()(q, t);
    return theta[0] * v[0] + theta[1] * v[1] + theta[2] * v[2] - Energy()(q);
  });
  if constexpr (Rows::holonomic)
    scene.constraints = {holonomic<3, 1>(
        []<class T>(const Three<T>& q, const T& t) { return std::array<T, 1>{Rows().position(q, t)}; },
        {"row"})};
  else
    scene.constraints = {affine<3, 1>(
        []<class T>(const Three<T>& q, const T& t) { return std::array<Three<T>, 1>{Rows().form(q, t)}; },
        []<class T>(const Three<T>& q, const T& t) { return std::array<T, 1>{Rows().offset(q, t)}; },
        {"row"})};
  scene.force = force<3>(Push());
  scene.start.q = Vector{{0.7, 0.4, 0.0}};
  if constexpr (Rows::holonomic)
    for (int k = 0; k < 60; ++k)
      scene.start.q[2] -= Rows().position(Three<double>{0.7, 0.4, scene.start.q[2]}, 0.0);
  const LongVector end = testing::extrapolated(
      [](LongReal t, const LongVector& q) { return LongVector(reduced<Rows, Push>(t, q).head(3)); },
      scene.start.q.cast<LongReal>(), 1.0L);
  const LongVector last = reduced<Rows, Push>(1.0L, end);
  return {std::make_shared<const Scene>(scene), end.cast<double>(), last.tail(1).cast<double>()};
}

/// L = v_x²/2 + z v_y − V: x of second order, y and z of first.
template <class T>
T mixed_potential(const T& x, const T& y, const T& z) {
  return 0.5 * x * x + 0.4 * y * y + 0.5 * z * z + 0.3 * x * y + 0.2 * x * x * z;
}

DegenerateCase mixed_order() {
  Scene scene;
  scene.name = "mixed order";
  scene.coordinates = {"x", "y", "z"};
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * v[0] * v[0] + q[2] * v[1] - mixed_potential(q[0], q[1], q[2]);
  });
  scene.start = {0.0, Vector{{0.5, 0.3, -0.2}}, Vector{{0.4, 0.0, 0.0}}};
  const LongVector end = testing::extrapolated(
      [](LongReal, const LongVector& s) {
        const LongReal x = s[0], y = s[1], z = s[2];
        return LongVector{{s[3], z + 0.2L * x * x, -0.8L * y - 0.3L * x, -x - 0.3L * y - 0.4L * x * z}};
      },
      LongVector{{0.5L, 0.3L, -0.2L, 0.4L}}, 1.0L);
  return {std::make_shared<const Scene>(scene), end.head(3).cast<double>(), {}};
}

/// L = (1 + y²/5) v_x²/2 + (z + 3x²/10 + sin t/5) v_y − V with damping and a clock w, v_w = 1 + x/2, that
/// pushes x.
DegenerateCase mixed_order_with_row() {
  Scene scene;
  scene.name = "mixed order with a row";
  scene.coordinates = {"x", "y", "z", "w"};
  scene.lagrangian =
      lagrangian<4>([]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& v, const T& t) {
        using std::cos, std::sin;
        return 0.5 * (1.0 + 0.2 * q[1] * q[1]) * v[0] * v[0] +
               (q[2] + 0.3 * q[0] * q[0] + 0.2 * sin(t)) * v[1] - mixed_potential(q[0], q[1], q[2]) +
               0.1 * q[0] * sin(q[3]);
      });
  scene.constraints = {affine<4, 1>(
      []<class T>(const std::array<T, 4>&) {
        return std::array<std::array<T, 4>, 1>{{{T(0.0), T(0.0), T(0.0), T(1.0)}}};
      },
      []<class T>(const std::array<T, 4>& q) { return std::array<T, 1>{-1.0 - 0.5 * q[0]}; }, {"clock"})};
  scene.force = force<4>([]<class T>(const std::array<T, 4>&, const std::array<T, 4>& v) {
    return std::array<T, 4>{-0.3 * v[0], -0.2 * v[1], -0.1 * v[2], T(0.0)};
  });
  scene.start = {0.0, Vector{{0.5, 0.3, -0.2, 0.1}}, Vector{{0.4, 0.0, 0.0, 1.25}}};
  // State (x, y, z, w, p_x); of y and z: ż + 0.6 x u + cos t/5 = 0.2 y u² − V_y − 0.2 ẏ, 0 = ẏ − V_z − 0.1 ż.
  const LongVector end = testing::extrapolated(
      [](LongReal t, const LongVector& s) {
        const LongReal x = s[0], y = s[1], z = s[2], u = s[4] / (1 + 0.2L * y * y);
        const LongReal by_y = 0.2L * y * u * u - (0.8L * y + 0.3L * x) - 0.6L * x * u - 0.2L * std::cos(t),
                       by_z = z + 0.2L * x * x;
        // ż + 0.2 ẏ = by_y,  ẏ − 0.1 ż = by_z
        const LongReal rate_z = (by_y - 0.2L * by_z) / 1.02L, rate_y = by_z + 0.1L * rate_z;
        const LongReal push =
            0.6L * x * rate_y - x - 0.3L * y - 0.4L * x * z + 0.1L * std::sin(s[3]) - 0.3L * u;
        return LongVector{{u, rate_y, rate_z, 1 + 0.5L * x, push}};
      },
      LongVector{{0.5L, 0.3L, -0.2L, 0.1L, 0.4L * (1 + 0.2L * 0.09L)}}, 1.0L);
  const double x = static_cast<double>(end[0]), w = static_cast<double>(end[3]);
  return {std::make_shared<const Scene>(scene), end.head(4).cast<double>(), Vector{{-0.1 * x * std::cos(w)}}};
}

const std::vector<DegenerateCase>& every_case() {
  static const std::vector<DegenerateCase> cases{phase_space_case<Moving, Damping>("nonholonomic, forced"),
                                                 phase_space_case<Still, NoForce>("nonholonomic"),
                                                 phase_space_case<Surface, Damping>("holonomic, forced"),
                                                 phase_space_case<Bowl, NoForce>("holonomic"),
                                                 mixed_order(),
                                                 mixed_order_with_row()};
  return cases;
}

TEST(FirstOrderStep, OrderIsTwiceTheStagesInPositionsAndForcesOfRows) {
  for (const DegenerateCase& that : every_case())
    for (const auto& [s, steps] : {std::pair{1, 40L}, {2, 10L}, {3, 6L}})
      testing::expect_order_of_stages(that, s, steps, 1e-13);
}

TEST(FirstOrderStep, RadauHasItsOrder) {
  for (const DegenerateCase& that : every_case()) {
    const double first = testing::error_at_end(that, "damped/radau:2", 20),
                 second = testing::error_at_end(that, "damped/radau:2", 40);
    EXPECT_NEAR(std::log2(first / second), 3.0, 0.5)
        << that.scene->name << " errors " << first << " " << second;
  }
}

TEST(FirstOrderStep, JacobianAgreesWithDifferences) {
  for (const DegenerateCase& that : every_case())
    for (const int s : {1, 2}) testing::expect_exact_jacobian(that, s);
}

TEST(FirstOrderStep, KeepsRowsAndPrimaryConstraint) {
  for (const DegenerateCase& that : every_case()) {
    const auto samples = samples_of(that.scene, {.method = gl(2), .step = 0.05}, 200);
    Vector lq(that.scene->dimension()), p(lq.size());
    for (const Sample& at : samples) {
      that.scene->lagrangian->gradient(at.time, at.q, at.v, lq, p);
      EXPECT_LT(distance(at.p, p), 1e-12) << that.scene->name;
      testing::expect_on_holonomic_rows(*that.scene, at);
    }
  }
}

TEST(FirstOrderStep, IsSelfAdjoint) {
  for (const DegenerateCase& that : every_case())
    for (const int s : {1, 2, 3}) testing::expect_self_adjoint(that, s, 1e-13);
}

TEST(FirstOrderStep, WhatIsNotDeterminedIsRefusedWithItsDirection) {
  Scene scene;
  scene.name = "row twice";  // so that nothing tells how the force is shared
  scene.coordinates = {"x", "y", "px", "py", "a"};
  scene.lagrangian = lagrangian<5>([](const auto& q, const auto& v) {
    return q[2] * v[0] + q[3] * v[1] - 0.5 * (q[2] * q[2] + q[3] * q[3] + q[0] * q[0] + q[1] * q[1]) +
           q[4] * q[0];
  });
  scene.constraints = {
      holonomic<5, 1>([]<class T>(const std::array<T, 5>& q) { return std::array<T, 1>{q[0]}; }, {"wall"})};
  scene.start = {0.0, Vector::Zero(5), Vector::Zero(5)};
  testing::expect_misuse(
      [&] {
        const Integrator taken(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                               {.method = gl(2), .step = 0.1});
      },
      {"'row twice'", "the velocity along 'a'", "there twice"});
}

/// Two conductors side by side, one of them not linear, behind an inertia: steps leave the momentum up to the
/// impulse of the row, so that velocities read by it had the order 1.
TEST(VelocitiesByForce, HaveTheOrderOfTheMethodBesideRows) {
  Scene scene;
  scene.name = "conductors";
  scene.coordinates = {"x", "a", "b"};
  scene.lagrangian =
      lagrangian<3>([](const auto& q, const auto& v) { return 0.5 * v[0] * v[0] - 0.5 * q[0] * q[0]; });
  scene.force = force<3>([]<class T>(const Three<T>&, const Three<T>& v, const T& t) {
    using std::cos;
    return Three<T>{cos(t), -v[1] - v[1] * v[1] * v[1], -2.0 * v[2]};
  });
  scene.constraints = {pfaffian<3, 1>(
      []<class T>(const Three<T>&) {
        return std::array<Three<T>, 1>{{{T(1.0), T(-1.0), T(-1.0)}}};
      },
      {"node"})};
  scene.start = {0.0, Vector::Zero(3), Vector::Zero(3)};
  const auto push = [](LongReal v) {  // u of  v = a + u/2, u = a + a³
    LongReal a = v / 2;
    for (int k = 0; k < 60; ++k) a -= (1.5L * a + a * a * a / 2 - v) / (1.5L + 1.5L * a * a);
    return a + a * a * a;
  };
  const LongVector end = testing::extrapolated(
      [push](LongReal t, const LongVector& y) {
        return LongVector{{y[1], std::cos(t) - y[0] - push(y[1])}};
      },
      LongVector{{0.0L, 0.0L}}, 1.0L);
  ASSERT_TRUE(first_order_motions(scene).by_force);
  for (const auto& [method, order, steps] :
       {std::tuple{std::string("type1/midpoint"), 2, 10L}, {gl(2), 4, 5L}, {gl(3), 6, 3L}}) {
    std::array<double, 2> errors{};
    for (std::size_t k = 0; k < 2; ++k) {
      const long count = steps << k;
      const Sample at = samples_of(std::make_shared<const Scene>(scene),
                                   {.method = method, .step = 1.0 / static_cast<double>(count)}, count)
                            .back();
      errors.at(k) = std::max(std::abs(at.v[0] - static_cast<double>(end[1])),
                              std::abs(at.lambda[0] + static_cast<double>(push(end[1]))));
    }
    EXPECT_NEAR(std::log2(errors[0] / errors[1]), order, 0.6)
        << method << " errors " << errors[0] << " " << errors[1];
  }
}

}  // namespace
}  // namespace diracstep
