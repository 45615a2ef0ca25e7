#include <array>
#include <cmath>
#include <cstdio>
#include <diracstep/diracstep.hpp>

using namespace diracstep;

int main() {
  // A skate on a slope: L(q, v), and one row that forbids sliding across the blade.
  Scene skate;
  skate.name = "skate";
  skate.coordinates = {"x", "y", "heading"};
  skate.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + 0.7 * q[0];
  });
  skate.constraints = {pfaffian<3, 1>([]<class T>(const std::array<T, 3>& q) {
    using std::cos, std::sin;
    return std::array<std::array<T, 3>, 1>{{{sin(q[2]), -cos(q[2]), T(0.0)}}};
  })};
  skate.start = {0.0, Vector::Zero(3), Vector::Unit(3, 2)};  // at rest, turning at unit rate

  // The Gauss-Lobatto Dirac step with three stages, order 6.
  Integrator integrator(std::make_shared<const Scene>(skate), Registry::with_built_ins(), kinsol(),
                        {.method = "type1/gl:3", .step = 0.1});
  const RunReport report = run_steps(integrator, 100, Momentum::projected, 20, [](const Sample& s) {
    std::printf("t = %4.1f  x = %.9f  y = %.9f  force across the blade = %+.6f\n", s.time, s.q[0], s.q[1],
                s.lambda[0]);
    return true;
  });
  if (!report.ok()) std::fprintf(stderr, "%s\n", report.last.failure.c_str());
  return report.ok() ? 0 : 1;
}
