#include <algorithm>
#include <cmath>
#include <diracstep/core/equilibrium/sparse_equilibrium.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <functional>
#include <numeric>
#include <optional>

namespace diracstep {

namespace {

constexpr double singular_matrix = 1e14;        // 1 over the size of what it makes of a vector
constexpr double sparse_equation_met = 1e-10;   // of the terms of an equation
constexpr double least_change = 1e-13;          // of the largest coordinate
constexpr double round_off_may_decide = 1e-10;  // of the largest coordinate
constexpr int most_iterations = 200;
constexpr double shortest_part = 1e-6;

SparseMatrix saddle_matrix(const SparseMatrix& block, const SparseMatrix& one_forms,
                           const SparseMatrix& rows) {
  const auto n = block.rows(), m = rows.rows();
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&](const SparseMatrix& matrix, Eigen::Index row, Eigen::Index column, bool transposed) {
    const double sign = transposed ? -1.0 : 1.0;
    for (Eigen::Index outer = 0; outer < matrix.outerSize(); ++outer)
      for (SparseMatrix::InnerIterator at(matrix, outer); at; ++at)
        entries.emplace_back(static_cast<int>(row + (transposed ? at.col() : at.row())),
                             static_cast<int>(column + (transposed ? at.row() : at.col())),
                             sign * at.value());
  };
  add(block, 0, 0, false);
  add(one_forms, 0, n, true);
  add(rows, n, 0, false);
  SparseMatrix matrix(n + m, n + m);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

/// Numbers between −1 and 1 without a pattern of their own.
Vector without_pattern(Eigen::Index size) {
  Vector numbers(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const double turned = 0.6180339887498949 * static_cast<double>(i + 1);
    numbers[i] = 2.0 * (turned - std::floor(turned)) - 1.0;
  }
  return numbers;
}

/// Scales the rows, or the columns, so that the largest entry of each is 1; returns by what.
Vector balance(SparseMatrix& matrix, bool of_rows) {
  Vector largest = Vector::Zero(matrix.rows());
  for (Eigen::Index outer = 0; outer < matrix.outerSize(); ++outer)
    for (SparseMatrix::InnerIterator at(matrix, outer); at; ++at) {
      double& size = largest[of_rows ? at.row() : at.col()];
      size = std::max(size, std::abs(at.value()));
    }
  Vector scales = largest.unaryExpr([](double size) { return size > 0.0 ? 1.0 / size : 1.0; });
  matrix = of_rows ? SparseMatrix(scales.asDiagonal() * matrix) : SparseMatrix(matrix * scales.asDiagonal());
  return scales;
}

class SparseSearch {
 public:
  explicit SparseSearch(const Scene& scene)
      : scene_(scene), balance_(scene), rest_(Vector::Zero(scene.dimension())) {
    if (balance_.on_positions < scene.rows())
      throw Misuse("scene '" + scene.name +
                   "': with rows on velocities whose coefficients are not constant, equilibria are looked "
                   "for with full matrices, of 2000 "
                   "coordinates at most");
    q_ = scene.start.q;
    size_ = q_.lpNorm<Eigen::Infinity>();
  }

  Equilibrium find(const std::function<bool()>& go_on) {
    set_first_multipliers();
    for (; iterations_ < most_iterations; ++iterations_) {
      const Vector residual = residual_at(q_, lambda_);
      if (go_on && !go_on()) return ended("interrupted", residual);
      if (!residual.allFinite()) return ended("the forces are not finite", residual);
      const SaddleFactors factors(balance_.stiffness, balance_.one_forms, balance_.one_forms);
      if (factors.singular()) return ended(nothing_draws_back(), residual);
      const Vector change = -factors.solve(residual);
      const double moved = change.head(q_.size()).lpNorm<Eigen::Infinity>();
      if (moved <= least_change * size_) return ended({}, residual);
      const std::optional<double> part = allowed_part(factors, change);
      if (!part) return ended(moved <= round_off_may_decide * size_ ? "" : "Newton's method ends", residual);
      q_ += *part * change.head(q_.size());
      lambda_ += *part * change.tail(lambda_.size());
      size_ = std::max(size_, q_.lpNorm<Eigen::Infinity>());
    }
    return ended("none is reached in " + std::to_string(most_iterations) + " steps",
                 residual_at(q_, lambda_));
  }

 private:
  std::string nothing_draws_back() const {
    const std::string along =
        free_direction(scene_, balance_.stiffness, balance_.one_forms, balance_.one_forms);
    return "nothing draws " + (along.empty() ? "a coordinate" : "the direction " + along) +
           " back, so that the matrix is singular: there equilibria are a family, or none; a weak spring "
           "along it "
           "chooses one";
  }

  /// The least ones that take up the forces.
  void set_first_multipliers() {
    balance_.evaluate(scene_.start.time, q_, rest_);
    lambda_ = Vector::Zero(balance_.on_positions);
    if (lambda_.size() == 0) return;
    SparseMatrix identity(q_.size(), q_.size());
    identity.setIdentity();
    Vector right = Vector::Zero(q_.size() + lambda_.size());
    right.head(q_.size()) = balance_.forces;
    const SaddleFactors factors(identity, balance_.one_forms, balance_.one_forms);
    if (!factors.singular()) lambda_ = -factors.solve(right).tail(lambda_.size());
  }

