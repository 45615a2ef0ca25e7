#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace diracstep {

/// Forward automatic differentiation: the Taylor expansion of a formula in N variables, to first order
/// (value and gradient) or to second order (and the packed lower triangle of the Hessian).
///
/// A jet is a plain value: `auto` in a formula is safe, which expression-template scalars do not give.
/// Domain errors follow IEEE arithmetic: sqrt of a negative value is NaN, and so are its derivatives.
template <int N, int Order>
class Jet {
  static_assert(N > 0 && (Order == 1 || Order == 2));

 public:
  static constexpr int hessian_size = Order == 2 ? N * (N + 1) / 2 : 0;

  Jet() = default;
  Jet(double value) : value_(value) {}  // NOLINT(google-explicit-constructor): constants in formulas

  /// The variable number `index` at `value`.
  static Jet variable(double value, int index) {
    Jet x(value);
    x.gradient_[static_cast<std::size_t>(index)] = 1.0;
    return x;
  }

  double value() const { return value_; }
  double gradient(int i) const { return gradient_[static_cast<std::size_t>(i)]; }
  double hessian(int i, int j) const requires(Order == 2) {
    return hessian_[static_cast<std::size_t>(i >= j ? i * (i + 1) / 2 + j : j * (j + 1) / 2 + i)];
  }

  /// f(x) from f, f', f'' at the value of x.
  static Jet chain(const Jet& x, double f, double df, [[maybe_unused]] double d2f) {
    Jet y(f);
    for (std::size_t i = 0; i < N; ++i) y.gradient_[i] = df * x.gradient_[i];
    if constexpr (Order == 2) {
      std::size_t k = 0;
      for (std::size_t i = 0; i < N; ++i) {
        const double s = d2f * x.gradient_[i];
        for (std::size_t j = 0; j <= i; ++j, ++k) y.hessian_[k] = df * x.hessian_[k] + s * x.gradient_[j];
      }
    }
    return y;
  }

  Jet& operator+=(const Jet& o) {
    value_ += o.value_;
    for (std::size_t i = 0; i < N; ++i) gradient_[i] += o.gradient_[i];
    for (std::size_t k = 0; k < hessian_size; ++k) hessian_[k] += o.hessian_[k];
    return *this;
  }
  Jet& operator-=(const Jet& o) {
    value_ -= o.value_;
    for (std::size_t i = 0; i < N; ++i) gradient_[i] -= o.gradient_[i];
    for (std::size_t k = 0; k < hessian_size; ++k) hessian_[k] -= o.hessian_[k];
    return *this;
  }
  Jet& operator*=(double s) {
    value_ *= s;
    for (double& g : gradient_) g *= s;
    for (double& h : hessian_) h *= s;
    return *this;
  }
  Jet& operator+=(double s) {
    value_ += s;
    return *this;
  }
  Jet& operator-=(double s) { return *this += -s; }
  Jet& operator/=(double s) { return *this *= 1.0 / s; }
  Jet& operator*=(const Jet& o) { return *this = *this * o; }
  Jet& operator/=(const Jet& o) { return *this = *this / o; }

  friend Jet operator+(Jet a, const Jet& b) { return a += b; }
  friend Jet operator-(Jet a, const Jet& b) { return a -= b; }
  friend Jet operator+(Jet a, double b) { return a += b; }
  friend Jet operator-(Jet a, double b) { return a -= b; }
  friend Jet operator+(double a, Jet b) { return b += a; }
  friend Jet operator-(double a, Jet b) { return (b *= -1.0) += a; }
  friend Jet operator+(Jet a) { return a; }
  friend Jet operator-(Jet a) { return a *= -1.0; }
  friend Jet operator*(Jet a, double b) { return a *= b; }
  friend Jet operator*(double a, Jet b) { return b *= a; }
  friend Jet operator/(Jet a, double b) { return a /= b; }
  friend Jet operator/(double a, const Jet& b) { return a * reciprocal(b); }
  friend Jet operator/(const Jet& a, const Jet& b) { return a * reciprocal(b); }

