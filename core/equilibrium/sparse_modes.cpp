#include <algorithm>
#include <cmath>
#include <diracstep/core/equilibrium/sparse_equilibrium.hpp>
#include <diracstep/core/equilibrium/sparse_modes.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>

namespace diracstep {

namespace {

constexpr double zero_of_shift = 1e-6;
constexpr double real_part_of_round_off = 1e-12;
constexpr double converged = 1e-8;            // residual of an eigenpair
constexpr double root_of_round_off = 1.2e-7;  // of s² beside the fastest one, by a stiffness of zero

/// The fastest rate that the sizes of the matrices allow.
double fastest_rate(const ForceBalance& balance) {
  const double m = largest_entry(balance.mass), c = largest_entry(balance.damping),
               k = largest_entry(balance.stiffness);
  if (m > 0.0 && k > 0.0) return std::sqrt(k / m);
  if (c > 0.0 && k > 0.0) return k / c;
  if (m > 0.0 && c > 0.0) return c / m;
  const double rows = largest_entry(balance.one_forms);
  return rows > 0.0 && largest_entry(balance.row_derivative) > 0.0
             ? largest_entry(balance.row_derivative) / rows
             : 1.0;
}

/// The first `positions` rows of one, the others of the other.
SparseMatrix rows_of(const SparseMatrix& first, const SparseMatrix& second, int positions) {
  const auto keep = [&](const SparseMatrix& matrix, bool above) {
    SparseMatrix kept = matrix;
    kept.prune([=](const auto& row, const auto&, double) { return (row < positions) == above; });
    return kept;
  };
  return keep(first, true) + keep(second, false);
}

/// x = (δq, δv/σ) to (F − σE)⁻¹E x.
class ShiftInverse {
 public:
  ShiftInverse(const ForceBalance& balance, double shift, double scale)
      : mass_(balance.mass),
        moved_(balance.damping + shift * balance.mass),
        of_velocity_(rows_of(SparseMatrix(balance.one_forms.rows(), balance.one_forms.cols()),
                             balance.one_forms, balance.on_positions)),
        factors_(
            balance.stiffness + shift * moved_, balance.one_forms,
            rows_of(balance.one_forms, balance.row_derivative, balance.on_positions) + shift * of_velocity_),
        shift_(shift),
        scale_(scale) {}

  bool singular() const { return factors_.singular(); }
  /// Where the factors are singular: the position of the motion at this eigenvalue.
  std::string direction(const Scene& scene, const ForceBalance& balance) const {
    return free_direction(
        scene, balance.stiffness + shift_ * moved_, balance.one_forms,
        rows_of(balance.one_forms, balance.row_derivative, balance.on_positions) + shift_ * of_velocity_);
  }

  void apply(ConstVectorRef in, VectorRef out) const {
    const Eigen::Index n = mass_.rows(), m = of_velocity_.rows();
    Vector right(n + m);
    right << -(mass_ * (scale_ * in.tail(n)) + moved_ * in.head(n)), -(of_velocity_ * in.head(n));
    out.head(n) = factors_.solve(right).head(n);
    out.tail(n) = (shift_ * out.head(n) + in.head(n)) / scale_;
  }

