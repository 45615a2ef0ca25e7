/// What a step of type1/midpoint costs beside its arithmetic, in processor time, for 2 to 12 unknowns:
///   dense, KLU  the integrator with KINSOL and full or sparse factors, derivatives of L in closed form
///   Newton      the same integrator with a Newton loop of fixed size in place of KINSOL
///   by hand     residual and Jacobian written out, fixed sizes, their own elimination, the same Newton loop
///   formulas    the integrator, and the step by hand, with derivatives of L (and by hand of the rows, as the
///               library always does) by automatic differentiation of the same formulas, nothing simplified
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/integrator.hpp>
#include <diracstep/core/jet.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "timing.hpp"

using namespace diracstep;

namespace {

constexpr double slope = 0.7173560908995228,
                 gravity = 13.750371636040745;  // of knife_edge and pendulum_cartesian

/// Newton's method of both baselines: evaluate gives the scaled residual, correct the relative size of its
/// correction.
template <class Evaluate, class Correct>
int newton(Evaluate evaluate, Correct correct) {
  int iterations = 0;
  while (iterations < 20 && evaluate() > 1e-15) {
    ++iterations;
    if (correct() > 1e-9) continue;
    evaluate();
    break;
  }
  return iterations;
}

/// N is the number of unknowns: a hand-written loop knows it.
template <int N>
class EigenNewton final : public NonlinearSolver {
 public:
  explicit EigenNewton(NonlinearProblem& problem) : problem_(problem) {}

  SolveReport solve(VectorRef x) override {
    const auto evaluate = [&] {
      problem_.residual(x, f_);
      double largest = 0.0;
      Eigen::Index row = 0;
      for (const ResidualBlock& block : problem_.blocks()) {
        largest =
            std::max(largest, f_.segment(row, block.rows).template lpNorm<Eigen::Infinity>() / block.scale);
        row += block.rows;
      }
      return largest;
    };
    const auto correct = [&] {
      problem_.jacobian(x, Vector::Map(jacobian_.data(), jacobian_.size()));
      lu_.compute(jacobian_);
      change_ = lu_.solve(f_);
      x -= change_;
      return change_.template lpNorm<Eigen::Infinity>() / x.lpNorm<Eigen::Infinity>();
    };
    SolveReport report;
    report.iterations = newton(evaluate, correct);
    return report;
  }
  std::string description() const override { return "Newton, Eigen"; }

 private:
  NonlinearProblem& problem_;
  Eigen::PartialPivLU<Eigen::Matrix<double, N, N>> lu_;
  Eigen::Vector<double, N> f_, change_;
  Eigen::Matrix<double, N, N> jacobian_;
};

/// Scenes of unit masses: L and the rows as formulas; ∂L/∂q, its derivative, the forms A(q0) and the discrete
/// constraint with its derivative, as columns, in closed form for the step by hand.

/// K skates of coordinates x, y, heading, and a rotor that a spring ties to the heading; one row each.  The
/// skates hang on one another by springs.
template <int K>
struct Skates {
  static constexpr int n = 4 * K, m = K;
  static constexpr double h = 0.1, tie = 2.0, spring = 0.7;
  static constexpr bool quadratic = true, by_position = false;
  template <class T>
  T operator()(const std::array<T, n>& q, const std::array<T, n>& v) const {
    T sum = T(0.0);
    for (std::size_t k = 0; k < n; ++k) sum += 0.5 * v[k] * v[k];
    for (std::size_t k = 0; k < n; k += 4) {
      const T twist = q[k + 2] - q[k + 3];
      sum += slope * q[k] - 0.5 * tie * twist * twist;
      if (k == 0) continue;
      const T dx = q[k] - q[k - 4], dy = q[k + 1] - q[k - 3];
      sum -= 0.5 * spring * (dx * dx + dy * dy);
    }
    return sum;
  }
  template <class T>
  std::array<std::array<T, n>, m> operator()(const std::array<T, n>& q) const {
    using std::cos, std::sin;
    std::array<std::array<T, n>, m> rows{};
    for (std::size_t k = 0; k < m; ++k) {
      rows[k][4 * k] = sin(q[4 * k + 2]);
      rows[k][4 * k + 1] = -cos(q[4 * k + 2]);
    }
    return rows;
  }
  static ConstraintBlocks rows() { return {pfaffian<n, m>(Skates{})}; }
  static Start start() {
    Start start{0.0, Vector::Zero(n), Vector::Zero(n)};
    for (int k = 0; k < m; ++k) start.q[4 * k + 1] = 0.5 * k, start.v[4 * k + 2] = 1.0 + 0.1 * k;
    return start;
  }