  Vector residual_at(const Vector& q, const Vector& lambda) {
    balance_.evaluate(scene_.start.time, q, rest_);
    balance_.set_multipliers(lambda);
    Vector residual(q.size() + lambda.size());
    residual << balance_.forces - balance_.one_forms.transpose() * lambda, balance_.position;
    return residual;
  }

  /// The largest of 1, ½, ¼, … of the change after which the same matrix asks for less of q.
  std::optional<double> allowed_part(const SaddleFactors& factors, const Vector& change) {
    const Eigen::Index n = q_.size();
    const double asked = change.head(n).norm();
    for (double part = 1.0; part >= shortest_part; part /= 2.0) {
      const Vector there =
          residual_at(q_ + part * change.head(n), lambda_ + part * change.tail(lambda_.size()));
      if (there.allFinite() && factors.solve(there).head(n).norm() <= (1.0 - 0.5 * part) * asked) return part;
    }
    return std::nullopt;
  }

  Equilibrium ended(const std::string& why, const Vector& residual) {
    residual_at(q_, lambda_);
    Equilibrium found{scene_.start.time, q_, rest_, balance_.in_order_of_scene(lambda_), iterations_, why};
    const Eigen::Index n = q_.size();
    Vector sizes(residual.size());
    const Vector reach = q_.cwiseAbs() + Vector::Constant(n, size_);
    sizes << balance_.sizes + balance_.stiffness.cwiseAbs() * reach, balance_.one_forms.cwiseAbs() * reach;
    Eigen::Index worst = 0;
    const double excess = (residual.cwiseAbs() - sparse_equation_met * sizes).maxCoeff(&worst);
    if (why.empty() && excess <= 0.0) return found;
    found.failure +=
        (why.empty() ? "" : "; ") + (worst < n ? "a force of " + to_text(-residual[worst]) + " is left on '" +
                                                     scene_.coordinates[static_cast<std::size_t>(worst)] + "'"
                                               : "a row's residual is " + to_text(residual[worst]));
    return found;
  }

  const Scene& scene_;
  ForceBalance balance_;
  Vector rest_, q_, lambda_;
  double size_ = 0.0;
  int iterations_ = 0;
};

}  // namespace

SaddleFactors::SaddleFactors(const SparseMatrix& block, const SparseMatrix& one_forms,
                             const SparseMatrix& rows) {
  SparseMatrix matrix = saddle_matrix(block, one_forms, rows);
  row_scales_ = Vector::Ones(matrix.rows());
  column_scales_ = row_scales_;
  for (int round = 0; round < 2; ++round) {  // rows and columns come in units of their own
    row_scales_.array() *= balance(matrix, true).array();
    column_scales_.array() *= balance(matrix, false).array();
  }
  factors_.compute(matrix);
  if (factors_.info() != Eigen::Success) {
    singular_ = true;
    return;
  }
  const Vector probe = without_pattern(matrix.rows());
  const Vector answer = factors_.solve(probe);
  singular_ = !(answer.lpNorm<Eigen::Infinity>() <= singular_matrix);
}

std::string free_direction(const Scene& scene, const SparseMatrix& block, const SparseMatrix& one_forms,
                           const SparseMatrix& rows) {
  constexpr double beside = 1e-6, shown_from = 0.01;  // of the block; of the largest entry
  constexpr std::size_t most_shown = 6;
  const Eigen::Index n = block.rows();
  SparseMatrix shift(n, n);
  shift.setIdentity();
  shift *= beside * size_or_one(largest_entry(block));
  const SaddleFactors factors(block + shift, one_forms, rows);
  if (factors.singular()) return {};
  Vector x = without_pattern(n + rows.rows());
  for (int k = 0; k < 4; ++k) {
    x.tail(rows.rows()).setZero();
    x = factors.solve(x);
    Eigen::Index largest = 0;
    if (!(x.head(n).cwiseAbs().maxCoeff(&largest) > 0.0)) return {};
    x /= x[largest];
  }
  std::vector<Eigen::Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, std::greater<>(), [&](Eigen::Index i) { return std::abs(x[i]); });
  std::string text;
  for (std::size_t k = 0; k < order.size() && std::abs(x[order[k]]) >= shown_from; ++k) {
    if (k == most_shown) return text + ", …";
    text += (k == 0 ? "" : ", ") + scene.coordinates[static_cast<std::size_t>(order[k])] + ' ' +
            to_text(x[order[k]], 3);
  }
  return text;
}

Vector SaddleFactors::solve(const Vector& right) const {
  return column_scales_.cwiseProduct(factors_.solve(row_scales_.cwiseProduct(right)));
}

std::shared_ptr<const Scene> with_independent_rows_there(const std::shared_ptr<const Scene>& scene) {
  const std::vector<std::string> dependent = redundant_rows(*scene, scene->start);
  return dependent.empty() ? scene : with_rows_left_out(scene, dependent);
}

Equilibrium find_sparse_equilibrium(const Scene& scene, const std::function<bool()>& go_on) {
  const auto independent =
      with_independent_rows_there(std::shared_ptr<const Scene>(std::shared_ptr<void>(), &scene));
  Equilibrium found = SparseSearch(*independent).find(go_on);
  if (!independent->whole) return found;
  const std::string broken = LeftOutRows(*independent).broken_at(found.time, found.q);
  if (!broken.empty())
    found.failure +=
        (found.failure.empty() ? "" : "; ") + ("a row that was left out as redundant: " + broken);
  found.lambda = forces_of_whole(*independent, found.time, found.q, found.lambda);
  return found;
}

}  // namespace diracstep
