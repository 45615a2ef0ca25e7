#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/validation/laws/scene_examination.hpp>
#include <numbers>

namespace diracstep {

namespace {

constexpr long dense_limit = 1500;             // rows or unknowns of a full matrix that is taken apart
constexpr double derivative_tolerance = 1e-5;  // of a derivative against differences, relative
constexpr double rank_tolerance = 1e-10;       // of a pivot, relative to the largest
constexpr double ill_conditioned = 1e13;

/// Numbers in (-1, 1) without a pattern that a formula could share; the same in every run.
Vector direction(Eigen::Index n, double shift) {
  Vector d(n);
  for (Eigen::Index i = 0; i < n; ++i)
    d[i] = std::sin(shift + std::numbers::phi * static_cast<double>((i + 1) % 9973) * 3.7);
  return d;
}

/// The largest difference of two columns in relation to the size of the terms.
struct Deviation {
  double largest = 0.0;
  void add(const Vector& exact, const Vector& differences, double noise) {
    const double size =
        std::max(exact.size() == 0 ? 0.0 : exact.lpNorm<Eigen::Infinity>(), noise / derivative_tolerance);
    if (exact.size() == 0) return;
    const double off = (exact - differences).lpNorm<Eigen::Infinity>();
    largest = std::max(largest, std::isfinite(off) ? off / std::max(size, 1e-300) : HUGE_VAL);
  }
};

/// (g(+δ) − g(−δ))/2δ with Richardson's step towards order 4, and the round-off in it.
template <class G>
Vector difference(const G& g, double delta, double& noise) {
  const Vector wide = (g(delta) - g(-delta)) / (2.0 * delta),
               narrow = (g(delta / 2.0) - g(-delta / 2.0)) / delta;
  const Vector here = g(0.0);
  noise = here.size() == 0 ? 0.0 : 100.0 * 2.2e-16 * here.lpNorm<Eigen::Infinity>() / delta;
  return (4.0 * narrow - wide) / 3.0;
}

/// A point and a direction through it.
struct Line {
  double t;
  Vector x, y, dx, dy;
  double delta;