  static void force(const auto& q, auto& f, auto& stiffness) {
    stiffness.setZero();
    for (int k = 0; k < n; k += 4) {
      const double twist = tie * (q[k + 2] - q[k + 3]);
      f[k] = slope, f[k + 1] = 0.0, f[k + 2] = -twist, f[k + 3] = twist;
      stiffness(k + 2, k + 2) = stiffness(k + 3, k + 3) = -tie;
      stiffness(k + 2, k + 3) = stiffness(k + 3, k + 2) = tie;
    }
    for (int k = 4; k < n; ++k) {
      if (k % 4 > 1) continue;
      const double tension = spring * (q[k] - q[k - 4]);
      f[k] -= tension, f[k - 4] += tension;
      stiffness(k, k) -= spring, stiffness(k - 4, k - 4) -= spring;
      stiffness(k, k - 4) = stiffness(k - 4, k) = spring;
    }
  }
  static void forms(const auto& q, auto& a) {
    a.setZero();
    for (int k = 0; k < m; ++k)
      a(4 * k, k) = std::sin(q[4 * k + 2]), a(4 * k + 1, k) = -std::cos(q[4 * k + 2]);
  }
  static void constraint(const auto& q0, const auto& q1, auto& c, auto& a) {
    a.setZero();
    for (int k = 0; k < m; ++k) {
      const int x = 4 * k, y = x + 1, heading = x + 2;
      const double angle = 0.5 * (q0[heading] + q1[heading]), sine = std::sin(angle),
                   cosine = std::cos(angle);
      a(x, k) = sine, a(y, k) = -cosine;
      a(heading, k) = 0.5 * (cosine * (q1[x] - q0[x]) + sine * (q1[y] - q0[y]));
      c[k] = sine * (q1[x] - q0[x]) - cosine * (q1[y] - q0[y]);
    }
  }
};

struct KnifeEdge {
  static constexpr int n = 3, m = 1;
  static constexpr double h = 0.25;
  static constexpr bool quadratic = true, by_position = false;
  template <class T>
  T operator()(const std::array<T, 3>& q, const std::array<T, 3>& v) const {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 0.5 * v[2] * v[2] + slope * q[0];
  }
  template <class T>
  std::array<std::array<T, 3>, 1> operator()(const std::array<T, 3>& q) const {
    using std::cos, std::sin;
    return {{{sin(q[2]), -cos(q[2]), T(0.0)}}};
  }
  static ConstraintBlocks rows() { return {pfaffian<3, 1>(KnifeEdge{})}; }
  static Start start() { return {0.0, Vector::Zero(3), Vector::Unit(3, 2)}; }

  static void force(const auto&, auto& f, auto&) { f[0] = slope; }
  static void forms(const auto& q, auto& a) { a << std::sin(q[2]), -std::cos(q[2]), 0.0; }
  static void constraint(const auto& q0, const auto& q1, auto& value, auto& a) {
    const double angle = 0.5 * (q0[2] + q1[2]), s = std::sin(angle), c = std::cos(angle);
    a << s, -c, 0.5 * (c * (q1[0] - q0[0]) + s * (q1[1] - q0[1]));
    value[0] = s * (q1[0] - q0[0]) - c * (q1[1] - q0[1]);
  }
};

struct Pendulum {
  static constexpr int n = 2, m = 1;
  static constexpr double h = 0.05;
  static constexpr bool quadratic = true, by_position = true;
  template <class T>
  T operator()(const std::array<T, 2>& q, const std::array<T, 2>& v) const {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) - gravity * q[1];
  }
  template <class T>
  std::array<T, 1> operator()(const std::array<T, 2>& q) const {
    return {q[0] * q[0] + q[1] * q[1] - 1.0};
  }
  static ConstraintBlocks rows() { return {holonomic<2, 1>(Pendulum{})}; }
  static Start start() { return {0.0, Vector::Unit(2, 0), Vector::Zero(2)}; }

  static void force(const auto&, auto& f, auto&) { f[1] = -gravity; }
  static void forms(const auto& q, auto& a) { a = 2.0 * q; }
  static void constraint(const auto&, const auto& q1, auto& value, auto& a) {
    a = 2.0 * q1;
    value[0] = q1.squaredNorm() - 1.0;
  }
};

struct Kepler {
  static constexpr int n = 2, m = 0;
  static constexpr double h = 0.05;
  static constexpr bool quadratic = false, by_position = false;
  template <class T>
  T operator()(const std::array<T, 2>& q, const std::array<T, 2>& v) const {
    using std::sqrt;
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 1.0 / sqrt(q[0] * q[0] + q[1] * q[1]);
  }
  static ConstraintBlocks rows() { return {}; }
  static Start start() { return {0.0, 0.4 * Vector::Unit(2, 0), 2.0 * Vector::Unit(2, 1)}; }

