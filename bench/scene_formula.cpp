/// Cost of one residual and one Jacobian of a step: scenes from files against the same scenes in hand-written
/// C++ and with automatic differentiation (jets).  Then the time to load hanging_chain at 100,000 unknowns.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <functional>
#include <stdexcept>
#include <vector>

#include "timing.hpp"

namespace {

using namespace diracstep;

// Double pendulum, L by hand.

class DoublePendulum final : public Lagrangian {
 public:
  DoublePendulum() : Lagrangian(SparsityPattern::dense(2, 2)) {}

  double value(double, ConstVectorRef q, ConstVectorRef v) const override {
    return a_ * v[0] * v[0] / 2 + b_ * v[1] * v[1] / 2 + c_ * v[0] * v[1] * std::cos(q[0] - q[1]) +
           d_ * std::cos(q[0]) + e_ * std::cos(q[1]);
  }
  void gradient(double, ConstVectorRef q, ConstVectorRef v, VectorRef fx, VectorRef fy) const override {
    const double s = c_ * std::sin(q[0] - q[1]), c = c_ * std::cos(q[0] - q[1]);
    fx[0] = -s * v[0] * v[1] - d_ * std::sin(q[0]);
    fx[1] = s * v[0] * v[1] - e_ * std::sin(q[1]);
    fy[0] = a_ * v[0] + c * v[1];
    fy[1] = b_ * v[1] + c * v[0];
  }
  void hessian(double, ConstVectorRef q, ConstVectorRef v, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    const double s = c_ * std::sin(q[0] - q[1]), c = c_ * std::cos(q[0] - q[1]), w = c * v[0] * v[1];
    fxx[0] = -w - d_ * std::cos(q[0]);
    fxx[1] = fxx[2] = w;
    fxx[3] = -w - e_ * std::cos(q[1]);
    fxy[0] = -s * v[1];
    fxy[1] = s * v[1];
    fxy[2] = -s * v[0];
    fxy[3] = s * v[0];
    fyy[0] = a_;
    fyy[1] = fyy[2] = c;
    fyy[3] = b_;
  }
  void gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef fyt) const override { fyt.setZero(); }

 private:
  static constexpr double g_ = 9.80665, a_ = 12.0, b_ = 18.0, c_ = 12.0, d_ = 6.0 * g_, e_ = 6.0 * g_;
};

// Pendulum and knife edge: L and rows by hand.

class PointMass final : public Lagrangian {
 public:
  PointMass() : Lagrangian(SparsityPattern(2, 2, {{0, 0}, {1, 1}}), {true, true, true, true}) {}
  double value(double, ConstVectorRef q, ConstVectorRef v) const override {
    return v.squaredNorm() / 2 - g_ * q[1];
  }
  void gradient(double, ConstVectorRef, ConstVectorRef v, VectorRef fx, VectorRef fy) const override {
    fx[0] = 0.0;
    fx[1] = -g_;
    fy = v;
  }
  void hessian(double, ConstVectorRef, ConstVectorRef, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    fxx.setZero();
    fxy.setZero();
    fyy.setOnes();
  }
  void gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef fyt) const override { fyt.setZero(); }

 private:
  static constexpr double g_ = 13.750371636040745;
};

class Rod final : public ConstraintRows {
 public:
  Rod()
      : ConstraintRows(true, SparsityPattern::dense(1, 2), SparsityPattern(2, 2, {{0, 0}, {1, 1}}), {"rod"}) {
  }
  void position(double, ConstVectorRef q, VectorRef phi) const override { phi[0] = q.squaredNorm() - 1.0; }
  void coefficients(double, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    a = 2.0 * q;
    b[0] = 0.0;
  }
  void derivative(double, ConstVectorRef, ConstVectorRef w, double, VectorRef d) const override {
    d = 2.0 * w;
  }
  void time_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const override { d.setZero(); }
  void annihilator_derivative(double, ConstVectorRef, ConstVectorRef lambda, VectorRef d) const override {
    d.setConstant(2.0 * lambda[0]);
  }
};

