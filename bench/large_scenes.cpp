/// Large scenes from a thousand to a million unknowns: processor time of a step for each unknown, beside the
/// bare work of such a step, and memory.
///   large_scenes [LARGEST [SCENE]]   default 1e6 unknowns of hanging_chain and toda_200, some minutes;
///   memory is read from /proc and left out elsewhere
///
/// Columns, times in nanoseconds for each unknown:
///   step        a step;   /least  beside the least of all sizes
///   it res Jac  iterations, residuals and Jacobians of a step
///   refactor solve residual Jacobian   the bare work, one of each: KLU with given pivots and without scaling
///   KLU/least   refactor + solve beside the least of all sizes: what the caches alone cost
///   /bare       step beside  it · (refactor + solve + residual + Jacobian)
///   /same       step beside  Jac · (refactor + Jacobian) + it · solve + res · residual
///   kB          resident memory, 1000 bytes;   build s  seconds for scene and integrator
#include <klu.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "timing.hpp"

using namespace diracstep;

namespace {

/// What is measured of one size, as the program of that size prints it.
enum Column {
  unknowns,
  step,
  iterations,
  residuals,
  jacobians,
  refactor,
  solve,
  residual,
  jacobian,
  memory,
  build,
  columns
};
using Measurement = std::array<double, columns>;

/// Kilobytes, 1000 bytes each, of this program that are in memory; 0 where that cannot be known.
double resident_kilobytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmRSS:")) return 1.024 * std::strtod(line.c_str() + 6, nullptr);
  return 0.0;
}

/// The step of `method` on its own, at the end of a run.
struct BareStep {
  BareStep(const Integrator& at, const char* method)
      : problem(Registry::with_built_ins().method(method).make_step(at.scene(), {})), x(problem->size()) {
    problem->begin({at.time(), at.options().step}, {at.position(), at.momentum(), at.velocity_estimate()},
                   {});
    problem->guess(at.velocity_estimate(), x);
    other = x * (1.0 + 1e-9);
    f.setZero(x.size());
    values.setZero(problem->pattern().nonzeros());
    problem->residual(x, f);
    problem->jacobian(x, values);
  }
  /// At two points in turn, for nothing is computed twice at one.
  void residual() {
    problem->residual(x, f);
    x.swap(other);
  }
  void jacobian() { problem->jacobian(x, values); }

  std::unique_ptr<StepProblem> problem;
  Vector x, other, f, values;
};

/// KLU as the library sets it, without the library.
struct BareKlu {
  explicit BareKlu(BareStep& step)
      : starts(step.problem->pattern().column_starts().begin(),
               step.problem->pattern().column_starts().end()),
        rows(step.problem->pattern().row_indices().begin(), step.problem->pattern().row_indices().end()),
        values(step.values),
        b(step.f) {
    klu_defaults(&common);
    common.btf = 0;
    common.ordering = 0;
    common.tol = 0.1;
    symbolic = klu_analyze(size(), starts.data(), rows.data(), &common);
    numeric = klu_factor(starts.data(), rows.data(), values.data(), symbolic, &common);
    common.scale = -1;
    refactor();
  }
  BareKlu(const BareKlu&) = delete;
  BareKlu& operator=(const BareKlu&) = delete;
  ~BareKlu() {
    klu_free_numeric(&numeric, &common);
    klu_free_symbolic(&symbolic, &common);
  }
  int size() const { return static_cast<int>(starts.size()) - 1; }
  void refactor() { klu_refactor(starts.data(), rows.data(), values.data(), symbolic, numeric, &common); }
  void solve() { klu_solve(symbolic, numeric, size(), 1, b.data(), &common); }

  std::vector<int> starts, rows;
  Vector values, b;
  klu_common common{};
  klu_symbolic* symbolic = nullptr;
  klu_numeric* numeric = nullptr;
};

/// Steps past the first ones, in which predictors are compared, again and again from the start.
bool measure_steps(Integrator& integrator, Measurement& m) {
  constexpr int before = 16, timed = 16;
  const int rounds = m[unknowns] > 3e5 ? 2 : 6;
  m[step] = HUGE_VAL;
  for (int round = 0; round < rounds; ++round) {
    integrator.reset();
    for (int k = 0; k < before; ++k)
      if (!integrator.step().ok()) return false;
    const Work start = integrator.work();
    const double seconds = processor_seconds();
    for (int k = 0; k < timed; ++k) (void)integrator.step();
    m[step] = std::min(m[step], 1e9 * (processor_seconds() - seconds) / timed / m[unknowns]);
    const Work end = integrator.work();
    m[iterations] = double(end.iterations - start.iterations) / timed;
    m[residuals] = double(end.residual_evaluations - start.residual_evaluations) / timed;
    m[jacobians] = double(end.jacobian_evaluations - start.jacobian_evaluations) / timed;
  }
  return true;
}