  static void force(const auto& q, auto& f, auto& stiffness) {
    const double r2 = 1.0 / q.squaredNorm(), r3 = r2 * std::sqrt(r2);
    f = -r3 * q;
    stiffness.noalias() = 3.0 * r3 * r2 * q * q.transpose();
    stiffness.diagonal().array() -= r3;
  }
};

/// Nonlinear springs between twelve masses and two walls: V = Σ d²/2 + d⁴/4.
struct Springs {
  static constexpr int n = 12, m = 0;
  static constexpr double h = 0.1;
  static constexpr bool quadratic = false, by_position = false;
  template <class T>
  T operator()(const std::array<T, 12>& q, const std::array<T, 12>& v) const {
    T sum = -0.5 * q[0] * q[0] - 0.25 * q[0] * q[0] * q[0] * q[0];
    for (std::size_t i = 0; i < 12; ++i) {
      const T d = i + 1 < 12 ? q[i + 1] - q[i] : -q[i];
      sum += 0.5 * v[i] * v[i] - 0.5 * d * d - 0.25 * d * d * d * d;
    }
    return sum;
  }
  static ConstraintBlocks rows() { return {}; }
  static Start start() { return {0.0, Vector::LinSpaced(12, -0.5, 0.5).array().sin(), Vector::Zero(12)}; }

  static void force(const auto& q, auto& f, auto& stiffness) {
    stiffness.setZero();
    f.setZero();
    for (int i = 0; i <= 12; ++i) {  // the spring between masses i−1 and i
      const double d = (i < 12 ? q[i] : 0.0) - (i > 0 ? q[i - 1] : 0.0);
      const double tension = d + d * d * d, slope_of_tension = 1.0 + 3.0 * d * d;
      if (i < 12) f[i] -= tension, stiffness(i, i) -= slope_of_tension;
      if (i > 0) f[i - 1] += tension, stiffness(i - 1, i - 1) -= slope_of_tension;
      if (i > 0 && i < 12) stiffness(i, i - 1) = stiffness(i - 1, i) = slope_of_tension;
    }
  }
};

/// L with derivatives from the closed forms of such a scene.
template <class S>
class ByHandLagrangian final : public Lagrangian {
 public:
  static constexpr int n = S::n;
  ByHandLagrangian() : Lagrangian(SparsityPattern::dense(n, n), {true, true, true, S::quadratic}) {}

  double value(double t, ConstVectorRef q, ConstVectorRef v) const override { return jets_->value(t, q, v); }
  void gradient(double, ConstVectorRef q, ConstVectorRef v, VectorRef fx, VectorRef fy) const override {
    Eigen::Vector<double, n> force = Eigen::Vector<double, n>::Zero();
    Eigen::Matrix<double, n, n> stiffness;
    S::force(q, force, stiffness);
    fx = force;
    fy = v;
  }
  void hessian(double, ConstVectorRef q, ConstVectorRef, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    Eigen::Vector<double, n> force;
    Eigen::Matrix<double, n, n> stiffness = Eigen::Matrix<double, n, n>::Zero();
    S::force(q, force, stiffness);
    fxx = stiffness.reshaped();
    fxy.setZero();
    fyy = Eigen::Matrix<double, n, n>::Identity().reshaped();
  }
  void gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef fyt) const override { fyt.setZero(); }

 private:
  std::shared_ptr<const Lagrangian> jets_ = lagrangian<n>(S{});
};

/// The closed forms of a scene.
template <class S>
struct ClosedForms {
  static void force(const auto& q, const auto&, auto& f, auto& stiffness) { S::force(q, f, stiffness); }
  static void stiffness(const auto&, const auto&, auto&) {}
  static void forms(const auto& q, auto& a) { S::forms(q, a); }
  static void constraint(const auto& q0, const auto& q1, auto& c, auto& a) { S::constraint(q0, q1, c, a); }
  static void constraint_derivative(const auto&, const auto&, auto&) {}
};