  Vector at(const Vector& base, const Vector& d, double s) const { return base + s * d; }
};

Vector one(double value) { return Vector::Constant(1, value); }

Vector product(const SparsityPattern& pattern, const Vector& values, const Vector& x,
               bool transposed = false) {
  Vector y = Vector::Zero(transposed ? pattern.columns() : pattern.rows());
  if (transposed)
    pattern.transposed_multiply_add(values.data(), x.data(), y.data());
  else
    pattern.multiply_add(values.data(), x.data(), y.data());
  return y;
}

void examine_phase(const PhaseFunction& f, const Line& line, Deviation& gradient, Deviation& hessian) {
  const Eigen::Index n = line.x.size();
  double noise = 0.0;
  const auto value = [&](double s) {
    return one(f.value(line.t, line.x + s * line.dx, line.y + s * line.dy));
  };
  const auto slopes = [&](double s, double shift) {
    Vector both(2 * n), fx(n), fy(n);
    f.gradient(line.t + shift, line.x + s * line.dx, line.y + s * line.dy, fx, fy);
    both << fx, fy;
    return both;
  };
  const Vector here = slopes(0.0, 0.0);
  Vector differences = difference(value, line.delta, noise);
  gradient.add(one(here.head(n).dot(line.dx) + here.tail(n).dot(line.dy)), differences, noise);

  Vector fxx(f.pattern().nonzeros()), fxy = fxx, fyy = fxx, change(2 * n), rate(n);
  f.hessian(line.t, line.x, line.y, fxx, fxy, fyy);
  change.head(n) = product(f.pattern(), fxx, line.dx) + product(f.pattern(), fxy, line.dy);
  change.tail(n) = product(f.pattern(), fxy, line.dx, true) + product(f.pattern(), fyy, line.dy);
  differences = difference([&](double s) { return slopes(s, 0.0); }, line.delta, noise);
  hessian.add(change, differences, noise);

  f.gradient_rate(line.t, line.x, line.y, rate);
  differences = difference([&](double s) { return Vector(slopes(0.0, s).tail(n)); }, line.delta, noise);
  hessian.add(rate, differences, noise);
}

void examine_rows(const ConstraintRows& rows, const Line& line, Deviation& first, Deviation& second) {
  const int m = rows.rows();
  const Vector w = line.y, lambda = direction(m, 0.4);
  double noise = 0.0;
  const double scale = 0.7;  // s in ∂(A w + s b)/∂q
  const auto coefficients = [&](double t, const Vector& q) {
    std::pair<Vector, Vector> ab{Vector(rows.pattern().nonzeros()), Vector(m)};
    rows.coefficients(t, q, ab.first, ab.second);
    return ab;
  };
  const auto contracted = [&](double t, const Vector& q, double s) {
    const auto [a, b] = coefficients(t, q);
    return Vector(product(rows.pattern(), a, w) + s * b);
  };
  const auto [a, b] = coefficients(line.t, line.x);
  if (rows.holonomic()) {
    const auto phi = [&](double t, double s) {
      Vector values(m);
      rows.position(t, line.x + s * line.dx, values);
      return values;
    };
    Vector differences = difference([&](double s) { return phi(line.t, s); }, line.delta, noise);
    first.add(product(rows.pattern(), a, line.dx), differences, noise);
    differences = difference([&](double s) { return phi(line.t + s, 0.0); }, line.delta, noise);
    first.add(b, differences, noise);
  }
  Vector d(rows.pattern().nonzeros()), rate(m), curvature(rows.curvature_pattern().nonzeros());
  rows.derivative(line.t, line.x, w, scale, d);
  Vector differences = difference([&](double s) { return contracted(line.t, line.x + s * line.dx, scale); },
                                  line.delta, noise);
  second.add(product(rows.pattern(), d, line.dx), differences, noise);
  rows.time_derivative(line.t, line.x, w, rate);
  differences = difference([&](double s) { return contracted(line.t + s, line.x, 1.0); }, line.delta, noise);
  second.add(rate, differences, noise);
  rows.annihilator_derivative(line.t, line.x, lambda, curvature);
  differences = difference(
      [&](double s) {
        return product(rows.pattern(), coefficients(line.t, line.x + s * line.dx).first, lambda, true);
      },
      line.delta, noise);
  second.add(product(rows.curvature_pattern(), curvature, line.dx), differences, noise);
}

void examine_force(const Force& force, const Line& line, Deviation& deviation) {
  double noise = 0.0;
  const auto value = [&](double s) {
    Vector f(line.x.size());
    force.value(line.t, line.x + s * line.dx, line.y + s * line.dy, f);
    return f;
  };
  Vector fq(force.pattern().nonzeros()), fv = fq;
  force.derivatives(line.t, line.x, line.y, fq, fv);
  const Vector differences = difference(value, line.delta, noise);
  deviation.add(product(force.pattern(), fq, line.dx) + product(force.pattern(), fv, line.dy), differences,
                noise);
}

Finding finding(const std::string& what, const Deviation& deviation) {
  return {what, deviation.largest <= derivative_tolerance,
          fmt::format("differs from differences by {:.1e}, allowed {:.0e}", deviation.largest,
                      derivative_tolerance)};
}

/// The start of a scene with its Lagrangian, and a point near it with a moderate velocity.
std::vector<Line> lines(const Scene& scene, const Vector& second) {
  const Eigen::Index n = scene.start.q.size();
  const double q_size = std::max(scene.start.q.lpNorm<Eigen::Infinity>(), 1e-2);
  const double v_size = std::max(second.lpNorm<Eigen::Infinity>(), 1e-2);
  const Vector a = direction(n, 0.1), b = direction(n, 1.3);
  std::vector<Line> all;
  for (const double off : {0.0, 1e-2})
    all.push_back({scene.start.time, scene.start.q + off * q_size * b, second + (off + 0.1) * v_size * a,
                   q_size * a, v_size * b, 1e-4});
  return all;
}

}  // namespace

std::vector<Finding> examine_derivatives(const Scene& scene) {
  const Vector second = scene.start.v.size() > 0 ? scene.start.v : scene.start.p;
  Deviation l1, l2, h1, h2, a1, a2, f;
  for (const Line& line : lines(scene, second)) {
    if (scene.lagrangian) examine_phase(*scene.lagrangian, line, l1, l2);
    if (scene.hamiltonian) examine_phase(*scene.hamiltonian, line, h1, h2);
    for (const auto& rows : scene.constraints) examine_rows(*rows, line, a1, a2);
    if (scene.force) examine_force(*scene.force, line, f);
  }
  std::vector<Finding> findings;
  if (scene.lagrangian) {
    findings.push_back(finding("first derivatives of L", l1));
    findings.push_back(finding("second derivatives of L", l2));
  }
  if (scene.hamiltonian) {
    findings.push_back(finding("first derivatives of H", h1));
    findings.push_back(finding("second derivatives of H", h2));
  }
  if (!scene.constraints.empty()) {
    findings.push_back(finding("first derivatives of the rows", a1));
    findings.push_back(finding("second derivatives of the rows", a2));
  }
  if (scene.force) findings.push_back(finding("derivatives of the force", f));
  return findings;
}

namespace {

Eigen::MatrixXd full(const SparsityPattern& pattern, const Vector& values) {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(pattern.rows(), pattern.columns());
  const auto entries = pattern.entries();
  for (std::size_t k = 0; k < entries.size(); ++k)
    matrix(entries[k].first, entries[k].second) = values[static_cast<Eigen::Index>(k)];
  return matrix;
}

Finding examine_dimensions(const Scene& scene) {
  try {
    require_well_formed(scene);
  } catch (const Misuse& misuse) {
    return {"dimensions", false, misuse.what()};
  }
  const int n = scene.dimension(), m = scene.rows();
  return {"dimensions", m < n,
          fmt::format("{} coordinates, {} rows{}", n, m, m < n ? "" : ": nothing is left to move")};
}

Finding examine_start(const Scene& scene) {
  try {
    require_consistent(scene, scene.start);
    return {"consistency of the start", true, "the start lies on all rows"};
  } catch (const Misuse& misuse) {
    return {"consistency of the start", false, misuse.what()};
  }
}

Finding examine_rank(const Scene& scene) {
  const int m = scene.rows();
  Finding finding{"rank of the rows", true, "no rows"};
  if (m == 0) return finding;
  if (scene.dimension() > dense_limit)
    return {finding.what, true, "not examined: too large for a full matrix"};
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(scene.start.time, scene.start.q);
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(full(rows.pattern(), rows.coefficients()).transpose());
  qr.setThreshold(rank_tolerance);
  const auto rank = static_cast<int>(qr.rank());
  finding.passed = rank == m;
  finding.detail = fmt::format("rank {} of {} at the start", rank, m);
  const auto names = scene.row_names();
  for (int k = rank; k < m; ++k)
    finding.detail += fmt::format("{}{}", k == rank ? "; follows from the others: " : ", ",
                                  names[static_cast<std::size_t>(qr.colsPermutation().indices()[k])]);
  return finding;
}

/// Solves with another solver and keeps the condition of the Jacobian it ended at.
class WatchedSolver final : public NonlinearSolver {
 public:
  WatchedSolver(NonlinearProblem& problem, std::unique_ptr<NonlinearSolver> solver, double& condition)
      : problem_(problem), solver_(std::move(solver)), condition_(condition) {}

