/// Full matrices against KLU, from which matrix_form() was chosen.  First, factor and solve on bands, arrows,
/// dense blocks and random matrices, by the part of a full matrix that their factors fill; then steps of
/// scenes, with what matrix_form() says.
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/steps/matrix_form.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <map>
#include <random>

#include "timing.hpp"

using namespace diracstep;

namespace {

/// Part of a full matrix that L + U fill.
double filled_part(const SparsityPattern& pattern) {
  const int n = pattern.rows();
  Eigen::SparseMatrix<double> matrix(n, n);
  for (const auto& [row, column] : pattern.entries())
    matrix.coeffRef(row, column) = row == column ? 4.0 * n : -1.0;
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factors(matrix);
  return (2.0 * double(factors.matrixL().nestedExpression().nonZeros()) - n) / (double(n) * n);
}

/// Symmetric patterns of one kind with more or fewer entries.
SparsityPattern pattern_of(const std::string& kind, int n, double density, std::mt19937& random) {
  std::uniform_real_distribution<> uniform(0.0, 1.0);
  std::vector<std::pair<int, int>> entries;
  const auto wanted = [&](int i, int j) {
    if (kind == "band") return i - j <= density * n / 2.0;
    if (kind == "arrow") return i >= n * (1.0 - density / 2.0);
    if (kind == "block") return i < n * density || i - j == 1;
    return uniform(random) < density;
  };
  for (int i = 0; i < n; ++i) {
    entries.emplace_back(i, i);
    for (int j = 0; j < i; ++j)
      if (wanted(i, j)) entries.insert(entries.end(), {{i, j}, {j, i}});
  }
  return {n, n, entries};
}

void compare_matrices(const std::string& kind, int n, double density) {
  std::mt19937 random(1);
  const SparsityPattern sparse = pattern_of(kind, n, density, random), full = SparsityPattern::dense(n, n);
  if (sparse.is_dense()) return;
  std::uniform_real_distribution<> uniform(-1.0, 1.0);
  Vector values(sparse.nonzeros());
  Columns matrix = Columns::Zero(n, n);
  Eigen::Index k = 0;
  for (const auto& [row, column] : sparse.entries())
    matrix(row, column) = values[k++] = uniform(random) + (row == column ? 4.0 : 0.0);
  const auto klu = detail::make_linear_solver(sparse), dense = detail::make_linear_solver(full);
  Vector x(n);
  const int count = std::clamp(40000000 / (n * n * n + 20000), 3, 1000);
  const auto work = [&](detail::LinearSolver& solver, const double* of) {
    return [&solver, &x, of, count] {
      for (int i = 0; i < count; ++i) {
        x.setOnes();
        (void)solver.factor(of);
        solver.solve(x.data());
      }
    };
  };
  const auto ns = fewest_nanoseconds({work(*dense, matrix.data()), work(*klu, values.data())}, count, 5);
  std::printf("%-14s%6d%10.2f%10.0f%10.0f%8.2f\n", kind.c_str(), n, filled_part(sparse), ns[0], ns[1],
              ns[0] / ns[1]);
}

void compare_steps(const char* scene, const char* method, const std::map<std::string, double>& sizes,
                   double step) {
  const CatalogueScene entry = make_scene(scene, sizes);
  constexpr int steps = 100, rounds = 6;
  const auto with_limit = [&](int limit) {
    return std::make_unique<Integrator>(
        entry.scene, Registry::with_built_ins(), kinsol(),
        IntegratorOptions{.method = method, .step = step, .dense_limit = limit});
  };
  const auto full = with_limit(1 << 30), sparse = with_limit(0);
  const auto run = [](Integrator& integrator) {
    return [&integrator] {
      integrator.reset();
      for (int k = 0; k < steps; ++k) (void)integrator.step();
    };
  };
  const auto ns = fewest_nanoseconds({run(*full), run(*sparse)}, steps, rounds);
  const MatrixForm form = matrix_form(full->scene(), as_measured);
  std::printf("%-20s%-16s%5d%9.0f%9.0f%7.2f  %-7s%s\n", scene, method,
              full->scene().dimension() + full->scene().rows(), ns[0], ns[1], ns[0] / ns[1],
              form.full ? "full" : "sparse", form.reason.c_str());
}

}  // namespace

int main() {
  std::printf("%-14s%6s%10s%10s%10s%8s\n", "matrix", "n", "filled", "full, ns", "KLU, ns", "ratio");
  for (const char* kind : {"band", "arrow", "block", "random"})
    for (const int n : {8, 12, 24, 48, 96, 192})
      for (const double density : {0.1, 0.4, 0.7}) compare_matrices(kind, n, density);
  std::printf("\n%-20s%-16s%5s%9s%9s%7s  %s\n", "scene", "method", "n+m", "full, ns", "KLU, ns", "ratio",
              "chosen");
  for (const char* method : {"type1/midpoint", "type1/gl:3"}) {
    for (const int links : {2, 4, 6, 8, 12, 20})
      compare_steps("hanging_chain", method, {{"N", links}}, 0.1 / links);
    for (const int sites : {4, 8, 12, 16, 24, 40, 60})
      compare_steps("toda_200", method, {{"N", sites}}, 0.05);
    for (const auto& [scene, sizes] :
         {std::pair<const char*, std::map<std::string, double>>{"outer_solar_system", {}},
          {"andrews_squeezer", {}},
          {"n_four_bar", {{"N", 3}}},
          {"n_four_bar", {{"N", 8}}}})
      compare_steps(scene, method, sizes, make_scene(scene, sizes).natural_step);
  }
}
