#pragma once

#include <array>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/core/spaces/groups.hpp>

namespace diracstep::spaces {

/// The maps of a factor G that a step takes, with their derivatives; matrices d×d by columns, d = G::group.
/// For any type by jets; closed forms where they take much less time are specialisations.
template <class G>
struct FactorDerivatives {
  static constexpr std::size_t d = static_cast<std::size_t>(G::group),
                               numbers = static_cast<std::size_t>(G::storage);
  using Algebra = Numbers<double, d>;
  using Element = Numbers<double, numbers>;

  /// Ad_{τ(x)}, Ad_{τ(−x)}, dτ_x and dτ_{−x}.
  static void maps(const Algebra& x, double* adjoint, double* adjoint_back, double* dtau, double* dtau_back) {
    Algebra back;
    for (std::size_t i = 0; i < d; ++i) back[i] = -x[i];
    const Element forth = G::retract(x), inverse = G::retract(back);
    for (std::size_t j = 0; j < d; ++j) {
      const Algebra e = unit<double>(j);
      put(G::adjoint(forth, e), adjoint + d * j);
      put(G::adjoint(inverse, e), adjoint_back + d * j);
      put(G::dtau(x, e), dtau + d * j);
      put(G::dtau(back, e), dtau_back + d * j);
    }
  }

  /// ∂(dτ_x)_{ij}/∂x_k at i + d j + d² k.
  static void dtau_derivative(const Algebra& x, double* out) {
    using T = Jet<G::group, 1>;
    const auto at = variables<T>(x);
    for (std::size_t j = 0; j < d; ++j) {
      const Numbers<T, d> column = G::dtau(at, unit<T>(j));
      for (std::size_t k = 0; k < d; ++k)
        for (std::size_t i = 0; i < d; ++i)
          out[i + d * (j + d * k)] = column[i].gradient(static_cast<int>(k));
    }
  }

  /// ∂²⟨p, dτ_x v⟩/∂x_i∂x_j.
  static void pairing_hessian(const Algebra& x, const Algebra& v, const Algebra& p, double* out) {
    using T = Jet<G::group, 2>;
    const Numbers<T, d> image = G::dtau(variables<T>(x), constants<T>(v));
    T sum(0.0);
    for (std::size_t i = 0; i < d; ++i) sum += image[i] * p[i];
    for (int j = 0; j < G::group; ++j)
      for (int i = 0; i < G::group; ++i) *out++ = sum.hessian(i, j);
  }

  /// B: d/dε g τ(ε e_j) in column j, storage×d.
  static void basis(const Element& g, double* out) {
    using T = Jet<G::group, 1>;
    const Numbers<T, numbers> moved = G::product(constants<T>(g), G::retract(variables<T>(Algebra{})));
    for (int j = 0; j < G::group; ++j)
      for (const T& entry : moved) *out++ = entry.gradient(j);
  }

  /// Σ_k w_k (derivative of B_ki along e_j) at (i, j), where w are as many numbers as g has:
  /// e_j B_i = ∂²(g τ(x))/∂x_i∂x_j + B [e_j, e_i]/2, by the formula of Baker, Campbell and Hausdorff.
  static void basis_curvature(const Element& g, const Element& w, double* out) {
    using T = Jet<G::group, 2>;
    const Numbers<T, numbers> moved = G::product(constants<T>(g), G::retract(variables<T>(Algebra{})));
    T sum(0.0);
    for (std::size_t k = 0; k < numbers; ++k) sum += moved[k] * w[k];
    for (std::size_t j = 0; j < d; ++j)
      for (std::size_t i = 0; i < d; ++i) {
        const Algebra turned = G::bracket(unit<double>(j), unit<double>(i));
        double value = sum.hessian(static_cast<int>(i), static_cast<int>(j));
        for (std::size_t k = 0; k < d; ++k) value += 0.5 * sum.gradient(static_cast<int>(k)) * turned[k];
        *out++ = value;
      }
  }

  template <class T>
  static Numbers<T, d> unit(std::size_t i) {
    Numbers<T, d> e;
    e.fill(T(0.0));
    e[i] = T(1.0);
    return e;
  }

 private:
  static void put(const Algebra& column, double* to) {
    for (const double entry : column) *to++ = entry;
  }
  template <class T>
  static Numbers<T, d> variables(const Algebra& x) {
    Numbers<T, d> to;
    for (std::size_t i = 0; i < d; ++i) to[i] = T::variable(x[i], static_cast<int>(i));
    return to;
  }
  template <class T, std::size_t N>
  static Numbers<T, N> constants(const Numbers<double, N>& x) {
    Numbers<T, N> to;
    for (std::size_t i = 0; i < N; ++i) to[i] = T(x[i]);
    return to;
  }
};

/// a 1 + b x^ + c x xᵀ, with a, b, c and their derivatives by s = |x|².
struct TurnCoefficients {
  std::array<double, 3> a, b, c;
};

/// Of dτ_x and of Ad_{τ(x)} for rotations.
template <Retraction kind>
struct RotationMaps {
  TurnCoefficients dtau, adjoint;