/// The same from the formulas of L and the rows by automatic differentiation.
template <class S>
struct Formulas {
  static constexpr int n = S::n, m = S::m;
  template <class Scalar>
  static std::array<Scalar, n> variables(const auto& x, int first) {
    std::array<Scalar, n> seeded;
    for (int i = 0; i < n; ++i) seeded[static_cast<std::size_t>(i)] = Scalar::variable(x[i], first + i);
    return seeded;
  }
  static void force(const auto& q, const auto& v, auto& f, auto&) {
    using Scalar = Jet<2 * n, 1>;
    const Scalar l = S{}(variables<Scalar>(q, 0), variables<Scalar>(v, n));
    for (int i = 0; i < n; ++i) f[i] = l.gradient(i);
  }
  static void stiffness(const auto& q, const auto& v, auto& stiffness) {
    using Scalar = Jet<2 * n, 2>;
    const Scalar l = S{}(variables<Scalar>(q, 0), variables<Scalar>(v, n));
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) stiffness(i, j) = l.hessian(i, j);
  }
  static void forms(const auto& q, auto& a) {
    if constexpr (S::by_position) {
      const auto phi = S{}(variables<Jet<n, 1>>(q, 0));
      for (int r = 0; r < m; ++r)
        for (int i = 0; i < n; ++i) a(i, r) = phi[static_cast<std::size_t>(r)].gradient(i);
    } else {
      std::array<double, n> at;
      std::copy_n(q.data(), n, at.data());
      const auto rows = S{}(at);
      for (std::size_t r = 0; r < m; ++r)
        for (std::size_t i = 0; i < n; ++i) a(static_cast<int>(i), static_cast<int>(r)) = rows[r][i];
    }
  }
  static void constraint(const auto& q0, const auto& q1, auto& c, auto& a) {
    if constexpr (S::by_position) {
      std::array<double, n> at;
      std::copy_n(q1.data(), n, at.data());
      std::copy_n(S{}(at).data(), m, c.data());
    } else {
      forms((0.5 * (q0 + q1)).eval(), a);
      c = a.transpose() * (q1 - q0);
    }
  }
  static void constraint_derivative(const auto& q0, const auto& q1, auto& a) {
    if constexpr (S::by_position) {
      forms(q1, a);
    } else {
      const auto rows = S{}(variables<Jet<n, 1>>((0.5 * (q0 + q1)).eval(), 0));
      for (int r = 0; r < m; ++r)
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j)
            a(j, r) += 0.5 * (q1[i] - q0[i]) *
                       rows[static_cast<std::size_t>(r)][static_cast<std::size_t>(i)].gradient(j);
    }
  }
};

/// The midpoint step of such a scene with derivatives from D; guesses are extrapolations of the last five
/// solutions.
template <class S, class D>
class ByHand {
 public:
  static constexpr int n = S::n, m = S::m, size = n + m;
  using Position = Eigen::Vector<double, n>;
  using Unknowns = Eigen::Vector<double, size>;

  ByHand() : q_(S::start().q), p_(S::start().v) {
    history_.fill(Unknowns::Zero());
    for (Unknowns& past : history_) past.template head<n>() = q_;
  }

  void step() {
    if constexpr (m > 0) D::forms(q_, a_);
    x_ = 5.0 * (history_[0] - history_[3]) + 10.0 * (history_[2] - history_[1]) + history_[4];
    iterations += newton([this] { return residual(); }, [this] { return correct(); });
    p_ = (x_.template head<n>() - q_) / S::h + 0.5 * S::h * force_;
    q_ = x_.template head<n>();
    std::rotate(history_.begin(), history_.end() - 1, history_.end());
    history_[0] = x_;
  }

  const Position& position() const { return q_; }
  long iterations = 0;

 private:
  double residual() {
    const Position q1 = x_.template head<n>();
    middle_ = 0.5 * (q_ + q1);
    velocity_ = (q1 - q_) / S::h;
    D::force(middle_, velocity_, force_, stiffness_);
    f_.template head<n>() = S::h * p_ + 0.5 * S::h * S::h * force_ - (q1 - q_);
    if constexpr (m > 0) {
      f_.template head<n>() += a_ * x_.template tail<m>();
      Eigen::Vector<double, m> c;
      D::constraint(q_, q1, c, row_);
      f_.template tail<m>() = c;
    }
    return f_.template lpNorm<Eigen::Infinity>() / std::max(0.1, q_.template lpNorm<Eigen::Infinity>());
  }