  friend Jet operator*(const Jet& a, const Jet& b) {
    Jet y(a.value_ * b.value_);
    for (std::size_t i = 0; i < N; ++i)
      y.gradient_[i] = a.value_ * b.gradient_[i] + b.value_ * a.gradient_[i];
    if constexpr (Order == 2) {
      std::size_t k = 0;
      for (std::size_t i = 0; i < N; ++i)
        for (std::size_t j = 0; j <= i; ++j, ++k)
          y.hessian_[k] = a.value_ * b.hessian_[k] + b.value_ * a.hessian_[k] +
                          a.gradient_[i] * b.gradient_[j] + a.gradient_[j] * b.gradient_[i];
    }
    return y;
  }

  friend bool operator<(const Jet& a, const Jet& b) { return a.value_ < b.value_; }
  friend bool operator>(const Jet& a, const Jet& b) { return a.value_ > b.value_; }
  friend bool operator<=(const Jet& a, const Jet& b) { return a.value_ <= b.value_; }
  friend bool operator>=(const Jet& a, const Jet& b) { return a.value_ >= b.value_; }

  friend Jet reciprocal(const Jet& x) {
    const double r = 1.0 / x.value_;
    return chain(x, r, -r * r, 2.0 * r * r * r);
  }
  friend Jet sqrt(const Jet& x) {
    const double r = std::sqrt(x.value_);
    return chain(x, r, 0.5 / r, -0.25 / (r * x.value_));
  }
  friend Jet exp(const Jet& x) {
    const double e = std::exp(x.value_);
    return chain(x, e, e, e);
  }
  friend Jet log(const Jet& x) {
    const double r = 1.0 / x.value_;
    return chain(x, std::log(x.value_), r, -r * r);
  }
  friend Jet sin(const Jet& x) {
    const double s = std::sin(x.value_);
    return chain(x, s, std::cos(x.value_), -s);
  }
  friend Jet cos(const Jet& x) {
    const double c = std::cos(x.value_);
    return chain(x, c, -std::sin(x.value_), -c);
  }
  friend Jet tan(const Jet& x) {
    const double t = std::tan(x.value_);
    return chain(x, t, 1.0 + t * t, 2.0 * t * (1.0 + t * t));
  }
  friend Jet asin(const Jet& x) {
    const double d = 1.0 / std::sqrt(1.0 - x.value_ * x.value_);
    return chain(x, std::asin(x.value_), d, x.value_ * d * d * d);
  }
  friend Jet acos(const Jet& x) {
    const double d = 1.0 / std::sqrt(1.0 - x.value_ * x.value_);
    return chain(x, std::acos(x.value_), -d, -x.value_ * d * d * d);
  }
  friend Jet atan(const Jet& x) {
    const double d = 1.0 / (1.0 + x.value_ * x.value_);
    return chain(x, std::atan(x.value_), d, -2.0 * x.value_ * d * d);
  }
  friend Jet sinh(const Jet& x) {
    const double s = std::sinh(x.value_);
    return chain(x, s, std::cosh(x.value_), s);
  }
  friend Jet cosh(const Jet& x) {
    const double c = std::cosh(x.value_);
    return chain(x, c, std::sinh(x.value_), c);
  }
  friend Jet tanh(const Jet& x) {
    const double t = std::tanh(x.value_);
    return chain(x, t, 1.0 - t * t, -2.0 * t * (1.0 - t * t));
  }
  friend Jet abs(const Jet& x) { return x.value_ < 0.0 ? -x : x; }
  friend Jet pow(const Jet& x, double e) {
    return chain(x, std::pow(x.value_, e), e == 0.0 ? 0.0 : e * std::pow(x.value_, e - 1.0),
                 e == 0.0 || e == 1.0 ? 0.0 : e * (e - 1.0) * std::pow(x.value_, e - 2.0));
  }
  friend Jet pow(const Jet& x, const Jet& e) { return exp(e * log(x)); }
  friend Jet hypot(const Jet& x, const Jet& y) { return sqrt(x * x + y * y); }
  friend Jet atan2(const Jet& y, const Jet& x) {
    // The angle is that of the values; its derivatives are those of atan(y/x) or of -atan(x/y),
    // whichever divides by the larger coordinate.
    Jet angle = std::abs(x.value_) >= std::abs(y.value_) ? atan(y / x) : -atan(x / y);
    angle.value_ = std::atan2(y.value_, x.value_);
    return angle;
  }

 private:
  double value_ = 0.0;
  std::array<double, N> gradient_{};
  std::array<double, hessian_size> hessian_{};
};

}  // namespace diracstep
