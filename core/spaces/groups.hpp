#pragma once

#include <cmath>
#include <diracstep/core/spaces/factor.hpp>
#include <diracstep/core/spaces/stumpff.hpp>
#include <numbers>

namespace diracstep::spaces {

/// The matrix R of a unit quaternion (w, x, y, z), R[i][j], for the formulas of a scene: a vector of the body
/// is R v in space.
template <class T>
Numbers<Numbers<T, 3>, 3> rotation_matrix(const T& w, const T& x, const T& y, const T& z) {
  const T two(2.0), ww = w * w, xx = x * x, yy = y * y, zz = z * z;
  const T wx = w * x, wy = w * y, wz = w * z, xy = x * y, xz = x * z, yz = y * z;
  return {{{ww + xx - yy - zz, two * (xy - wz), two * (xz + wy)},
           {two * (xy + wz), ww - xx + yy - zz, two * (yz - wx)},
           {two * (xz - wy), two * (yz + wx), ww - xx - yy + zz}}};
}

/// Rotations of space, by unit quaternions (w, x, y, z).
template <Retraction kind = Retraction::exponential>
struct RotationsBy {
  static constexpr int storage = 4, group = 3, dimension = 3;
  static constexpr const char* name = "SO3";
  template <class T>
  using Rotation = Numbers<T, 4>;
  template <class T>
  using Rate = Numbers<T, 3>;

  template <class T>
  static Rotation<T> identity() {
    return {T(1.0), T(0.0), T(0.0), T(0.0)};
  }
  template <class T>
  static Rotation<T> product(const Rotation<T>& a, const Rotation<T>& b) {
    return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
            a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1]};
  }
  template <class T>
  static Rotation<T> retract(const Rate<T>& x) {
    using std::sqrt;
    const T quarter = detail::dot(x, x) * T(0.25);
    if constexpr (kind == Retraction::exponential) {
      const T s = stumpff(1, quarter) * T(0.5);
      return {stumpff(0, quarter), s * x[0], s * x[1], s * x[2]};
    } else {
      const T c = T(1.0) / sqrt(T(1.0) + quarter), s = c * T(0.5);
      return {c, s * x[0], s * x[1], s * x[2]};
    }
  }
  /// exp: 1 − (1 − cos θ)/θ² x^ + (θ − sin θ)/θ³ x^²,   Cayley: 4/(4 + θ²) (1 − x^/2),   applied to v.
  template <class T>
  static Rate<T> dtau(const Rate<T>& x, const Rate<T>& v) {
    const T s = detail::dot(x, x);
    const Rate<T> xv = detail::cross(x, v);
    if constexpr (kind == Retraction::exponential)
      return detail::sum(T(1.0), v, -stumpff(2, s), xv, stumpff(3, s), detail::cross(x, xv));
    const T f = T(4.0) / (T(4.0) + s);
    return detail::sum(f, v, f * T(-0.5), xv, T(0.0), v);
  }
  template <class T>
  static Rate<T> adjoint(const Rotation<T>& g, const Rate<T>& v) {
    return detail::rotate(g, v);
  }
  template <class T>
  static Rate<T> bracket(const Rate<T>& v, const Rate<T>& w) {
    return detail::cross(v, w);
  }
  static void normalise(Rotation<double>& g) { detail::normalise_first<4, 4>(g); }
  static double part_of_chart(const Rate<double>& x) {
    return kind == Retraction::cayley ? 0.0 : std::sqrt(detail::dot(x, x)) / std::numbers::pi;
  }
};
using SO3 = RotationsBy<>;

/// The unit sphere: q = R e₃ with a rotation R, whose rate has two components; what the scene depends on is q
/// and q' = R (ω₂, −ω₁, 0) alone, so that no turn about q is ever seen.
template <Retraction kind = Retraction::exponential>
struct SphereBy : RotationsBy<kind> {
  static constexpr int dimension = 2;
  static constexpr const char* name = "S2";
};
using S2 = SphereBy<>;

/// Rotations of the plane, by (cos, sin): S¹.
template <Retraction kind = Retraction::exponential>
struct CircleBy {
  static constexpr int storage = 2, group = 1, dimension = 1;
  static constexpr const char* name = "S1";
  template <class T>
  using Angle = Numbers<T, 2>;
  template <class T>
  using Rate = Numbers<T, 1>;

