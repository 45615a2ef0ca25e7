/// A heavy top as a rotation, three unknowns a stage, and as a unit quaternion with its row in R^4, five:
/// processor time of a step at equal step sizes, iterations of Newton's method in it, and the error at the
/// end.  One Lagrangian of the matrix and the rate in the body, by automatic differentiation on both sides.
#include <array>
#include <cmath>
#include <cstdio>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/system/on_space.hpp>
#include <diracstep/solvers/direct_solver.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <memory>
#include <string>
#include <vector>

#include "timing.hpp"

using namespace diracstep;

namespace {

template <class T>
T lagrangian_of_top(const std::array<T, 4>& q, const std::array<T, 3>& w) {
  const auto R = spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
  return 0.5 * (w[0] * w[0] + 1.7 * w[1] * w[1] + 2.4 * w[2] * w[2]) + 0.2 * w[0] * w[1] - 0.3 * R[2][0] +
         0.2 * R[2][1] - 1.1 * R[2][2];
}

const Vector start_turn = (Vector(4) << 0.9, 0.2, -0.3, 0.25).finished().normalized(),
             start_rate = (Vector(3) << 0.8, -1.3, 0.9).finished();

std::shared_ptr<const Scene> by_rotation(std::shared_ptr<const Space> on) {
  auto scene = std::make_shared<Scene>();
  scene->name = "rotation";
  scene->coordinates = {"w1", "w2", "w3"};
  scene->lagrangian =
      on_space(on, lagrangian<4>([]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& v) {
                 return lagrangian_of_top<T>(q, {v[0], v[1], v[2]});
               }));
  scene->start = {0.0, start_turn, start_rate};
  scene->space = std::move(on);
  return scene;
}

template <class T>
std::array<T, 4> half_rate(const std::array<T, 4>& q, const std::array<T, 4>& v) {
  return spaces::SO3::product(std::array<T, 4>{q[0], -q[1], -q[2], -q[3]}, v);
}

/// With a mass along q as well, where the row keeps it still.
std::shared_ptr<const Scene> by_quaternion() {
  auto scene = std::make_shared<Scene>();
  scene->name = "quaternion and row";
  scene->coordinates = {"a", "b", "c", "d"};
  scene->lagrangian = lagrangian<4>([]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& v) {
    const std::array<T, 4> half = half_rate(q, v);
    return lagrangian_of_top<T>(q, {2.0 * half[1], 2.0 * half[2], 2.0 * half[3]}) + 2.0 * half[0] * half[0];
  });
  scene->constraints = {holonomic<4, 1>([]<class T>(const std::array<T, 4>& q) {
    return std::array<T, 1>{0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0)};
  })};
  const std::array<double, 4> q{start_turn[0], start_turn[1], start_turn[2], start_turn[3]},
      w{0.0, start_rate[0], start_rate[1], start_rate[2]};
  const std::array<double, 4> v = spaces::SO3::product(q, w);
  scene->start = {0.0, start_turn, 0.5 * Vector::Map(v.data(), 4)};
  return scene;
}

struct Run {
  std::shared_ptr<const Scene> scene;
  SolverFactory solver;
  std::string method;
  int steps;
  Vector end;
  double iterations = 0.0;

  static constexpr double T = 2.0;
  void operator()() {
    Integrator integrator(scene, Registry::with_built_ins(), solver, {.method = method, .step = T / steps});
    for (int k = 0; k < steps; ++k) {
      const StepReport report = integrator.step();
      if (!report.ok()) {
        std::printf("%s %s: %s\n", scene->name.c_str(), method.c_str(), report.failure.c_str());
        return;
      }
    }
    iterations = static_cast<double>(integrator.work().iterations) / steps;
    end = integrator.position();
  }
};

}  // namespace

int main() {
  const auto exponential = by_rotation(space(spaces::SO3{})),
             cayley = by_rotation(space(spaces::RotationsBy<spaces::Retraction::cayley>{})),
             quaternion = by_quaternion();
  Run reference{exponential, kinsol(), "type1/gl:4", 800, {}};
  reference();
  std::printf(
      "%-10s %-7s %6s  %s\n", "method", "solver", "steps",
      "microseconds a step, iterations, error: rotation | Cayley | quaternion and row | time over that");
  for (const auto& [method, steps] :
       {std::pair{"type1/midpoint", 200}, {"type1/gl:2", 100}, {"type1/gl:3", 50}, {"type1/gl:4", 25}})
    for (const auto& [name, solver] : {std::pair{"kinsol", kinsol()}, {"direct", direct()}}) {
      std::array<Run, 3> runs{Run{exponential, solver, method, steps, {}},
                              Run{cayley, solver, method, steps, {}},
                              Run{quaternion, solver, method, steps, {}}};
      std::vector<std::function<void()>> work;
      for (Run& run : runs)
        work.emplace_back([&run] {
          for (int k = 0; k < 5; ++k) run();
        });
      const std::vector<double> times = fewest_nanoseconds(work, 5 * steps, 15);
      std::printf("%-10s %-7s %6d ", method, name, steps);
      for (std::size_t i = 0; i < 3; ++i)
        std::printf(" %7.2f %4.1f %7.1e |", 1e-3 * times[i], runs[i].iterations,
                    std::min((runs[i].end - reference.end).norm(), (runs[i].end + reference.end).norm()));
      std::printf(" %.2f %.2f\n", times[0] / times[2], times[1] / times[2]);
    }
  return 0;
}