void measure_bare(const Integrator& integrator, const char* method, Measurement& m) {
  BareStep bare(integrator, method);
  BareKlu klu(bare);
  const int count = std::max(4, static_cast<int>(4e5 / m[unknowns]));
  const auto times = [&](auto work) {
    return [work, count] {
      for (int k = 0; k < count; ++k) work();
    };
  };
  const auto ns = fewest_nanoseconds({times([&] { klu.refactor(); }), times([&] { klu.solve(); }),
                                      times([&] { bare.residual(); }), times([&] { bare.jacobian(); })},
                                     count, 5);
  for (std::size_t k = 0; k < 4; ++k) m.at(refactor + k) = ns[k] / m[unknowns];
}

/// Steps that grow with the length of a link, so that every size has the same step beside its fastest motion.
bool measure(const std::string& scene, const char* method, Measurement& m) {
  const bool chain = scene == "hanging_chain";
  const double sites = std::floor(m[unknowns] / (chain ? 3.0 : 1.0));
  const double h = chain ? 0.75 / m[unknowns] : 0.05;
  const double memory_before = resident_kilobytes(), start = processor_seconds();
  const CatalogueScene entry = make_scene(scene, {{"N", sites}});
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = h});
  m[build] = processor_seconds() - start;
  if (!measure_steps(integrator, m)) return false;
  m[memory] = (resident_kilobytes() - memory_before) / m[unknowns];
  measure_bare(integrator, method, m);
  return true;
}

/// Each size is measured by a process of its own, so that the memory of one is not that of the next.  Ends
/// the program where a size cannot be measured.
Measurement measure_apart(const std::string& scene, const char* method, double size) {
  std::array<int, 2> ends{};
  const pid_t child = pipe(ends.data()) == 0 ? fork() : -1;
  Measurement m{};
  m[unknowns] = size;
  if (child == 0) {
    const bool measured = measure(scene, method, m);
    const auto written = measured ? write(ends[1], m.data(), sizeof m) : 0;
    _exit(written == sizeof m ? 0 : 1);
  }
  close(ends[1]);
  const auto got = child > 0 ? read(ends[0], m.data(), sizeof m) : 0;
  close(ends[0]);
  int status = 1;
  if (child < 0 || waitpid(child, &status, 0) != child || status != 0 || got != sizeof m) {
    std::fprintf(stderr, "large_scenes: %s, %s with %.0f unknowns could not be measured\n", scene.c_str(),
                 method, size);
    std::exit(1);
  }
  return m;
}

double klu(const Measurement& m) { return m[refactor] + m[solve]; }

void print(const std::string& what, const std::vector<Measurement>& sizes) {
  double least = HUGE_VAL, least_klu = HUGE_VAL;
  for (const Measurement& m : sizes) {
    least = std::min(least, m[step]);
    least_klu = std::min(least_klu, klu(m));
  }
  std::printf("\n%s\n%9s%7s%7s%6s%6s%6s%10s%7s%10s%10s%11s%7s%7s%7s%9s\n", what.c_str(), "unknowns", "step",
              "/least", "it", "res", "Jac", "refactor", "solve", "residual", "Jacobian", "KLU/least", "/bare",
              "/same", "kB", "build s");
  for (const Measurement& m : sizes) {
    const double bare = m[iterations] * (klu(m) + m[residual] + m[jacobian]);
    const double same =
        m[jacobians] * (m[refactor] + m[jacobian]) + m[iterations] * m[solve] + m[residuals] * m[residual];
    std::printf("%9.0f%7.1f%7.2f%6.2f%6.2f%6.2f%10.1f%7.1f%10.1f%10.1f%11.2f%7.2f%7.2f%7.3f%9.2f\n",
                m[unknowns], m[step], m[step] / least, m[iterations], m[residuals], m[jacobians], m[refactor],
                m[solve], m[residual], m[jacobian], klu(m) / least_klu, m[step] / bare, m[step] / same,
                m[memory], m[build]);
  }
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 3) return std::fputs("large_scenes [LARGEST [SCENE]]\n", stderr), 2;
  const double largest = argc > 1 ? std::strtod(argv[1], nullptr) : 1e6;
  const char* const method = "type1/midpoint";
  std::vector<std::string> scenes{"hanging_chain", "toda_200"};
  if (argc > 2) scenes = {argv[2]};
  for (const std::string& scene : scenes) {
    std::vector<Measurement> sizes;
    for (double size = 1000.0; size <= largest; size *= 10.0)
      sizes.push_back(measure_apart(scene, method, size));
    print(scene + ", " + method, sizes);
  }
}