  template <class T>
  static Angle<T> identity() {
    return {T(1.0), T(0.0)};
  }
  template <class T>
  static Angle<T> product(const Angle<T>& a, const Angle<T>& b) {
    return detail::turn(a[0], a[1], b);
  }
  template <class T>
  static Angle<T> retract(const Rate<T>& x) {
    using std::cos, std::sin;
    if constexpr (kind == Retraction::exponential) return {cos(x[0]), sin(x[0])};
    const T quarter = x[0] * x[0] * T(0.25), f = T(1.0) / (T(1.0) + quarter);
    return {(T(1.0) - quarter) * f, x[0] * f};
  }
  template <class T>
  static Rate<T> dtau(const Rate<T>& x, const Rate<T>& v) {
    if constexpr (kind == Retraction::exponential) return v;
    return {v[0] * T(4.0) / (T(4.0) + x[0] * x[0])};
  }
  template <class T>
  static Rate<T> adjoint(const Angle<T>&, const Rate<T>& v) {
    return v;
  }
  template <class T>
  static Rate<T> bracket(const Rate<T>&, const Rate<T>&) {
    return {T(0.0)};
  }
  static void normalise(Angle<double>& g) { detail::normalise_first<2, 2>(g); }
  static double part_of_chart(const Rate<double>& x) {
    return kind == Retraction::cayley ? 0.0 : std::abs(x[0]) / std::numbers::pi;
  }
};
using S1 = CircleBy<>;

/// Motions of the plane (cos, sin, x, y), with rates (ω, v_x, v_y): v is the velocity of the origin in the
/// body.
template <Retraction kind = Retraction::exponential>
struct PlaneMotionsBy {
  static constexpr int storage = 4, group = 3, dimension = 3;
  static constexpr const char* name = "SE2";
  template <class T>
  using Pose = Numbers<T, 4>;
  template <class T>
  using Rate = Numbers<T, 3>;

  template <class T>
  static Pose<T> identity() {
    return {T(1.0), T(0.0), T(0.0), T(0.0)};
  }
  template <class T>
  static Pose<T> product(const Pose<T>& a, const Pose<T>& b) {
    const Numbers<T, 2> r = detail::turn(a[0], a[1], detail::part<T, 0, 2>(b)),
                        x = detail::turn(a[0], a[1], detail::part<T, 2, 2>(b));
    return {r[0], r[1], a[2] + x[0], a[3] + x[1]};
  }
  template <class T>
  static Pose<T> retract(const Rate<T>& x) {
    const Numbers<T, 2> r = CircleBy<kind>::retract(Numbers<T, 1>{x[0]}), u = {x[1], x[2]};
    const T s = x[0] * x[0];
    const Numbers<T, 2> moved = kind == Retraction::exponential
                                    ? detail::turn(stumpff(1, s), x[0] * stumpff(2, s), u)
                                    : detail::turn(T(4.0) / (T(4.0) + s), T(2.0) * x[0] / (T(4.0) + s), u);
    return {r[0], r[1], moved[0], moved[1]};
  }
  /// exp: 1 − c_2 ad_x + c_3 ad_x², since ad_x³ = −θ² ad_x.
  template <class T>
  static Rate<T> dtau(const Rate<T>& x, const Rate<T>& v) {
    const T s = x[0] * x[0];
    if constexpr (kind == Retraction::exponential) {
      const Rate<T> once = bracket(x, v);
      return detail::sum(T(1.0), v, -stumpff(2, s), once, stumpff(3, s), bracket(x, once));
    }
    // N (ν + ω J M u/2) with M = (1 − θJ/2)⁻¹, N = Mᵀ
    const T f = T(4.0) / (T(4.0) + s), g = f * x[0] * T(0.5);
    const Numbers<T, 2> m = detail::turn(f, g, Numbers<T, 2>{x[1], x[2]});
    const T half = v[0] * T(0.5);
    const Numbers<T, 2> n = detail::turn(f, -g, Numbers<T, 2>{v[1] - half * m[1], v[2] + half * m[0]});
    return {f * v[0], n[0], n[1]};
  }
  template <class T>
  static Rate<T> adjoint(const Pose<T>& g, const Rate<T>& v) {
    const Numbers<T, 2> u = detail::turn(g[0], g[1], Numbers<T, 2>{v[1], v[2]});
    return {v[0], u[0] + v[0] * g[3], u[1] - v[0] * g[2]};
  }
  template <class T>
  static Rate<T> bracket(const Rate<T>& v, const Rate<T>& w) {
    return {T(0.0), w[0] * v[2] - v[0] * w[2], v[0] * w[1] - w[0] * v[1]};
  }
  static void normalise(Pose<double>& g) { detail::normalise_first<4, 2>(g); }
  static double part_of_chart(const Rate<double>& x) {
    return CircleBy<kind>::part_of_chart(Numbers<double, 1>{x[0]});
  }
};
using SE2 = PlaneMotionsBy<>;