  explicit RotationMaps(double s) {
    if constexpr (kind == Retraction::exponential) {
      const std::array<double, 8> c = stumpff_values(s);
      const auto derivatives = [&](std::size_t k) -> std::array<double, 3> {
        const double n = static_cast<double>(k);
        return {c[k], 0.5 * (n * c[k + 2] - c[k + 1]),
                0.25 * (n * (n + 2.0) * c[k + 4] - (2.0 * n + 1.0) * c[k + 3] + c[k + 2])};
      };
      dtau = {derivatives(1), derivatives(2), derivatives(3)};
      for (double& b : dtau.b) b = -b;
      adjoint = {{c[0]}, {c[1]}, {c[2]}};
    } else {
      const double f = 4.0 / (4.0 + s);
      const std::array<double, 3> of_f{f, -0.25 * f * f, 0.125 * f * f * f};
      dtau = {of_f, {-0.5 * of_f[0], -0.5 * of_f[1], -0.5 * of_f[2]}, {}};
      adjoint = {{1.0 - 0.5 * f * s}, {f}, {0.5 * f}};
    }
  }
};

/// dτ_x is such a matrix, and dτ_{−x} its transpose, as Ad_{τ(−x)} is that of Ad_{τ(x)}.
template <Retraction kind>
struct FactorDerivatives<RotationsBy<kind>> {
  using Algebra = Numbers<double, 3>;
  using Element = Numbers<double, 4>;

  static void maps(const Algebra& x, double* adjoint, double* adjoint_back, double* dtau, double* dtau_back) {
    const RotationMaps<kind> of(detail::dot(x, x));
    put(of.adjoint, x, adjoint, adjoint_back);
    put(of.dtau, x, dtau, dtau_back);
  }

  static void dtau_derivative(const Algebra& x, double* out) {
    const TurnCoefficients of = RotationMaps<kind>(detail::dot(x, x)).dtau;
    for (std::size_t k = 0; k < 3; ++k) {
      double* slice = out + 9 * k;
      const double twice = 2.0 * x[k];
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t i = 0; i < 3; ++i)
          slice[i + 3 * j] = twice * of.c[1] * x[i] * x[j] + (i == k ? of.c[0] * x[j] : 0.0) +
                             (j == k ? of.c[0] * x[i] : 0.0);
      for (std::size_t i = 0; i < 3; ++i) {
        slice[4 * i] += twice * of.a[1];
        const std::size_t j = (i + 1) % 3, third = (i + 2) % 3;  // x^ is x_third at (j, i)
        const double turned = twice * of.b[1] * x[third] + (third == k ? of.b[0] : 0.0);
        slice[j + 3 * i] += turned;
        slice[i + 3 * j] -= turned;
      }
    }
  }

  /// With u = v × p: ⟨p, dτ_x v⟩ = a p·v + b x·u + c (p·x)(x·v).
  static void pairing_hessian(const Algebra& x, const Algebra& v, const Algebra& p, double* out) {
    const TurnCoefficients of = RotationMaps<kind>(detail::dot(x, x)).dtau;
    const Algebra u = detail::cross(v, p);
    const double pv = detail::dot(p, v), xu = detail::dot(x, u), px = detail::dot(p, x),
                 xv = detail::dot(x, v);
    const double first = 2.0 * (of.a[1] * pv + of.b[1] * xu + of.c[1] * px * xv),
                 second = 4.0 * (of.a[2] * pv + of.b[2] * xu + of.c[2] * px * xv);
    Algebra w;
    for (std::size_t i = 0; i < 3; ++i) w[i] = 2.0 * (of.b[1] * u[i] + of.c[1] * (p[i] * xv + v[i] * px));
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t i = 0; i < 3; ++i)
        *out++ = second * x[i] * x[j] + (i == j ? first : 0.0) + x[i] * w[j] + w[i] * x[j] +
                 of.c[0] * (p[i] * v[j] + v[i] * p[j]);
  }

  /// g e_j/2 as quaternions.
  static void basis(const Element& g, double* out) {
    for (std::size_t j = 0; j < 3; ++j)
      for (const double entry : RotationsBy<kind>::product(g, half(j))) *out++ = entry;
  }

  /// B is linear in g: e_j B_i = (g e_j/2) e_i/2.
  static void basis_curvature(const Element& g, const Element& w, double* out) {
    for (std::size_t j = 0; j < 3; ++j) {
      const Element moved = RotationsBy<kind>::product(g, half(j));
      for (std::size_t i = 0; i < 3; ++i) *out++ = detail::dot(w, RotationsBy<kind>::product(moved, half(i)));
    }
  }

 private:
  static Element half(std::size_t j) {
    Element e{};
    e[j + 1] = 0.5;
    return e;
  }
  static void put(const TurnCoefficients& of, const Algebra& x, double* to, double* transposed) {
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t i = 0; i < 3; ++i) {
        const double turned =
            i == j ? of.a[0] : (i == (j + 1) % 3 ? x[(j + 2) % 3] : -x[3 - i - j]) * of.b[0];
        to[i + 3 * j] = transposed[j + 3 * i] = turned + of.c[0] * x[i] * x[j];
      }
  }
};

template <Retraction kind>
struct FactorDerivatives<SphereBy<kind>> : FactorDerivatives<RotationsBy<kind>> {};

}  // namespace diracstep::spaces
