/// Variable steps beside fixed ones and IDA: nonlinear systems and processor time to an error at the end, and
/// the energy over long runs.
///
///   adaptive_steps [SCENE…]     work to 1e-6, 1e-8, 1e-10 (all five scenes without any)
///   adaptive_steps --long       1000 orbits of kepler_e099, t = 6283 of contact_oscillator
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/studies/study_run.hpp>
#include <diracstep/validation/studies/work_precision.hpp>
#include <optional>
#include <string>
#include <vector>

#include "timing.hpp"

namespace {

using namespace diracstep;

const std::vector<std::string> scenes{"kepler_e099", "chaplygin_sleigh", "contact_oscillator",
                                      "pendulum_cartesian", "flyball_governor"};

struct Method {
  const char* name;
  const char* label;
  int order;
};
constexpr std::array<Method, 4> methods{{{"type1/gl:3", "GL(3)", 6},
                                         {"type1/gl:4", "GL(4)", 8},
                                         {"type1/gl:6", "GL(6)", 12},
                                         {"type1/midpoint", "composed", 8}}};

/// What a run costs, its errors taken at the end.
struct Point {
  double error = HUGE_VAL;
  double solves = 0.0;
  double seconds = 0.0;
};

Monitor orbit_monitor() {
  return {[](double, ConstVectorRef q, ConstVectorRef) { return std::pow(q.norm(), -1.5); }, false};
}

IntegratorOptions options_of(const Method& method, double step) {
  return {.method = method.name, .order = method.order, .step = step};
}

/// The fewest seconds of three runs of `once`, which returns the end or nothing.
template <class Once>
Point measure(const ReferenceEnd& reference, Once once) {
  Point point;
  point.seconds = HUGE_VAL;
  for (int repeat = 0; repeat < 3; ++repeat) {
    Sample end;
    const double start = processor_seconds();
    if (!once(end, point.solves)) return {};
    const double seconds = processor_seconds() - start;
    point.seconds = std::min(point.seconds, seconds);
    point.error = reference.distance(end);
    if (seconds > 0.3) break;
  }
  return point;
}

Point fixed_run(const CatalogueScene& scene, const Method& method, double step,
                const ReferenceEnd& reference) {
  const StepGrid grid = fit_steps(scene.scene->start.time, scene.t_end, step);
  Integrator integrator(scene.scene, Registry::with_built_ins(), kinsol(), options_of(method, grid.step));
  return measure(reference, [&](Sample& end, double& solves) {
    integrator.reset();
    const RunReport report =
        run_steps(integrator, grid.steps, Momentum::projected, grid.steps, [&](const Sample& sample) {
          end = sample;
          return true;
        });
    solves = static_cast<double>(integrator.work().solves);
    return report.ok();
  });
}

Point variable_run(const CatalogueScene& scene, const Method& method, double eps, StepControl control,
                   const Monitor& monitor, const ReferenceEnd& reference) {
  AdaptiveIntegrator integrator(scene.scene, Registry::with_built_ins(), kinsol(),
                                options_of(method, scene.natural_step),
                                {.eps = eps, .control = control, .monitor = monitor, .end = scene.t_end});
  return measure(reference, [&](Sample& end, double& solves) {
    integrator.reset();
    const RunReport report =
        run_until(integrator, scene.t_end, Momentum::projected, 1'000'000'000, [&](const Sample& sample) {
          end = sample;
          return true;
        });
    solves = static_cast<double>(integrator.work().solves + integrator.side_work().solves);
    return report.ok();
  });
}

/// Runs on a ladder of sizes until the error is below 1e-10, no longer falls or a run takes too long.
template <class RunAt>
std::vector<Point> ladder(double size, RunAt run_at) {
  std::vector<Point> points;
  int failures = 0;
  double least = HUGE_VAL;
  for (int k = 0; k < 40; ++k, size /= std::sqrt(2.0)) {
    const Point point = run_at(size);
    if (!std::isfinite(point.error)) {
      if (++failures > 14) break;
      continue;
    }
    points.push_back(point);
    if (point.error < 3e-11 || point.seconds > 2.0) break;
    if (point.error < 1e-7 && point.error > 3.0 * least) break;  // round-off
    least = std::min(least, point.error);
  }
  return points;
}

std::string at_errors(const std::vector<Point>& points, bool with_solves) {
  std::string text;
  for (const double error : {1e-6, 1e-8, 1e-10}) {
    std::vector<WorkPoint> by_solves, by_time;
    for (const Point& p : points) {
      by_solves.push_back({0.0, p.error, p.solves});
      by_time.push_back({0.0, p.error, p.seconds});
    }
    const auto solves = cpu_seconds_at(by_solves, error), seconds = cpu_seconds_at(by_time, error);
    char cell[64];
    if (!seconds)
      std::snprintf(cell, sizeof cell, " - |");
    else if (with_solves)
      std::snprintf(cell, sizeof cell, " %.0f / %.2f |", *solves, 1e3 * *seconds);
    else
      std::snprintf(cell, sizeof cell, " %.2f |", 1e3 * *seconds);
    text += cell;
  }
  return text;
}

