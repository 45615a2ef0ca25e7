#pragma once

#include <array>
#include <bitset>
#include <cstddef>

namespace diracstep {

/// Which second derivatives of a formula in N variables can be other than zero, and which other than
/// constant, found by running the formula once on this type instead of a number.
///
/// A formula that compares or branches on its variables has no single structure: a comparison throws
/// Dependence::Branches.
template <std::size_t N>
class Dependence {
 public:
  struct Branches {};

  Dependence() = default;
  Dependence(double) {}  // NOLINT(google-explicit-constructor): constants in formulas

  static Dependence variable(std::size_t index) {
    Dependence x;
    x.on_.set(index);
    return x;
  }

  bool depends_on(std::size_t i) const { return on_[i]; }
  bool second_derivative(std::size_t i, std::size_t j) const { return curved_[i][j]; }
  bool second_derivative_varies(std::size_t i, std::size_t j) const { return varies_[i][j]; }

  Dependence& operator+=(const Dependence& o) {
    on_ |= o.on_;
    for (std::size_t i = 0; i < N; ++i) {
      curved_[i] |= o.curved_[i];
      varies_[i] |= o.varies_[i];
    }
    return *this;
  }
  Dependence& operator-=(const Dependence& o) { return *this += o; }
  Dependence& operator*=(const Dependence& o) { return *this = *this * o; }
  Dependence& operator/=(const Dependence& o) { return *this = *this / o; }

  friend Dependence operator+(Dependence a, const Dependence& b) { return a += b; }
  friend Dependence operator-(Dependence a, const Dependence& b) { return a += b; }
  friend Dependence operator+(Dependence a) { return a; }
  friend Dependence operator-(Dependence a) { return a; }
  friend Dependence operator/(const Dependence& a, const Dependence& b) { return a * nonlinear(b); }

  /// (ab)_ij = a b_ij + b a_ij + a_i b_j + a_j b_i.
  friend Dependence operator*(const Dependence& a, const Dependence& b) {
    Dependence y = a + b;
    for (std::size_t i = 0; i < N; ++i) {
      if (b.on_.any()) y.varies_[i] |= a.curved_[i];
      if (a.on_.any()) y.varies_[i] |= b.curved_[i];
    }
    for (std::size_t i = 0; i < N; ++i)
      for (std::size_t j = 0; j < N; ++j)
        if (a.on_[i] && b.on_[j]) y.add_cross(i, j, a.curved_[i].any() || b.curved_[j].any());
    return y;
  }

  friend bool operator<(const Dependence&, const Dependence&) { throw Branches{}; }
  friend bool operator>(const Dependence&, const Dependence&) { throw Branches{}; }
  friend bool operator<=(const Dependence&, const Dependence&) { throw Branches{}; }
  friend bool operator>=(const Dependence&, const Dependence&) { throw Branches{}; }

  friend Dependence reciprocal(const Dependence& x) { return nonlinear(x); }
  friend Dependence sqrt(const Dependence& x) { return nonlinear(x); }
  friend Dependence exp(const Dependence& x) { return nonlinear(x); }
  friend Dependence log(const Dependence& x) { return nonlinear(x); }
  friend Dependence sin(const Dependence& x) { return nonlinear(x); }
  friend Dependence cos(const Dependence& x) { return nonlinear(x); }
  friend Dependence tan(const Dependence& x) { return nonlinear(x); }
  friend Dependence asin(const Dependence& x) { return nonlinear(x); }
  friend Dependence acos(const Dependence& x) { return nonlinear(x); }
  friend Dependence atan(const Dependence& x) { return nonlinear(x); }
  friend Dependence sinh(const Dependence& x) { return nonlinear(x); }
  friend Dependence cosh(const Dependence& x) { return nonlinear(x); }
  friend Dependence tanh(const Dependence& x) { return nonlinear(x); }
  friend Dependence abs(const Dependence& x) { return nonlinear(x); }
  friend Dependence pow(const Dependence& x, const Dependence& e) { return nonlinear(x + e); }
  friend Dependence hypot(const Dependence& x, const Dependence& y) { return nonlinear(x + y); }
  friend Dependence atan2(const Dependence& y, const Dependence& x) { return nonlinear(x + y); }

 private:
  static Dependence nonlinear(const Dependence& x) {
    Dependence y;
    y.on_ = x.on_;
    for (std::size_t i = 0; i < N; ++i)
      if (x.on_[i]) y.curved_[i] = y.varies_[i] = x.on_;
    return y;
  }

  void add_cross(std::size_t i, std::size_t j, bool varies) {
    curved_[i].set(j);
    curved_[j].set(i);
    if (!varies) return;
    varies_[i].set(j);
    varies_[j].set(i);
  }

  std::bitset<N> on_;
  std::array<std::bitset<N>, N> curved_;
  std::array<std::bitset<N>, N> varies_;
};

}  // namespace diracstep
