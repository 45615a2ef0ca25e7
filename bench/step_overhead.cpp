/// What a step of type1/midpoint costs beside its arithmetic, in processor time:
///   KINSOL   the integrator as it is, with the derivatives of L by hand
///   jets     the same with derivatives of L by automatic differentiation
///   Newton   the same integrator with a hand-written Newton loop of fixed size in place of KINSOL
///   by hand  residual and Jacobian in closed form, fixed sizes, its own elimination, the same Newton loop
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/core/integrator.hpp>
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

/// Scenes of unit masses, with ∂L/∂q, its derivative, and the constraint in closed form for the step by hand.
struct KnifeEdge {
  static constexpr int n = 3, m = 1;
  static constexpr double h = 0.25;
  static constexpr bool quadratic = true;
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
  static void row_at_start(const auto& q, auto& a) { a << std::sin(q[2]), -std::cos(q[2]), 0.0; }
  static double constraint(const auto& q0, const auto& q1, auto& a) {
    const double angle = 0.5 * (q0[2] + q1[2]), s = std::sin(angle), c = std::cos(angle);
    a << s, -c, 0.5 * (c * (q1[0] - q0[0]) + s * (q1[1] - q0[1]));
    return s * (q1[0] - q0[0]) - c * (q1[1] - q0[1]);
  }
};

struct Pendulum {
  static constexpr int n = 2, m = 1;
  static constexpr double h = 0.05;
  static constexpr bool quadratic = true;
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
  static void row_at_start(const auto& q, auto& a) { a = 2.0 * q; }
  static double constraint(const auto&, const auto& q1, auto& a) {
    a = 2.0 * q1;
    return q1.squaredNorm() - 1.0;
  }
};

struct Kepler {
  static constexpr int n = 2, m = 0;
  static constexpr double h = 0.05;
  static constexpr bool quadratic = false;
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
  static constexpr bool quadratic = false;
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

/// The midpoint step of such a scene; guesses are extrapolations of the last five solutions.
template <class S>
class ByHand {
 public:
  static constexpr int n = S::n, size = S::n + S::m;
  using Position = Eigen::Vector<double, n>;
  using Unknowns = Eigen::Vector<double, size>;

  ByHand() : q_(S::start().q), p_(S::start().v) {
    history_.fill(Unknowns::Zero());
    for (Unknowns& past : history_) past.template head<n>() = q_;
  }

  void step() {
    if constexpr (S::m > 0) S::row_at_start(q_, a_);
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
    const Position q1 = x_.template head<n>(), middle = 0.5 * (q_ + q1);
    S::force(middle, force_, stiffness_);
    f_.template head<n>() = S::h * p_ + 0.5 * S::h * S::h * force_ - (q1 - q_);
    if constexpr (S::m > 0) {
      f_.template head<n>() += a_ * x_[n];
      f_[n] = S::constraint(q_, q1, row_);
    }
    return f_.template lpNorm<Eigen::Infinity>() / std::max(0.1, q_.template lpNorm<Eigen::Infinity>());
  }

  double correct() {
    Eigen::Matrix<double, size, size> j = Eigen::Matrix<double, size, size>::Zero();
    j.template topLeftCorner<n, n>() =
        0.25 * S::h * S::h * stiffness_ - Eigen::Matrix<double, n, n>::Identity();
    if constexpr (S::m > 0) {
      j.template block<n, 1>(0, n) = a_;
      j.template block<1, n>(n, 0) = row_.transpose();
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

  Position q_, p_, force_ = Position::Zero(), a_, row_;
  Eigen::Matrix<double, n, n> stiffness_ = Eigen::Matrix<double, n, n>::Zero();
  Unknowns x_, f_;
  std::array<Unknowns, 5> history_;
};

template <class S>
void compare(const char* name) {
  constexpr int rounds = 40, steps = 1000;
  Scene scene;
  scene.name = name;
  scene.coordinates.assign(S::n, "q");
  scene.lagrangian = lagrangian<S::n>(S{});
  scene.constraints = S::rows();
  scene.start = S::start();
  const auto with_jets = std::make_shared<const Scene>(scene);
  scene.lagrangian = std::make_shared<const ByHandLagrangian<S>>();
  const auto shared = std::make_shared<const Scene>(scene);
  const IntegratorOptions options{.method = "type1/midpoint", .step = S::h};
  const SolverFactory eigen = [](NonlinearProblem& problem) {
    return std::make_unique<EigenNewton<S::n + S::m>>(problem);
  };
  Integrator library(shared, Registry::with_built_ins(), kinsol(), options);
  Integrator jets(with_jets, Registry::with_built_ins(), kinsol(), options);
  Integrator newton(shared, Registry::with_built_ins(), eigen, options);
  ByHand<S> hand;
  const auto run = [](auto& steppable) {
    return [&steppable] {
      for (int k = 0; k < steps; ++k) (void)steppable.step();
    };
  };
  const auto ns = fewest_nanoseconds({run(library), run(newton), run(hand), run(jets)}, steps, rounds);
  const auto each = [](long iterations) { return static_cast<double>(iterations) / (rounds * steps); };
  std::printf("%-12s%9d%8.0f%8.0f%8.0f%9.0f%10.2f%9.2f%10.2f%8.2f%9.2f%9.0e\n", name, S::n + S::m, ns[0],
              ns[3], ns[1], ns[2], ns[0] / ns[1], ns[0] / ns[2], each(library.work().iterations),
              each(newton.work().iterations), each(hand.iterations),
              (library.position() - hand.position()).norm());
}

}  // namespace

int main() {
  std::printf("type1/midpoint: processor time of a step in ns, ratios, Newton iterations in a step\n");
  std::printf("%-12s%9s%33s%19s%27s\n", "", "", "ns", "KINSOL to", "iterations");
  std::printf("%-12s%9s%8s%8s%8s%9s%10s%9s%10s%8s%9s%9s\n", "scene", "unknowns", "KINSOL", "jets", "Newton",
              "by hand", "Newton", "by hand", "KINSOL", "Newton", "by hand", "apart");
  compare<KnifeEdge>("knife_edge");
  compare<Pendulum>("pendulum");
  compare<Kepler>("kepler_e06");
  compare<Springs>("springs");
}