  SolveReport solve(VectorRef x) override {
    SolveReport report = solver_->solve(x);
    if (problem_.size() == 0 || problem_.size() > dense_limit) return report;
    Vector values(problem_.pattern().nonzeros());
    problem_.jacobian(x, values);
    if (!values.allFinite()) return report;
    const Eigen::VectorXd s = full(problem_.pattern(), values).jacobiSvd().singularValues();
    condition_ = std::max(condition_, s[s.size() - 1] > 0.0 ? s[0] / s[s.size() - 1] : HUGE_VAL);
    return report;
  }
  std::string description() const override { return solver_->description(); }

 private:
  NonlinearProblem& problem_;
  std::unique_ptr<NonlinearSolver> solver_;
  double& condition_;
};

constexpr const char* reading_of_velocities = "velocities from momenta";

void examine_step(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers,
                  std::vector<Finding>& findings) {
  Finding step{"regularity of the step", false, ""};
  std::optional<Finding> reading;
  double condition = 0.0;
  const SolverFactory watched = [&](NonlinearProblem& problem) {
    return std::make_unique<WatchedSolver>(problem, solvers(problem), condition);
  };
  try {
    const Recommendation& advice = entry.recommended;
    Integrator integrator(entry.scene, registry, watched, {advice.method, advice.order, advice.step, {}});
    const StepReport report = integrator.step();
    step.passed = report.ok() && condition < ill_conditioned;
    step.detail = fmt::format("{} of order {}, step {:g}: condition of the Jacobian {:.1e}", advice.method,
                              integrator.options().order, advice.step, condition);
    if (!report.ok()) step.detail += "; " + report.failure;
    Sample sample;
    const SolveReport read = integrator.sample(Momentum::projected, sample);
    reading = {reading_of_velocities, read.ok(),
               read.ok() ? "∂²L/∂v² is regular along the rows" : describe(read.status)};
  } catch (const Misuse& misuse) {
    step.detail = misuse.what();
  }
  findings.push_back(std::move(step));
  if (reading) findings.push_back(std::move(*reading));
}

std::vector<std::string> advise(const CatalogueScene& entry, const Examination& examination) {
  const Scene& scene = *entry.scene;
  std::vector<std::string> advice;
  const Finding& last = examination.findings.back();
  if (scene.lagrangian && !last.passed) {
    if (last.what == reading_of_velocities)
      advice.emplace_back(
          "the Lagrangian is degenerate along the rows: momenta do not determine the velocities");
    return advice;
  }
  const PhaseStructure structure =
      scene.lagrangian ? scene.lagrangian->structure() : scene.hamiltonian->structure();
  if (structure.quadratic && scene.constraints.empty() && !scene.force)
    advice.emplace_back("linear: every step has the same Jacobian");
  else if (structure.separable && structure.y_hessian_constant && scene.constraints.empty() && !scene.force)
    advice.emplace_back("separable: type1/trapezoidal is explicit and cheap where nothing is stiff");
  advice.emplace_back("without --method GL(3), order 6; --order 8 to 12 for errors below 1e-6");
  if (scene.dimension() + scene.rows() > 40)
    advice.emplace_back("large: the step uses sparse matrices (KLU)");
  if (scene.force)
    advice.emplace_back(
        "forces that damp strongly lose accuracy in composed orders, whose inner steps go backwards; "
        "try order 2 with a small step beside them");
  return advice;
}

}  // namespace

bool Examination::passed() const { return std::ranges::all_of(findings, &Finding::passed); }

Examination examine(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers) {
  Examination examination;
  const auto scene = completed(entry.scene);
  examination.findings = {examine_dimensions(*scene), examine_start(*scene), examine_rank(*scene)};
  for (Finding& finding : examine_derivatives(*entry.scene))
    examination.findings.push_back(std::move(finding));
  examine_step(entry, registry, solvers, examination.findings);
  examination.advice = advise(entry, examination);
  return examination;
}

}  // namespace diracstep
