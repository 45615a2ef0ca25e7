// A program that uses DiracStep as its solver: a rolling disk, one formula for L, one for the rows.
#include <array>
#include <cmath>
#include <cstdio>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

using namespace diracstep;

int main() {
  Scene disk;
  disk.name = "vertical_rolling_disk";
  disk.coordinates = {"x", "y", "heading", "roll"};
  disk.lagrangian = lagrangian<4>([](const auto& /*q*/, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]);
  });
  // It rolls without slipping: v_x = cos(heading) v_roll, v_y = sin(heading) v_roll.
  disk.constraints = {pfaffian<4, 2>([]<class T>(const std::array<T, 4>& q) {
    using std::cos, std::sin;
    return std::array<std::array<T, 4>, 2>{
        {{T(1.0), T(0.0), T(0.0), -cos(q[2])}, {T(0.0), T(1.0), T(0.0), -sin(q[2])}}};
  })};
  disk.start = {0.0, Vector::Zero(4), Vector::Zero(4)};
  disk.start.v << 1.0, 0.0, 2.0, 1.0;

  Integrator integrator(std::make_shared<const Scene>(disk), Registry::with_built_ins(), kinsol(),
                        {.method = "type1/midpoint", .order = 4, .step = 0.05});
  const RunReport report = run(integrator, 200, Momentum::projected, 40, [](const Sample& s) {
    std::printf("t = %4.1f   x = %+.6f   y = %+.6f   contact force = (%+.4f, %+.4f)\n", s.time, s.q[0],
                s.q[1], s.lambda[0], s.lambda[1]);
    return true;
  });
  if (!report.ok()) {
    std::fprintf(stderr, "%s\n", report.last.failure.c_str());
    return 1;
  }
  // The centre runs on a circle of radius 1/2: x = sin(2t)/2.
  return std::abs(integrator.position()[0] - std::sin(20.0) / 2.0) < 1e-4 ? 0 : 1;
}