  double correct() {
    Eigen::Matrix<double, size, size> j = Eigen::Matrix<double, size, size>::Zero();
    D::stiffness(middle_, velocity_, stiffness_);
    j.template topLeftCorner<n, n>() =
        0.25 * S::h * S::h * stiffness_ - Eigen::Matrix<double, n, n>::Identity();
    if constexpr (m > 0) {
      D::constraint_derivative(q_, x_.template head<n>().eval(), row_);
      j.template topRightCorner<n, m>() = a_;
      j.template bottomLeftCorner<m, n>() = row_.transpose();
    }
    for (int k = 0; k < size; ++k) {  // elimination with row exchanges
      int pivot = k;
      for (int i = k + 1; i < size; ++i)
        if (std::abs(j(i, k)) > std::abs(j(pivot, k))) pivot = i;
      j.row(k).swap(j.row(pivot));
      std::swap(f_[k], f_[pivot]);
      for (int i = k + 1; i < size; ++i) {
        const double factor = j(i, k) / j(k, k);
        for (int c = k + 1; c < size; ++c) j(i, c) -= factor * j(k, c);
        f_[i] -= factor * f_[k];
      }
    }
    for (int k = size - 1; k >= 0; --k) {
      for (int c = k + 1; c < size; ++c) f_[k] -= j(k, c) * f_[c];
      f_[k] /= j(k, k);
    }
    x_ -= f_;
    return f_.template lpNorm<Eigen::Infinity>() / x_.template lpNorm<Eigen::Infinity>();
  }

  Position q_, p_, middle_, velocity_, force_ = Position::Zero();
  Eigen::Matrix<double, n, std::max(m, 1)> a_, row_;
  Eigen::Matrix<double, n, n> stiffness_ = Eigen::Matrix<double, n, n>::Zero();
  Unknowns x_, f_;
  std::array<Unknowns, 5> history_;
};

template <class S>
void compare(const char* name) {
  constexpr int rounds = 40, steps = 1000, steps_compared = 100;
  Scene scene;
  scene.name = name;
  scene.coordinates.assign(S::n, "q");
  scene.lagrangian = lagrangian<S::n>(S{});
  scene.constraints = S::rows();
  scene.start = S::start();
  const auto with_jets = std::make_shared<const Scene>(scene);
  scene.lagrangian = std::make_shared<const ByHandLagrangian<S>>();
  const auto shared = std::make_shared<const Scene>(scene);
  const IntegratorOptions full{.method = "type1/midpoint", .step = S::h};
  IntegratorOptions sparse = full;
  sparse.dense_limit = 0;
  const SolverFactory eigen = [](NonlinearProblem& problem) {
    return std::make_unique<EigenNewton<S::n + S::m>>(problem);
  };
  Integrator dense(shared, Registry::with_built_ins(), kinsol(), full);
  Integrator klu(shared, Registry::with_built_ins(), kinsol(), sparse);
  Integrator newton(shared, Registry::with_built_ins(), eigen, full);
  Integrator jets(with_jets, Registry::with_built_ins(), kinsol(), full);
  ByHand<S, ClosedForms<S>> hand;
  ByHand<S, Formulas<S>> hand_jets;
  for (int k = 0; k < steps_compared; ++k) (void)dense.step(), hand.step();
  const double apart = (dense.position() - hand.position()).norm();
  const auto run = [](auto& steppable) {
    return [&steppable] {
      for (int k = 0; k < steps; ++k) (void)steppable.step();
    };
  };
  const auto ns = fewest_nanoseconds(
      {run(dense), run(klu), run(newton), run(hand), run(jets), run(hand_jets)}, steps, rounds);
  const auto each = [](long iterations) { return static_cast<double>(iterations) / (rounds * steps); };
  std::printf("%-12s%4d%8.0f%8.0f%8.0f%8.0f%8.0f%8.0f%9.2f%8.2f%8.2f%9.2f%8.2f%8.2f%7.0e\n", name,
              S::n + S::m, ns[0], ns[1], ns[2], ns[3], ns[4], ns[5], ns[0] / ns[3], ns[1] / ns[3],
              ns[2] / ns[3], ns[4] / ns[5], each(dense.work().iterations), each(hand.iterations), apart);
}

}  // namespace

int main() {
  std::printf(
      "type1/midpoint: processor time of a step in ns, its ratio to that by hand, Newton iterations, "
      "and how far the two are apart after 100 steps.\n");
  std::printf(
      "Where the scene has no rows, L by a formula of few coordinates has a full pattern, and KLU is "
      "dense LU.\n");
  std::printf("%-12s%4s%32s%16s%25s%9s%16s\n", "", "", "closed forms", "formulas", "ratio, closed forms",
              "formulas", "iterations");
  std::printf("%-12s%4s%8s%8s%8s%8s%8s%8s%9s%8s%8s%9s%8s%8s%7s\n", "scene", "n", "dense", "KLU", "Newton",
              "by hand", "library", "by hand", "dense", "KLU", "Newton", "library", "library", "by hand",
              "apart");
  compare<Kepler>("kepler_e06");
  compare<Pendulum>("pendulum");
  compare<KnifeEdge>("knife_edge");
  compare<Skates<1>>("skate");
  compare<Skates<2>>("two skates");
  compare<Springs>("springs");
}
