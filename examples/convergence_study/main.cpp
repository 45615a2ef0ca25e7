// A convergence study of a scene of one's own, by library calls: a charged particle in a magnetic field and a
// harmonic trap,
//
//   L = ½ (vx² + vy²) + ½ B (x vy − y vx) − ½ k (x² + y²),
//
// whose motion is known: with ζ = x + iy,  ζ'' = −iB ζ' − k ζ,  so  ζ = a exp(iω₁t) + c exp(iω₂t).
#include <complex>
#include <cstdio>
#include <diracstep/reports/report.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>

using namespace diracstep;
using Complex = std::complex<double>;

namespace {

constexpr double field = 3.0, stiffness = 1.0;
constexpr Complex i(0.0, 1.0), start(1.0, 0.2), start_velocity(0.3, -0.5);

std::optional<ReferencePoint> exact(double t) {
  const double root = std::sqrt(field * field / 4.0 + stiffness);
  const double w1 = -field / 2.0 + root, w2 = -field / 2.0 - root;
  const Complex a = (start_velocity - i * w2 * start) / (i * (w1 - w2)), c = start - a;
  const Complex z = a * std::exp(i * w1 * t) + c * std::exp(i * w2 * t);
  const Complex v = i * (w1 * a * std::exp(i * w1 * t) + w2 * c * std::exp(i * w2 * t));
  return ReferencePoint{Eigen::Vector2d(z.real(), z.imag()), Eigen::Vector2d(v.real(), v.imag())};
}

CatalogueScene trapped_particle() {
  auto scene = std::make_shared<Scene>();
  scene->name = "trapped_particle";
  scene->coordinates = {"x", "y"};
  scene->lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 0.5 * field * (q[0] * v[1] - q[1] * v[0]) -
           0.5 * stiffness * (q[0] * q[0] + q[1] * q[1]);
  });
  scene->start = {0.0, Eigen::Vector2d(start.real(), start.imag()),
                  Eigen::Vector2d(start_velocity.real(), start_velocity.imag())};
  CatalogueScene entry;
  entry.scene = scene;
  entry.t_end = 7.3;
  entry.natural_step = 0.2;
  entry.reference = {"exact", "two circular motions", 1e-15, exact};
  return entry;
}

}  // namespace

int main() {
  const StudyOptions options{.methods = {"type1/midpoint", "type1/gl:3"},
                             .orders = {2, 4, 6},
                             .rtols = {1e-4, 1e-6, 1e-8},
                             .repeats = 1,
                             .run_budget = 0.05};
  const Study study = convergence_study(trapped_particle(), Registry::with_built_ins(), kinsol(), options);
  std::fputs(study_table(study).c_str(), stdout);
  const auto is_confirmed = [&](const char* method, int order) {
    for (const auto& measured : study.measured_orders)
      if (measured.method == method && measured.order == order) return confirms_order(measured, 0.2);
    return false;
  };
  return is_confirmed("type1/midpoint", 2) && is_confirmed("type1/midpoint", 4) &&
                 is_confirmed("type1/gl:3", 6)
             ? 0
             : 1;
}
