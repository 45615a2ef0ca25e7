/// Orderings, pivoting and scaling of KLU on the saddle-point matrices of a step: what
/// solvers/detail/sparse_lu.cpp chose from.
///   saddle_orderings [UNKNOWNS]   default 30000
///
/// Nanoseconds for each unknown of the analysis, a factorisation that chooses pivots, one with given pivots,
/// and a solve; entries of L and U for each unknown; |b − A x| / (|A| |x|) of a solve; the least pivot beside
/// the largest.
#include <klu.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <vector>

#include "timing.hpp"

using namespace diracstep;

namespace {

struct Setting {
  const char* name;
  int ordering;  ///< 0 AMD, 1 COLAMD, 2 as the unknowns come
  int btf;
  double tolerance;  ///< a diagonal entry of so much of the largest is taken
  int scale;         ///< of rows, with given pivots: −1 none, 2 by the largest entry
};

constexpr Setting settings[] = {
    {"AMD, tol 0.1", 0, 0, 0.1, -1},          {"AMD, tol 0.1, rows scaled", 0, 0, 0.1, 2},
    {"AMD, tol 0.001", 0, 0, 0.001, -1},      {"AMD, tol 1", 0, 0, 1.0, -1},
    {"AMD, BTF, tol 0.1", 0, 1, 0.1, -1},     {"AMD, BTF, tol 0.001", 0, 1, 0.001, -1},
    {"COLAMD, tol 0.1", 1, 0, 0.1, -1},       {"COLAMD, BTF, tol 0.001", 1, 1, 0.001, -1},
    {"as they come, tol 0.1", 2, 0, 0.1, -1},
};

/// The Jacobian of a step, some steps into the motion.
struct Matrix {
  Matrix(const char* scene, const char* method, int sites, double h) {
    const CatalogueScene entry = make_scene(scene, {{"N", double(sites)}});
    Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = h});
    for (int k = 0; k < 5; ++k) (void)integrator.step();
    const auto step = Registry::with_built_ins().method(method).make_step(integrator.scene(), {});
    step->begin({integrator.time(), h},
                {integrator.position(), integrator.momentum(), integrator.velocity_estimate()}, {});
    Vector x(step->size()), f(step->size());
    step->guess(integrator.velocity_estimate(), x);
    values.setZero(step->pattern().nonzeros());
    step->residual(x, f);
    step->jacobian(x, values);
    starts.assign(step->pattern().column_starts().begin(), step->pattern().column_starts().end());
    rows.assign(step->pattern().row_indices().begin(), step->pattern().row_indices().end());
  }
  int size() const { return static_cast<int>(starts.size()) - 1; }

  /// |b − A x| / (|A| |x|), largest entries.
  double residual(const Vector& x, const Vector& b) const {
    Vector r = b;
    for (int j = 0; j < size(); ++j)
      for (int e = starts[static_cast<std::size_t>(j)]; e < starts[static_cast<std::size_t>(j) + 1]; ++e)
        r[rows[static_cast<std::size_t>(e)]] -= values[e] * x[j];
    return r.lpNorm<Eigen::Infinity>() / (values.lpNorm<Eigen::Infinity>() * x.lpNorm<Eigen::Infinity>());
  }

  std::vector<int> starts, rows;
  Vector values;
};

/// Above this size the factors of the last ordering take minutes.
constexpr int max_as_they_come = 3000;

void measure(Matrix& a, const Setting& setting) {
  if (setting.ordering == 2 && a.size() > max_as_they_come) return;
  klu_common common;
  klu_defaults(&common);
  common.ordering = setting.ordering;
  common.btf = setting.btf;
  common.tol = setting.tolerance;
  const int n = a.size();
  int *const starts = a.starts.data(), *const rows = a.rows.data();
  klu_symbolic* symbolic = nullptr;
  klu_numeric* numeric = nullptr;
  Vector x;
  const Vector b = Vector::LinSpaced(n, -1.0, 1.0);
  const auto analyse = [&] {
    klu_free_symbolic(&symbolic, &common);
    symbolic = setting.ordering == 2 ? klu_analyze_given(n, starts, rows, nullptr, nullptr, &common)
                                     : klu_analyze(n, starts, rows, &common);
  };
  const auto factor = [&] {
    common.scale = 2;
    klu_free_numeric(&numeric, &common);
    numeric = klu_factor(starts, rows, a.values.data(), symbolic, &common);
  };
  const auto refactor = [&] {
    common.scale = setting.scale;
    klu_refactor(starts, rows, a.values.data(), symbolic, numeric, &common);
  };
  const auto solve = [&] {
    x = b;
    klu_solve(symbolic, numeric, n, 1, x.data(), &common);
  };
  const auto ns = fewest_nanoseconds({analyse, factor, refactor, solve}, n, 5);
  klu_rcond(symbolic, numeric, &common);
  std::printf("  %-26s%9.1f%9.1f%10.1f%8.1f%8.2f%10.1e%10.1e\n", setting.name, ns[0], ns[1], ns[2], ns[3],
              double(numeric->lnz + numeric->unz) / n, a.residual(x, b), common.rcond);
  klu_free_numeric(&numeric, &common);
  klu_free_symbolic(&symbolic, &common);
}

void compare(const char* scene, const char* method, int sites, double h) {
  Matrix matrix(scene, method, sites, h);
  std::printf("\n%s, %s, %d unknowns\n  %-26s%9s%9s%10s%8s%8s%10s%10s\n", scene, method, matrix.size(), "KLU",
              "analyse", "factor", "refactor", "solve", "L + U", "residual", "pivots");
  for (const Setting& setting : settings) measure(matrix, setting);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int unknowns = argc > 1 ? std::atoi(argv[1]) : 30000;
  for (const int size : {1000, unknowns}) {
    const double h = 0.75 / size;
    compare("hanging_chain", "type1/midpoint", size / 3, h);
    compare("hanging_chain", "type1/gl:3", size / 9, h);
    compare("toda_200", "type1/midpoint", size, 0.05);
  }
}
