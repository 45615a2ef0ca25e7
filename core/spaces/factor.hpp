#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace diracstep::spaces {

/// Factors of a configuration space: Lie groups, and spheres as quotients of them.
///
/// The one convention, here and everywhere: left-trivialised; increments multiply from the right, velocities
/// and momenta are in the body, and a rotation is stored as a unit quaternion (w, x, y, z).
///
/// A factor is a type with static members, written for numbers and for jets (any T with + − * /):
///
///   storage, group, dimension   how many numbers a configuration has, how many an element of the Lie
///   algebra,
///                               and how many of those, the first ones, are velocities of the scene
///   name                        "SO3"
///   identity<T>()               e
///   product(a, b)               a b
///   retract(x)                  τ(x), with τ(0) = e and τ(−x) = τ(x)⁻¹
///   dtau(x, v)                  dτ_x v = τ(x)⁻¹ d/dε τ(x + ε v)
///   adjoint(g, v)               Ad_g v = g v g⁻¹
///   bracket(v, w)               ad_v w
///   normalise(g)                onto the space, from round-off beside it
///   part_of_chart(x)            |x| in parts of what τ is injective up to, 0 where it is so everywhere
///
/// space_axiom_defects() (spaces/axioms.hpp) measures whether a type fulfils all this.  Retractions: the
/// exponential, and Cayley's (1 − x/2)⁻¹(1 + x/2), which is rational and reaches every angle below π.
/// Sources: Bou-Rabee, Marsden, Hamilton-Pontryagin integrators on Lie groups, Found. Comput. Math. 9 (2009);
/// dexp of SE(3): Selig, Geometric Fundamentals of Robotics, 2nd ed., Springer (2005), 7.4.
enum class Retraction { exponential, cayley };

/// A column of numbers or of jets.
template <class T, std::size_t N>
using Numbers = std::array<T, N>;

/// R^N: τ(x) = x.
template <int N>
struct R {
  static constexpr int storage = N, group = N, dimension = N;
  static constexpr const char* name = "R";
  template <class T>
  using Column = Numbers<T, static_cast<std::size_t>(N)>;

  template <class T>
  static Column<T> identity() {
    Column<T> e;
    e.fill(T(0.0));
    return e;
  }
  template <class T>
  static Column<T> product(Column<T> a, const Column<T>& b) {
    for (std::size_t i = 0; i < a.size(); ++i) a[i] = a[i] + b[i];
    return a;
  }
  template <class T>
  static Column<T> retract(const Column<T>& x) {
    return x;
  }
  template <class T>
  static Column<T> dtau(const Column<T>&, const Column<T>& v) {
    return v;
  }
  template <class T>
  static Column<T> adjoint(const Column<T>&, const Column<T>& v) {
    return v;
  }
  template <class T>
  static Column<T> bracket(const Column<T>&, const Column<T>&) {
    return identity<T>();
  }
  static void normalise(Column<double>&) {}
  static double part_of_chart(const Column<double>&) { return 0.0; }
};

namespace detail {

template <class T>
Numbers<T, 3> cross(const Numbers<T, 3>& a, const Numbers<T, 3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <class T, std::size_t N>
T dot(const Numbers<T, N>& a, const Numbers<T, N>& b) {
  T sum = a[0] * b[0];
  for (std::size_t i = 1; i < N; ++i) sum = sum + a[i] * b[i];
  return sum;
}

/// Σ factors[k] columns[k]
template <class T, std::size_t N>
Numbers<T, N> sum(const T& a, const Numbers<T, N>& u, const T& b, const Numbers<T, N>& v, const T& c,
                  const Numbers<T, N>& w) {
  Numbers<T, N> y;
  for (std::size_t i = 0; i < N; ++i) y[i] = a * u[i] + b * v[i] + c * w[i];
  return y;
}

template <class T, std::size_t First, std::size_t Count, std::size_t N>
Numbers<T, Count> part(const Numbers<T, N>& x) {
  static_assert(First + Count <= N);
  Numbers<T, Count> y;
  for (std::size_t i = 0; i < Count; ++i) y[i] = x[First + i];
  return y;
}

/// (a; b)
template <class T, std::size_t M, std::size_t N>
Numbers<T, M + N> joined(const Numbers<T, M>& a, const Numbers<T, N>& b) {
  Numbers<T, M + N> y;
  for (std::size_t i = 0; i < M; ++i) y[i] = a[i];
  for (std::size_t i = 0; i < N; ++i) y[M + i] = b[i];
  return y;
}

/// To length 1; left as it is where it is zero or not finite.
template <std::size_t N, std::size_t Count>
void normalise_first(Numbers<double, N>& g) {
  double squares = 0.0;
  for (std::size_t i = 0; i < Count; ++i) squares += g[i] * g[i];
  if (!(squares > 0.0) || !std::isfinite(squares)) return;
  const double length = std::sqrt(squares);
  for (std::size_t i = 0; i < Count; ++i) g[i] /= length;
}

/// Rotations of a quaternion that need not be quite of length 1.
template <class T>
Numbers<T, 3> rotate(const Numbers<T, 4>& q, const Numbers<T, 3>& v) {
  const Numbers<T, 3> u = part<T, 1, 3>(q), uv = cross(u, v), uuv = cross(u, uv);
  return sum(T(1.0), v, T(2.0) * q[0], uv, T(2.0), uuv);
}

template <class T>
Numbers<T, 2> turn(const T& c, const T& s, const Numbers<T, 2>& v) {
  return {c * v[0] - s * v[1], s * v[0] + c * v[1]};
}

}  // namespace detail

}  // namespace diracstep::spaces