void compare(const std::string& name) {
  const CatalogueScene scene = make_scene(name);
  const ReferenceEnd reference = reference_end(scene, scene.t_end);
  std::printf("\n%s, t = %g, reference: %s, known to %.0e\n\n", name.c_str(), scene.t_end,
              reference.kind.c_str(), reference.self_error);
  std::printf("| method | steps | 1e-6: solves / ms | 1e-8 | 1e-10 |\n|---|---|---|---|---|\n");
  const auto row = [](const char* label, const char* steps, const std::vector<Point>& points) {
    std::printf("| %s | %s |%s\n", label, steps, at_errors(points, true).c_str());
    std::fflush(stdout);
  };
  for (const Method& method : methods) {
    row(method.label, "fixed",
        ladder(8.0 * scene.natural_step, [&](double h) { return fixed_run(scene, method, h, reference); }));
    const auto variable = [&](StepControl control, const Monitor& monitor) {
      return ladder(
          1.0, [&](double eps) { return variable_run(scene, method, eps, control, monitor, reference); });
    };
    row(method.label, "controller", variable(StepControl::integrating, {}));
    row(method.label, "in-step", variable(StepControl::in_step, {}));
    if (name == "kepler_e099")
      row(method.label, "controller, r^-3/2", variable(StepControl::integrating, orbit_monitor()));
  }
  std::vector<Point> ida;
  for (double rtol = 1e-4; rtol > 0.9e-14; rtol /= 10.0) {
    Sample end;
    const StudyRow result =
        run_baseline(ida_method, *completed(scene.scene), scene.t_end, {.rtol = rtol}, 3, reference, end);
    if (result.ok()) ida.push_back({result.error(), 0.0, result.cpu_seconds.min});
  }
  std::printf("| IDA | |%s\n", at_errors(ida, false).c_str());
}

/// Largest energy error in each tenth of a run.
void long_run(const CatalogueScene& scene, const Method& method, double eps, StepControl control,
              const Monitor& monitor, const char* label, double end) {
  AdaptiveIntegrator integrator(scene.scene, Registry::with_built_ins(), kinsol(),
                                options_of(method, scene.natural_step),
                                {.eps = eps, .control = control, .monitor = monitor, .end = end});
  const Start start = scene.scene->start;
  const double energy = scene.scene->energy(start.time, start.q, start.v);
  std::array<double, 10> largest{};
  const double before = processor_seconds();
  const RunReport report = run_until(integrator, end, Momentum::projected, 1, [&](const Sample& sample) {
    const double part = (sample.time - start.time) / (end - start.time);
    double& place = largest.at(static_cast<std::size_t>(std::clamp(10.0 * part, 0.0, 9.0)));
    place = std::max(place, std::abs(sample.energy - energy));
    return std::abs(sample.energy - energy) < 10.0;
  });
  std::printf("| %s | %s, eps %g |", label, method.label, eps);
  for (const double error : largest) std::printf(" %.1e", error);
  std::printf(" | %ld | %ld | %.1f s |%s\n", integrator.work().steps, integrator.control().resets,
              processor_seconds() - before, report.ok() ? "" : report.last.failure.c_str());
  std::fflush(stdout);
}

void long_runs() {
  std::printf(
      "| steps | method | largest energy error in each tenth | steps | resets | time "
      "|\n|---|---|---|---|---|---|\n");
  const struct {
    const char* scene;
    double end, eps;
    Method method;
  } runs[] = {{"kepler_e099", 2000.0 * std::acos(-1.0), 0.3, methods[0]},
              {"contact_oscillator", 6283.185307179586, 0.3, {"type1/gl:2", "GL(2)", 4}},
              {"contact_oscillator", 6283.185307179586, 0.5, {"type1/gl:2", "GL(2)", 4}}};
  for (const auto& r : runs) {
    const CatalogueScene scene = make_scene(r.scene);
    std::printf("| **%s** | | | | | |\n", r.scene);
    long_run(scene, r.method, r.eps, StepControl::integrating, {}, "controller", r.end);
    long_run(scene, r.method, r.eps, StepControl::in_step, {}, "in-step", r.end);
    long_run(scene, r.method, r.eps, StepControl::irreversible, {}, "eps/ω(y_n)", r.end);
  }
}

}  // namespace

int main(int count, char** arguments) {
  if (count > 1 && std::strcmp(arguments[1], "--long") == 0) {
    long_runs();
    return 0;
  }
  if (count == 1)
    for (const std::string& scene : scenes) compare(scene);
  for (int i = 1; i < count; ++i) compare(arguments[i]);
  return 0;
}