class Skate final : public Lagrangian {
 public:
  Skate() : Lagrangian(SparsityPattern(3, 3, {{0, 0}, {1, 1}, {2, 2}}), {true, true, true, true}) {}
  double value(double, ConstVectorRef q, ConstVectorRef v) const override {
    return v.squaredNorm() / 2 + s_ * q[0];
  }
  void gradient(double, ConstVectorRef, ConstVectorRef v, VectorRef fx, VectorRef fy) const override {
    fx.setZero();
    fx[0] = s_;
    fy = v;
  }
  void hessian(double, ConstVectorRef, ConstVectorRef, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    fxx.setZero();
    fxy.setZero();
    fyy.setOnes();
  }
  void gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef fyt) const override { fyt.setZero(); }

 private:
  static constexpr double s_ = 0.7173560908995228;
};

class Blade final : public ConstraintRows {
 public:
  Blade()
      : ConstraintRows(false, SparsityPattern::dense(1, 3),
                       SparsityPattern(3, 3, {{0, 2}, {1, 2}, {2, 0}, {2, 1}}), {"blade"}) {}
  void coefficients(double, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    a[0] = std::sin(q[2]);
    a[1] = -std::cos(q[2]);
    a[2] = b[0] = 0.0;
  }
  void derivative(double, ConstVectorRef q, ConstVectorRef w, double, VectorRef d) const override {
    d[0] = d[1] = 0.0;
    d[2] = std::cos(q[2]) * w[0] + std::sin(q[2]) * w[1];
  }
  void time_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const override { d.setZero(); }
  void annihilator_derivative(double, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    d[0] = d[1] = 0.0;  // columns 0 and 1, row 2
    d[2] = lambda[0] * std::cos(q[2]);
    d[3] = lambda[0] * std::sin(q[2]);
  }
};

// Hanging chain: loops over the links.

class ChainMasses final : public Lagrangian {
 public:
  explicit ChainMasses(int n)
      : Lagrangian(SparsityPattern::diagonal(2 * n), {true, true, true, true}), n_(n) {}
  double value(double, ConstVectorRef q, ConstVectorRef v) const override {
    double sum = v.squaredNorm() / 2;
    for (int j = 0; j < n_; ++j) sum -= g_ * q[2 * j + 1];
    return sum / n_;
  }
  void gradient(double, ConstVectorRef, ConstVectorRef v, VectorRef fx, VectorRef fy) const override {
    for (int j = 0; j < n_; ++j) {
      fx[2 * j] = 0.0;
      fx[2 * j + 1] = -g_ / n_;
    }
    fy = v / n_;
  }
  void hessian(double, ConstVectorRef, ConstVectorRef, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    fxx.setZero();
    fxy.setZero();
    fyy.setConstant(1.0 / n_);
  }
  void gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef fyt) const override { fyt.setZero(); }

 private:
  static constexpr double g_ = 9.81;
  int n_;
};

class ChainLinks final : public ConstraintRows {
 public:
  explicit ChainLinks(int n) : ConstraintRows(true, links(n), neighbours(n), names(n)), n_(n) {}

  void position(double, ConstVectorRef q, VectorRef phi) const override {
    for (int j = 0; j < n_; ++j) {
      const double dx = q[2 * j] - (j > 0 ? q[2 * j - 2] : 0.0),
                   dy = q[2 * j + 1] - (j > 0 ? q[2 * j - 1] : 0.0);
      phi[j] = dx * dx + dy * dy - 1.0 / (static_cast<double>(n_) * n_);
    }
  }
  void coefficients(double, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    along(q, a);
    b.setZero();
  }
  void derivative(double, ConstVectorRef, ConstVectorRef w, double, VectorRef d) const override {
    along(w, d);
  }
  void time_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const override { d.setZero(); }
  void annihilator_derivative(double, ConstVectorRef, ConstVectorRef lambda, VectorRef d) const override {
    Eigen::Index k = 0;  // column i = 2j + xy: rows of masses j−1, j, j+1
    for (int j = 0; j < n_; ++j)
      for (int xy = 0; xy < 2; ++xy) {
        if (j > 0) d[k++] = -2.0 * lambda[j];
        d[k++] = 2.0 * (lambda[j] + (j + 1 < n_ ? lambda[j + 1] : 0.0));
        if (j + 1 < n_) d[k++] = -2.0 * lambda[j + 1];
      }
  }

