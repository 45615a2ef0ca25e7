/// Explicit codes on index-reduced equations beside the fixed steps of the library: processor time in which
/// the end of four small scenes is reached with an error, of ARKODE and Boost.odeint as the study runs them,
/// and of Boost.odeint on equations written out by hand for the scene.  Before it what one right-hand side
/// costs: as a saddle-point system of any size, with sizes known when it is compiled, and by hand.
#include <array>
#include <cmath>
#include <cstdio>
#include <diracstep/solvers/direct_solver.hpp>
#include <diracstep/validation/references/odeint_steps.hpp>
#include <diracstep/validation/studies/study_run.hpp>
#include <diracstep/validation/studies/work_precision.hpp>
#include <functional>
#include <string>
#include <vector>

#include "fine_reference.hpp"
#include "timing.hpp"

namespace {

using namespace diracstep;

constexpr std::array<double, 3> errors{1e-3, 1e-6, 1e-9};

/// Unit masses: accelerations of (q, v).
void kepler(const double* y, double* a) {
  const double square = y[0] * y[0] + y[1] * y[1], cube = 1.0 / (square * std::sqrt(square));
  a[0] = -cube * y[0], a[1] = -cube * y[1];
}

void pendulum(const double* y, double* a) {
  constexpr double g = 13.750371636040745;
  const double force = (g * y[1] - y[2] * y[2] - y[3] * y[3]) / (y[0] * y[0] + y[1] * y[1]);  // along (x, y)
  a[0] = force * y[0], a[1] = force * y[1] - g;
}

void knife_edge(const double* y, double* a) {
  constexpr double slope = 0.7173560908995228;
  const double s = std::sin(y[2]), c = std::cos(y[2]);
  const double force = -(c * y[3] + s * y[4]) * y[5] - slope * s;
  a[0] = slope + force * s, a[1] = -force * c, a[2] = 0.0;
}

void contact(const double* y, double* a) {
  const double fx = -y[0] - 0.3 * y[0] * y[2] * y[2], fz = -y[2] - 0.3 * y[0] * y[0] * y[2];
  const double force = -(y[4] * y[5] + fx + y[1] * fz) / (1.0 + y[1] * y[1]);
  a[0] = fx + force, a[1] = -y[1], a[2] = fz + force * y[1];
}

template <int n, void (*acceleration)(const double*, double*)>
class ByHand final : public SizedEquations {
 public:
  int size() const override { return 2 * n; }
  bool rate(const double* y, double* rate) override {
    for (int r = 0; r < n; ++r) rate[r] = y[n + r];
    acceleration(y, rate + n);
    return true;
  }
};

struct Case {
  const char* scene;
  std::shared_ptr<SizedEquations> by_hand;
};

/// q and v of the start, one behind the other.
std::vector<double> start_of(const Scene& scene) {
  std::vector<double> y(scene.start.q.begin(), scene.start.q.end());
  y.insert(y.end(), scene.start.v.begin(), scene.start.v.end());
  return y;
}

void compare_rates(const Case& at) {
  constexpr int calls = 20'000;
  const CatalogueScene entry = make_scene(at.scene);
  ReducedEquations general(*entry.scene, true);
  const auto sized = sized_equations(*entry.scene);
  std::vector<double> y = start_of(*entry.scene);
  y[0] += 0.01, y[1] += 0.02;  // no entry is zero by chance
  const auto n = static_cast<Eigen::Index>(y.size());
  Vector rate(n), by_size(n), by_hand(n);
  // A call waits for the one before it, as a stage does for the stages before.
  const double first = y[0];
  const auto repeated = [&](Vector& to, const std::function<void()>& call) {
    return std::function<void()>([&, call] {
      for (int k = 0; k < calls; ++k) {
        call();
        y[0] = first + 1e-30 * to.sum();
      }
    });
  };
  const auto ns = fewest_nanoseconds(
      {repeated(rate, [&] { general.rate(0.0, Eigen::Map<const Vector>(y.data(), n), rate); }),
       repeated(by_size, [&] { sized->rate(y.data(), by_size.data()); }),
       repeated(by_hand, [&] { at.by_hand->rate(y.data(), by_hand.data()); })},
      calls, 15);
  std::printf(
      "%-20s%10.0f%10.0f%10.0f%14.1f%10.0e\n", at.scene, ns[0], ns[1], ns[2], ns[1] / ns[2],
      std::max((by_size - rate).lpNorm<Eigen::Infinity>(), (by_hand - rate).lpNorm<Eigen::Infinity>()));
}

/// Half decades from 1e-2 to 1e-14.
std::vector<double> tolerances() {
  std::vector<double> all;
  for (int k = 4; k < 28; ++k) all.push_back(std::pow(10.0, -0.5 * k));
  all.push_back(1e-14);  // no less is allowed
  return all;
}

double fewest(int rounds, const std::function<double()>& seconds) {
  double least = HUGE_VAL;
  for (int k = 0; k < rounds; ++k) least = std::min(least, seconds());
  return least;
}

constexpr int rounds = 7;

std::vector<WorkPoint> of_library(const CatalogueScene& entry, const ReferenceEnd& reference, int s,
                                  const SolverFactory& solver) {
  std::vector<WorkPoint> points;
  const Registry registry = Registry::with_built_ins();
  const double span = entry.t_end - entry.scene->start.time;
  for (double steps = std::max(4.0, std::ceil(span / (4.0 * entry.natural_step))); steps < 1e5;
       steps = std::ceil(steps * 1.25)) {
    Integrator integrator(entry.scene, registry, solver,
                          {.method = "type1/gl:" + std::to_string(s), .step = span / steps});
    const StudyRow row = run_ours(integrator, std::lround(steps), Momentum::projected, rounds, reference);
    if (!row.ok()) continue;
    points.push_back({row.step, row.error(), row.cpu_seconds.min});
    if (row.error() < 0.3 * errors.back()) break;
  }
  return points;
}

std::vector<WorkPoint> of_code(const CatalogueScene& entry, const ReferenceEnd& reference,
                               ExplicitCode code) {
  std::vector<WorkPoint> points;
  for (const double rtol : tolerances()) {
    ReferenceRun run;
    const double seconds = fewest(rounds, [&] {
      run = integrate_explicitly(*entry.scene, entry.t_end, {.rtol = rtol}, code);
      return run.cpu_seconds;
    });
    if (run.ok()) points.push_back({rtol, reference.distance(run.end), seconds});
  }
  return points;
}

std::vector<WorkPoint> of_hand(const CatalogueScene& entry, const ReferenceEnd& reference,
                               SizedEquations& equations, ExplicitCode code) {
  std::vector<WorkPoint> points;
  const Eigen::Index n = entry.scene->dimension();
  for (const double rtol : tolerances()) {
    std::vector<double> y;
    ReferenceRun run;
    const double seconds = fewest(rounds, [&] {
      y = start_of(*entry.scene);
      run = {};
      double t = entry.scene->start.time;
      const double before = thread_seconds();
      integrate_by_odeint(equations, code, entry.t_end, {.rtol = rtol}, y.data(), t, run);
      return thread_seconds() - before;
    });
    Sample end;
    end.q = Vector::Map(y.data(), n);
    end.p = Vector::Map(y.data() + n, n);  // of unit masses
    if (run.ok()) points.push_back({rtol, reference.distance(end), seconds});
  }
  return points;
}

void compare(const Case& at) {
  const CatalogueScene entry = make_scene(at.scene);
  const ReferenceEnd reference = fine_reference(entry, Registry::with_built_ins());
  std::array<std::vector<WorkPoint>, 2> ours;
  for (int s = 3; s <= 6; ++s) {
    const auto newton = of_library(entry, reference, s, kinsol());
    const auto directly = of_library(entry, reference, s, direct());
    ours[0].insert(ours[0].end(), newton.begin(), newton.end());
    ours[1].insert(ours[1].end(), directly.begin(), directly.end());
  }
  std::vector<std::vector<WorkPoint>> sides{ours[0], ours[1]};
  for (const ExplicitCode code :
       {ExplicitCode::arkode, ExplicitCode::fehlberg78, ExplicitCode::bulirsch_stoer})
    sides.push_back(of_code(entry, reference, code));
  for (const ExplicitCode code : {ExplicitCode::fehlberg78, ExplicitCode::bulirsch_stoer})
    sides.push_back(of_hand(entry, reference, *at.by_hand, code));
  for (const double error : errors) {
    std::printf("%-20s%8.0e", at.scene, error);
    for (const auto& side : sides) {
      const auto seconds = cpu_seconds_within(side, error);
      if (seconds)
        std::printf("%10.1f", 1e6 * *seconds);
      else
        std::printf("%10s", "-");
    }
    std::printf("\n");
    std::fflush(stdout);
  }
}

}  // namespace

int main() {
  if (!has_odeint()) {
    std::printf("built without Boost.odeint\n");
    return 0;
  }
  const std::vector<Case> cases{{"kepler_e06", std::make_shared<ByHand<2, kepler>>()},
                                {"pendulum_cartesian", std::make_shared<ByHand<2, pendulum>>()},
                                {"knife_edge", std::make_shared<ByHand<3, knife_edge>>()},
                                {"contact_oscillator", std::make_shared<ByHand<3, contact>>()}};
  std::printf("ns of a right-hand side\n%-20s%10s%10s%10s%14s%10s\n", "", "any size", "sized", "by hand",
              "sized/by hand", "apart");
  for (const Case& at : cases) compare_rates(at);
  std::printf(
      "\nus in which an error is reached: the fastest of GL(3) to GL(6) by KINSOL and by direct(); the codes "
      "of "
      "the study;\nBoost.odeint by hand\n%-20s%8s%10s%10s%10s%10s%10s%10s%10s\n",
      "", "error", "KINSOL", "direct", "ARKODE", "F 7(8)", "B-S", "F hand", "B-S hand");
  for (const Case& at : cases) compare(at);
  return 0;
}