 private:
  SparseMatrix mass_, moved_, of_velocity_;
  SaddleFactors factors_;
  double shift_, scale_;
};

/// Without what belongs to infinite eigenvalues, whose chains the map ends.
Vector start_of(const ShiftInverse& map, Eigen::Index n) {
  constexpr int longest_chain = 5;
  Vector start(2 * n), next(2 * n);
  for (Eigen::Index i = 0; i < 2 * n; ++i) start[i] = std::sin(1.0 + 0.7 * static_cast<double>(i * i % 1009));
  for (int k = 0; k < longest_chain; ++k) {
    map.apply(start, next);
    start = next / next.norm();
  }
  return start;
}

double residual_of(const ShiftInverse& map, std::complex<double> theta, const Eigen::VectorXcd& x) {
  Vector real(x.size()), imaginary(x.size());
  map.apply(x.real(), real);
  map.apply(x.imag(), imaginary);
  const Eigen::VectorXcd image = real + std::complex<double>(0.0, 1.0) * imaginary;
  return (image - theta * x).norm() / (std::abs(theta) * x.norm());
}

/// Of the matrices with the same forces of rows; `reach` is a size of coordinates that round-off may be of.
double variation_of(const Scene& scene, const ForceBalance& here, const Equilibrium& at, const Vector& lambda,
                    double later, double reach) {
  double largest = 0.0;
  for (const double part : {0.382, 0.618}) {
    const double t = part * (later - at.time);
    ForceBalance there(scene);
    there.evaluate(at.time + t, at.q + t * at.v, at.v);
    there.set_multipliers(lambda);
    for (const auto matrix :
         {&ForceBalance::mass, &ForceBalance::damping, &ForceBalance::stiffness, &ForceBalance::one_forms})
      largest = std::max(largest, relative_change(here.*matrix, there.*matrix));
    Vector left = there.forces;
    if (lambda.size() > 0) left -= there.one_forms.transpose() * lambda;
    const double size = there.sizes.lpNorm<Eigen::Infinity>() + reach * largest_entry(here.stiffness);
    if (size > 0.0) largest = std::max(largest, left.lpNorm<Eigen::Infinity>() / size);
  }
  return largest;
}

Eigen::VectorXcd with_unit_largest(Eigen::VectorXcd shape) {
  Eigen::Index largest = 0;
  if (shape.cwiseAbs().maxCoeff(&largest) > 0.0) shape /= std::complex<double>(shape[largest]);
  return shape;
}

/// A double zero comes out as the root of round-off: nothing below `slowest` is told from it.
void add_mode(NearestModes& result, std::complex<double> s, double error, double slowest,
              const Eigen::VectorXcd& shape) {
  if (std::abs(s) <= std::max(slowest, zero_of_shift * std::abs(result.near))) {
    if (std::abs(s) <= slowest) result.found.zeros_below = slowest;
    ++result.found.zeros;
    return;
  }
  if (std::abs(s.imag()) <= error) s = {s.real(), 0.0};
  if (std::abs(s.real()) <= error) s = {0.0, s.imag()};
  if (s.imag() >= 0.0) result.found.modes.push_back({s, with_unit_largest(shape), error});
}

}  // namespace

NearestModes nearest_modes(const Scene& given, const Equilibrium& at, int count, std::optional<double> near,
                           double later, const LargestEigenpairs& eigenpairs) {
  if (given.space)
    throw Misuse(
        "scene '" + given.name + "' on " + given.space->name() +
        ": modes by sparse matrices are known in R^n only; without --modes and --near all are found");
  const auto scene = with_independent_rows_there(with_start(given, {at.time, at.q, at.v}));
  const Eigen::Index n = scene->dimension(), wanted = 2 * Eigen::Index{count};
  if (count < 1 || wanted + 2 > 2 * (n - scene->rows()))
    throw Misuse("scene '" + given.name + "' has " + std::to_string(n) + " coordinates and " +
                 std::to_string(scene->rows()) + " rows: too few for " + std::to_string(count) +
                 " modes by sparse matrices; full ones give all");
  ForceBalance balance(*scene);
  balance.evaluate(at.time, at.q, at.v);
  const Vector lambda = balance.in_order_here(forces_of_kept(*scene, at.time, at.q, at.lambda));
  balance.set_multipliers(lambda);
  NearestModes result;
  result.near = near.value_or(1e-3 * fastest_rate(balance));
  const double reach = std::max(given.start.q.lpNorm<Eigen::Infinity>(), at.q.lpNorm<Eigen::Infinity>());
  result.variation = variation_of(*scene, balance, at, lambda, later, reach);
  const ShiftInverse map(balance, result.near,
                         result.near != 0.0 ? std::abs(result.near) : fastest_rate(balance));
  if (map.singular()) {
    const std::string along = map.direction(*scene, balance);
    throw Misuse("scene '" + given.name + "': the matrix is singular: there is an eigenvalue at " +
                 to_text(result.near) + (along.empty() ? "" : ", of the direction " + along) +
                 "; choose another number to be near to, --near S");
  }
  const Eigenpairs pairs =
      eigenpairs([&](ConstVectorRef in, VectorRef out) { map.apply(in, out); }, start_of(map, n), wanted);
  result.failure = pairs.failure;
  const bool vibrates = largest_entry(balance.mass) > 0.0 && largest_entry(balance.damping) == 0.0;
  const double slowest = vibrates ? root_of_round_off * fastest_rate(balance) : 0.0;
  const double largest = pairs.values.size() > 0 ? pairs.values.cwiseAbs().maxCoeff() : 0.0;
  for (Eigen::Index k = 0; k < pairs.values.size(); ++k) {
    const std::complex<double> theta = pairs.values[k];
    if (!(residual_of(map, theta, pairs.vectors.col(k)) <= converged)) {
      result.failure = "an eigenpair is not met";
      continue;
    }
    const double error = real_part_of_round_off * largest / std::norm(theta);
    add_mode(result, result.near + 1.0 / theta, error, slowest, pairs.vectors.col(k).head(n));
  }
  finish(result.found);
  return result;
}

}  // namespace diracstep
