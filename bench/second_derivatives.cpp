/// What the value, gradient and Hessian of a Lagrangian cost with the library's second-order jets, with
/// Eigen's AutoDiffScalar nested in itself, and as a formula without derivatives.
#include <cmath>
#include <cstdio>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <unsupported/Eigen/AutoDiff>

#include "timing.hpp"

using namespace diracstep;

namespace {

struct KnifeEdge {
  static constexpr int n = 3;
  template <class T>
  T operator()(const std::array<T, 3>& q, const std::array<T, 3>& v) const {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 0.5 * v[2] * v[2] + 0.7173560908995228 * q[0];
  }
};

struct Kepler {
  static constexpr int n = 2;
  template <class T>
  T operator()(const std::array<T, 2>& q, const std::array<T, 2>& v) const {
    using std::sqrt;
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 1.0 / sqrt(q[0] * q[0] + q[1] * q[1]);
  }
};

struct DoublePendulum {
  static constexpr int n = 2;
  template <class T>
  T operator()(const std::array<T, 2>& q, const std::array<T, 2>& v) const {
    using std::cos;
    const T coupling = v[0] * v[1] * cos(q[0] - q[1]);
    return v[0] * v[0] + 0.5 * v[1] * v[1] + coupling + 2.0 * 9.81 * cos(q[0]) + 9.81 * cos(q[1]);
  }
};

template <class L>
using Point = std::array<double, 2 * L::n>;
template <class L>
using Hessian = Eigen::Matrix<double, 2 * L::n, 2 * L::n>;

/// L with the variables made by `variable(value, index)`.
template <class L, class Variable>
auto evaluate(const Point<L>& x, Variable variable) {
  std::array<decltype(variable(0.0, 0)), L::n> q, v;
  for (int i = 0; i < L::n; ++i) {
    q[i] = variable(x[i], i);
    v[i] = variable(x[L::n + i], L::n + i);
  }
  return L{}(q, v);
}

template <class L>
Hessian<L> with_jets(const Point<L>& x) {
  const auto value = evaluate<L>(x, [](double a, int i) { return Jet<2 * L::n, 2>::variable(a, i); });
  Hessian<L> hessian;
  for (int j = 0; j < 2 * L::n; ++j)
    for (int i = 0; i < 2 * L::n; ++i) hessian(i, j) = value.hessian(i, j);
  return hessian;
}

template <class L>
Hessian<L> with_auto_diff_scalars(const Point<L>& x) {
  constexpr int size = 2 * L::n;
  using Inner = Eigen::AutoDiffScalar<Eigen::Vector<double, size>>;
  using Outer = Eigen::AutoDiffScalar<Eigen::Vector<Inner, size>>;
  const auto value = evaluate<L>(x, [](double a, int i) {
    Outer variable(Inner(a, size, i), size, i);
    for (int k = 0; k < size; ++k) variable.derivatives()[k].derivatives().setZero();
    return variable;
  });
  Hessian<L> hessian;
  for (int i = 0; i < size; ++i) hessian.col(i) = value.derivatives()[i].derivatives();
  return hessian;
}

template <class L>
void compare(const char* name) {
  constexpr int rounds = 40, evaluations = 5000;
  Point<L> x;
  for (int i = 0; i < 2 * L::n; ++i) x[i] = 0.4 + 0.3 * i;
  const double apart = (with_jets<L>(x) - with_auto_diff_scalars<L>(x)).cwiseAbs().maxCoeff();
  // Every evaluation depends on the one before, so that none can be left out.
  double sum = 0.0;
  const auto repeat = [&](auto function) {
    return [&sum, x, function]() mutable {
      for (int k = 0; k < evaluations; ++k) {
        const double y = function(x);
        x[0] += 1e-14 * y;
        sum += y;
      }
    };
  };
  const auto ns = fewest_nanoseconds(
      {repeat([](const Point<L>& at) { return evaluate<L>(at, [](double a, int) { return a; }); }),
       repeat([](const Point<L>& at) { return with_jets<L>(at).sum(); }),
       repeat([](const Point<L>& at) { return with_auto_diff_scalars<L>(at).sum(); })},
      evaluations, rounds);
  std::printf("%-16s%10d%10.0f%10.0f%16.0f%10.1f%10.0e%s\n", name, 2 * L::n, ns[0], ns[1], ns[2],
              ns[2] / ns[1], apart, std::isfinite(sum) ? "" : " not finite");
}

}  // namespace

int main() {
  std::printf("Value, gradient and Hessian of a Lagrangian, processor time in ns\n");
  std::printf("%-16s%10s%10s%10s%16s%10s%10s\n", "Lagrangian", "variables", "formula", "jets",
              "AutoDiffScalar", "ratio", "apart");
  compare<KnifeEdge>("knife_edge");
  compare<Kepler>("kepler");
  compare<DoublePendulum>("double_pendulum");
}
