/// What a step of type1/midpoint costs beside its arithmetic, in processor time:
///   KINSOL   the integrator as it is
///   Newton   the same integrator with a Newton loop and Eigen's dense LU in place of KINSOL
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

class EigenNewton final : public NonlinearSolver {
 public:
  explicit EigenNewton(NonlinearProblem& problem)
      : problem_(problem),
        lu_(problem.size()),
        f_(problem.size()),
        jacobian_(problem.size(), problem.size()) {}

  SolveReport solve(VectorRef x) override {
    const auto evaluate = [&] {
      problem_.residual(x, f_);
      double largest = 0.0;
      Eigen::Index row = 0;
      for (const ResidualBlock& block : problem_.blocks()) {
        largest = std::max(largest, f_.segment(row, block.rows).lpNorm<Eigen::Infinity>() / block.scale);
        row += block.rows;
      }
      return largest;
    };
    const auto correct = [&] {
      problem_.jacobian(x, Vector::Map(jacobian_.data(), jacobian_.size()));
      lu_.compute(jacobian_);
      change_.noalias() = lu_.solve(f_);
      x -= change_;
      return change_.lpNorm<Eigen::Infinity>() / x.lpNorm<Eigen::Infinity>();
    };
    SolveReport report;
    report.iterations = newton(evaluate, correct);
    return report;
  }
  std::string description() const override { return "Newton, Eigen"; }

 private:
  NonlinearProblem& problem_;
  Eigen::PartialPivLU<Columns> lu_;
  Vector f_, change_;
  Columns jacobian_;
};

/// Scenes of unit masses, with ∂L/∂q, its derivative, and the constraint in closed form for the step by hand.
struct KnifeEdge {
  static constexpr int n = 3, m = 1;
  static constexpr double h = 0.25;
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
  const auto shared = std::make_shared<const Scene>(scene);
  const IntegratorOptions options{.method = "type1/midpoint", .step = S::h};
  const SolverFactory eigen = [](NonlinearProblem& problem) {
    return std::make_unique<EigenNewton>(problem);
  };
  Integrator library(shared, Registry::with_built_ins(), kinsol(), options);
  Integrator newton(shared, Registry::with_built_ins(), eigen, options);
  ByHand<S> hand;
  const auto run = [](auto& steppable) {
    return [&steppable] {
      for (int k = 0; k < steps; ++k) (void)steppable.step();
    };
  };
  const auto ns = fewest_nanoseconds({run(library), run(newton), run(hand)}, steps, rounds);
  const auto each = [](long iterations) { return static_cast<double>(iterations) / (rounds * steps); };
  std::printf("%-12s%8.0f%8.0f%9.0f%12.2f%9.2f%10.2f%8.2f%9.2f%9.0e\n", name, ns[0], ns[1], ns[2],
              ns[0] / ns[1], ns[0] / ns[2], each(library.work().iterations), each(newton.work().iterations),
              each(hand.iterations), (library.position() - hand.position()).norm());
}

}  // namespace

int main() {
  std::printf("type1/midpoint: processor time of a step in ns, ratios, Newton iterations in a step\n");
  std::printf("%-12s%25s%21s%27s%9s\n", "", "ns", "KINSOL to", "iterations", "");
  std::printf("%-12s%8s%8s%9s%12s%9s%10s%8s%9s%9s\n", "scene", "KINSOL", "Newton", "by hand", "Newton",
              "by hand", "KINSOL", "Newton", "by hand", "apart");
  compare<KnifeEdge>("knife_edge");
  compare<Pendulum>("pendulum");
  compare<Kepler>("kepler_e06");
}
