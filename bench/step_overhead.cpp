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
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "step_overhead_scenes.hpp"
#include "timing.hpp"

using namespace diracstep;

namespace {

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