/// Motions of space (w, x, y, z of the quaternion, then the position), with rates (ω, v): v is the velocity
/// of the origin in the body.
template <Retraction kind = Retraction::exponential>
struct MotionsBy {
  static constexpr int storage = 7, group = 6, dimension = 6;
  static constexpr const char* name = "SE3";
  using Rotations = RotationsBy<kind>;
  template <class T>
  using Pose = Numbers<T, 7>;
  template <class T>
  using Rate = Numbers<T, 6>;

  template <class T>
  static Pose<T> identity() {
    return detail::joined(Rotations::template identity<T>(), R<3>::identity<T>());
  }
  template <class T>
  static Pose<T> product(const Pose<T>& a, const Pose<T>& b) {
    const Numbers<T, 4> r = detail::part<T, 0, 4>(a);
    return detail::joined(
        Rotations::product(r, detail::part<T, 0, 4>(b)),
        R<3>::product(detail::part<T, 4, 3>(a), detail::rotate(r, detail::part<T, 4, 3>(b))));
  }
  template <class T>
  static Pose<T> retract(const Rate<T>& x) {
    const Numbers<T, 3> w = angular(x);
    return detail::joined(Rotations::retract(w), moved(w, linear(x)));
  }
  /// exp: a polynomial of fourth degree in ad_x, since ad_x (ad_x² + θ²)² = 0.
  template <class T>
  static Rate<T> dtau(const Rate<T>& x, const Rate<T>& v) {
    const Numbers<T, 3> w = angular(x);
    const T s = detail::dot(w, w);
    if constexpr (kind == Retraction::exponential) {
      const T c2 = stumpff(2, s), c3 = stumpff(3, s), c4 = stumpff(4, s), half(0.5);
      const T a1 = half * stumpff(1, s) - T(2.0) * c2, a2 = half * (T(5.0) * c3 - c2), a3 = c4 - half * c3,
              a4 = half * (c4 - T(3.0) * stumpff(5, s));
      const Rate<T> first = bracket(x, v), second = bracket(x, first), third = bracket(x, second);
      const Rate<T> low = detail::sum(T(1.0), v, a1, first, a2, second);
      return detail::sum(T(1.0), low, a3, third, a4, bracket(x, third));
    }
    // N (ν − (M u) × ω/2) with M = (1 − w^/2)⁻¹, N = Mᵀ
    const Numbers<T, 3> across = detail::cross(moved(w, linear(x)), angular(v));
    const Numbers<T, 3> pushed = detail::sum(T(1.0), linear(v), T(-0.5), across, T(0.0), across);
    return detail::joined(Rotations::dtau(w, angular(v)),
                          moved(detail::sum(T(-1.0), w, T(0.0), w, T(0.0), w), pushed));
  }
  template <class T>
  static Rate<T> adjoint(const Pose<T>& g, const Rate<T>& v) {
    const Numbers<T, 4> r = detail::part<T, 0, 4>(g);
    const Numbers<T, 3> w = detail::rotate(r, angular(v));
    return detail::joined(
        w, R<3>::product(detail::rotate(r, linear(v)), detail::cross(detail::part<T, 4, 3>(g), w)));
  }
  template <class T>
  static Rate<T> bracket(const Rate<T>& v, const Rate<T>& w) {
    return detail::joined(
        detail::cross(angular(v), angular(w)),
        R<3>::product(detail::cross(angular(v), linear(w)), detail::cross(linear(v), angular(w))));
  }
  static void normalise(Pose<double>& g) { detail::normalise_first<7, 4>(g); }
  static double part_of_chart(const Rate<double>& x) { return Rotations::part_of_chart(angular(x)); }

 private:
  template <class T>
  static Numbers<T, 3> angular(const Rate<T>& x) {
    return detail::part<T, 0, 3>(x);
  }
  template <class T>
  static Numbers<T, 3> linear(const Rate<T>& x) {
    return detail::part<T, 3, 3>(x);
  }
  /// The position that τ(w, u) moves the origin to: (1 + c_2 w^ + c_3 w^²) u, or (1 − w^/2)⁻¹ u.
  template <class T>
  static Numbers<T, 3> moved(const Numbers<T, 3>& w, const Numbers<T, 3>& u) {
    const T s = detail::dot(w, w);
    const Numbers<T, 3> wu = detail::cross(w, u), wwu = detail::cross(w, wu);
    if constexpr (kind == Retraction::exponential)
      return detail::sum(T(1.0), u, stumpff(2, s), wu, stumpff(3, s), wwu);
    const T f = T(1.0) / (T(4.0) + s);
    return detail::sum(T(1.0), u, T(2.0) * f, wu, f, wwu);
  }
};
using SE3 = MotionsBy<>;

}  // namespace diracstep::spaces