 private:
  /// 2 (u_j − u_{j−1}) and its negative on the pattern: column by column rows j and j+1.
  void along(ConstVectorRef u, VectorRef a) const {
    Eigen::Index k = 0;
    for (int i = 0; i < 2 * n_; ++i) {
      a[k++] = 2.0 * (u[i] - (i > 1 ? u[i - 2] : 0.0));
      if (i + 2 < 2 * n_) a[k++] = -2.0 * (u[i + 2] - u[i]);
    }
  }
  static SparsityPattern links(int n) {
    std::vector<std::pair<int, int>> entries;
    for (int i = 0; i < 2 * n; ++i) {
      entries.emplace_back(i / 2, i);
      if (i / 2 + 1 < n) entries.emplace_back(i / 2 + 1, i);
    }
    return {n, 2 * n, entries};
  }
  static SparsityPattern neighbours(int n) {
    std::vector<std::pair<int, int>> entries;
    for (int i = 0; i < 2 * n; ++i)
      for (const int other : {i - 2, i, i + 2})
        if (other >= 0 && other < 2 * n) entries.emplace_back(other, i);
    return {2 * n, 2 * n, entries};
  }
  static std::vector<std::string> names(int n) {
    std::vector<std::string> all;
    for (int j = 1; j <= n; ++j) all.push_back("link_" + std::to_string(j));
    return all;
  }
  int n_;
};

// The same with jets.

std::shared_ptr<const Lagrangian> jet_double_pendulum() {
  return lagrangian<2>([](const auto& q, const auto& v) {
    const double g = 9.80665;
    return 6.0 * v[0] * v[0] + 9.0 * v[1] * v[1] + 12.0 * v[0] * v[1] * cos(q[0] - q[1]) +
           6.0 * g * cos(q[0]) + 6.0 * g * cos(q[1]);
  });
}
std::shared_ptr<const Lagrangian> jet_point_mass() {
  return lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) - 13.750371636040745 * q[1];
  });
}
std::shared_ptr<const ConstraintRows> jet_rod() {
  return holonomic<2, 1>(
      []<class T>(const std::array<T, 2>& q) { return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0}; });
}
std::shared_ptr<const Lagrangian> jet_skate() {
  return lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + 0.7173560908995228 * q[0];
  });
}
std::shared_ptr<const ConstraintRows> jet_blade() {
  return pfaffian<3, 1>([]<class T>(const std::array<T, 3>& q) {
    using std::cos, std::sin;
    return std::array<std::array<T, 3>, 1>{{{sin(q[2]), -cos(q[2]), T(0)}}};
  });
}

/// Keeps hold of the step's problem and of where it was solved.
class Capture final : public NonlinearSolver {
 public:
  Capture(NonlinearProblem& problem, StepProblem** step, Vector* solution)
      : inner_(kinsol()(problem)), solution_(solution) {
    is_step_ = dynamic_cast<StepProblem*>(&problem) != nullptr;
    if (is_step_) *step = dynamic_cast<StepProblem*>(&problem);
  }
  SolveReport solve(VectorRef x) override {
    const SolveReport report = inner_->solve(x);
    if (is_step_) *solution_ = x;
    return report;
  }
  std::string description() const override { return inner_->description(); }

 private:
  std::unique_ptr<NonlinearSolver> inner_;
  Vector* solution_;
  bool is_step_;
};

struct Cost {
  double residual, jacobian;  ///< nanoseconds, the least of several runs
};

/// Of one call; the calls take turns at two points, so that nothing can be kept from the last one.
double nanoseconds(const Vector& x, const std::function<void(const Vector&)>& call) {
  constexpr int calls = 400, rounds = 100;
  const Vector y = x * (1.0 + 1e-9);
  const auto work = [&] {
    for (int i = 0; i < calls; ++i) call(i % 2 == 0 ? x : y);
  };
  return fewest_nanoseconds({work}, calls, rounds)[0];
}

Cost cost(std::shared_ptr<const Scene> scene) {
  StepProblem* step = nullptr;
  Vector x;
  const SolverFactory capture = [&](NonlinearProblem& problem) {
    return std::make_unique<Capture>(problem, &step, &x);
  };
  Integrator integrator(std::move(scene), Registry::with_built_ins(), capture,
                        {"type1/midpoint", 2, 0.01, {}});
  if (!integrator.step().ok()) throw std::runtime_error("the step failed");
  Vector f(step->size()), values(step->pattern().nonzeros());
  return {nanoseconds(x, [&](const Vector& at) { step->residual(at, f); }),
          nanoseconds(x, [&](const Vector& at) { step->jacobian(at, values); })};
}

std::shared_ptr<const Scene> with(const CatalogueScene& entry, std::shared_ptr<const Lagrangian> lagrangian,
                                  ConstraintBlocks rows) {
  auto scene = std::make_shared<Scene>(*entry.scene);
  scene->lagrangian = std::move(lagrangian);
  scene->constraints = std::move(rows);
  return scene;
}

void line(const char* name, const Cost& file, const Cost& hand, const Cost* jets) {
  std::printf("%-20s %9.0f %9.0f", name, hand.residual, file.residual);
  jets != nullptr ? std::printf(" %9.0f", jets->residual) : std::printf(" %9s", "-");
  std::printf("  %5.2f   %9.0f %9.0f", file.residual / hand.residual, hand.jacobian, file.jacobian);
  jets != nullptr ? std::printf(" %9.0f", jets->jacobian) : std::printf(" %9s", "-");
  std::printf("  %5.2f\n", file.jacobian / hand.jacobian);
}

void compare(const char* name, std::shared_ptr<const Lagrangian> hand_l, ConstraintBlocks hand_rows,
             std::shared_ptr<const Lagrangian> jet_l, ConstraintBlocks jet_rows) {
  const CatalogueScene entry = make_scene(name);
  const Cost file = cost(entry.scene), hand = cost(with(entry, std::move(hand_l), std::move(hand_rows)));
  if (!jet_l) return line(name, file, hand, nullptr);
  const Cost jets = cost(with(entry, std::move(jet_l), std::move(jet_rows)));
  line(name, file, hand, &jets);
}

}  // namespace

int main() try {
  std::printf("One residual and one Jacobian of type1/midpoint, ns; ratio = file / by hand\n");
  std::printf("%-20s %9s %9s %9s  %5s   %9s %9s %9s  %5s\n", "", "residual", "", "", "", "Jacobian", "", "",
              "");
  std::printf("%-20s %9s %9s %9s  %5s   %9s %9s %9s  %5s\n", "scene", "by hand", "file", "jets", "ratio",
              "by hand", "file", "jets", "ratio");
  compare("double_pendulum", std::make_shared<DoublePendulum>(), {}, jet_double_pendulum(), {});
  compare("pendulum_cartesian", std::make_shared<PointMass>(), {std::make_shared<Rod>()}, jet_point_mass(),
          {jet_rod()});
  compare("knife_edge", std::make_shared<Skate>(), {std::make_shared<Blade>()}, jet_skate(), {jet_blade()});
  compare("hanging_chain", std::make_shared<ChainMasses>(64), {std::make_shared<ChainLinks>(64)}, nullptr,
          {});

  const double begin = processor_seconds();
  const CatalogueScene chain = make_scene("hanging_chain", {{"N", 33334}});
  std::printf("\nhanging_chain with %d unknowns loads in %.2f s (%s)\n",
              chain.scene->dimension() + chain.scene->rows(), processor_seconds() - begin,
              chain.code.c_str());
} catch (const std::exception& error) {
  std::fprintf(stderr, "scene_formula: %s\n", error.what());
  return 1;
}
