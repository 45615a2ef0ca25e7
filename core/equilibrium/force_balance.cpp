#include <Eigen/QR>
#include <cmath>
#include <diracstep/core/equilibrium/force_balance.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/sparse_columns.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>
#include <diracstep/core/system/row_subset.hpp>

namespace diracstep {

namespace {

constexpr int most_full = 2000;  // coordinates, and rows
constexpr double dependent_row = 1e-10;

/// Which rows of a nonholonomic block have constant coefficients though others of it have not, as states
/// without a rate beside states with one: by comparing them and their derivatives at generic points.
std::vector<bool> constant_rows(const ConstraintRows& block, const Start& start) {
  constexpr int points = 3;
  const SparsityPattern& pattern = block.pattern();
  std::vector<bool> constant(static_cast<std::size_t>(block.rows()), true);
  Vector first, first_offset, a(pattern.nonzeros()), b(block.rows()), d(pattern.nonzeros());
  for (int point = 0; point < points; ++point) {
    Vector q = start.q, w = start.q;
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      const double number = static_cast<double>(i + 1) + 100.0 * point;
      q[i] += std::cos(1.7 * number);
      w[i] = 1.0 + 0.5 * std::sin(2.3 * number);
    }
    block.derivative(start.time, q, w, 1.0, d);
    block.coefficients(start.time, q, a, b);
    if (point == 0) {
      first = a;
      first_offset = b;
    }
    Vector later = a, ignored = b;
    block.coefficients(start.time + 0.37 * (point + 1), q, later, ignored);
    pattern.for_each([&](Eigen::Index k, int row, int) {
      if (!(d[k] == 0.0 && a[k] == first[k] && later[k] == first[k]))
        constant[static_cast<std::size_t>(row)] = false;
    });
    for (int row = 0; row < block.rows(); ++row)
      if (!(b[row] == first_offset[row])) constant[static_cast<std::size_t>(row)] = false;
  }
  return constant;
}

}  // namespace

/// The rows of a scene in blocks, those on positions first, and for each row of the scene its place there.
struct SortedRows {
  explicit SortedRows(const Scene& scene) {
    std::vector<std::vector<Eigen::Index>> numbers, of_others;
    ConstraintBlocks others;
    Eigen::Index first = 0;
    const auto add = [&](const auto& block, const std::vector<int>& rows, bool on_positions) {
      if (rows.empty()) return;
      const bool whole = static_cast<int>(rows.size()) == block->rows();
      const auto part =
          whole && on_positions == is_on_positions(*block) ? block : rows_of_block(block, rows, on_positions);
      (on_positions ? blocks : others).push_back(part);
      auto& of_part = (on_positions ? numbers : of_others).emplace_back();
      for (const int row : rows) of_part.push_back(first + row);
    };
    for (const auto& block : scene.constraints) {
      const bool integrable = block->holonomic() || !scene.space;  // constant one-forms on groups are not
      std::vector<bool> held(static_cast<std::size_t>(block->rows()), integrable);
      if (integrable && !is_on_positions(*block)) held = constant_rows(*block, scene.start);
      for (const bool on_positions : {true, false}) {
        std::vector<int> rows;
        for (int r = 0; r < block->rows(); ++r)
          if (held[static_cast<std::size_t>(r)] == on_positions) rows.push_back(r);
        add(block, rows, on_positions);
      }
      first += block->rows();
    }
    blocks.insert(blocks.end(), others.begin(), others.end());
    numbers.insert(numbers.end(), of_others.begin(), of_others.end());
    places.resize(static_cast<std::size_t>(first));
    Eigen::Index place = 0;
    for (const auto& of_block : numbers)
      for (const Eigen::Index row : of_block) places[static_cast<std::size_t>(row)] = place++;
  }

  ConstraintBlocks blocks;
  std::vector<Eigen::Index> places;
};

namespace {

/// Products of the numbers of a rotation that cancel leave round-off where a matrix has zeros, which decide
/// what is free.
void drop_round_off(SparseMatrix& matrix) {
  constexpr double part = 1e-14;
  matrix.prune(largest_entry(matrix), part);
}

int rows_on_positions(const ConstraintBlocks& blocks) {
  int count = 0;
  for (const auto& block : blocks) count += is_on_positions(*block) ? block->rows() : 0;
  return count;
}

Columns with_unit_rows(const Columns& matrix) {
  Columns scaled = matrix;
  for (Eigen::Index r = 0; r < scaled.rows(); ++r)
    if (const double size = scaled.row(r).norm(); size > 0.0) scaled.row(r) /= size;
  return scaled;
}

}  // namespace

ForceBalance::ForceBalance(const Scene& scene) : ForceBalance(scene, SortedRows(scene)) {}

ForceBalance::ForceBalance(const Scene& scene, const SortedRows& rows)
    : on_positions(rows_on_positions(rows.blocks)),
      scene_(scene),
      blocks_(rows.blocks),
      places_(rows.places),
      rows_(blocks_, scene.dimension()) {}

void ForceBalance::evaluate(double t, const Vector& q, const Vector& v) {
  t_ = t;
  q_ = q;
  v_ = v;
  const Lagrangian& lagrangian = *scene_.lagrangian;
  const SparsityPattern& pattern = lagrangian.pattern();
  const Eigen::Index n = v.size();
  LagrangianDerivatives l(lagrangian);
  l.take_second(lagrangian, t, q, v);
  const SparseMatrix lqv = sparse_map(pattern, l.qv.data());
  Vector lq(n), lv(n), rate(n), f = Vector::Zero(n);
  lagrangian.gradient(t, q, v, lq, lv);
  lagrangian.gradient_rate(t, q, v, rate);
  const Vector convective = lqv.transpose() * v;
  mass = sparse_map(pattern, l.vv.data());
  damping = SparseMatrix(lqv.transpose()) - lqv;
  free_stiffness_ = -sparse_map(pattern, l.qq.data());
  if (scene_.force) {
    const SparsityPattern& of_force = scene_.force->pattern();
    Vector by_q(of_force.nonzeros()), by_v = by_q;
    scene_.force->value(t, q, v, f);
    scene_.force->derivatives(t, q, v, by_q, by_v);
    damping -= sparse_map(of_force, by_v.data());
    free_stiffness_ -= sparse_map(of_force, by_q.data());
  }
  if (scene_.space) {
    const Space& space = *scene_.space;
    Vector momentum(space.group_dimension());
    Columns turned(momentum.size(), momentum.size());
    space.embed(lv, momentum);
    space.coadjoint(momentum, turned);
    damping -= Columns(turned(space.tangent(), space.tangent())).sparseView();
    for (SparseMatrix* matrix : {&mass, &damping, &free_stiffness_}) drop_round_off(*matrix);
  }
  forces = convective + rate - lq - f;
  free_sizes_ = convective.cwiseAbs() + rate.cwiseAbs() + lq.cwiseAbs() + f.cwiseAbs();
  evaluate_rows();
}

void ForceBalance::evaluate_rows() {
  const int m = rows_.rows();
  position.resize(on_positions);
  velocity.setZero(m);
  one_forms = row_derivative = SparseMatrix(m, v_.size());
  if (m == 0) return;
  rows_.evaluate(t_, q_);
  one_forms = sparse_map(rows_.pattern(), rows_.coefficients().data());
  velocity = rows_.offsets();
  // At rest the time stands still, and rows on positions that it moves ask for no velocity.
  const double passing = v_.lpNorm<Eigen::Infinity>() > 0.0 ? 1.0 : 0.0;
  velocity.head(on_positions) *= passing;
  velocity += one_forms * v_;
  Vector derivative(rows_.pattern().nonzeros()), of_positions = derivative;
  rows_.distribution().derivative(t_, q_, v_, 1.0, derivative);
  rows_.distribution().derivative(t_, q_, v_, passing, of_positions);
  rows_.pattern().for_each([&](Eigen::Index k, int row, int) {
    if (row < on_positions) derivative[k] = of_positions[k];
  });
  row_derivative = sparse_map(rows_.pattern(), derivative.data());
  if (scene_.space)
    for (SparseMatrix* matrix : {&one_forms, &row_derivative}) drop_round_off(*matrix);
  Vector kept;
  if (!scene_.space) kept = one_forms * (q_ - scene_.start.q) + (t_ - scene_.start.time) * rows_.offsets();
  int row = 0;
  for (const auto& block : blocks_) {
    if (!is_on_positions(*block)) break;
    if (block->holonomic())
      block->position(t_, q_, position.segment(row, block->rows()));
    else
      position.segment(row, block->rows()) = kept.segment(row, block->rows());
    row += block->rows();
  }
}

void ForceBalance::set_multipliers(const Vector& lambda) {
  stiffness = free_stiffness_;
  int row = 0;
  for (const auto& block : blocks_) {
    Vector curvature(block->curvature_pattern().nonzeros());
    block->annihilator_derivative(t_, q_, lambda.segment(row, block->rows()), curvature);
    stiffness -= sparse_map(block->curvature_pattern(), curvature.data());
    row += block->rows();
  }
  if (scene_.space) drop_round_off(stiffness);
  sizes = free_sizes_ + stiffness.cwiseAbs() * position_sizes(q_);
  if (row > 0) sizes += one_forms.cwiseAbs().transpose() * lambda.cwiseAbs();
}

Vector ForceBalance::position_sizes(const Vector& q) const {
  if (!scene_.space) return q.cwiseAbs();
  return Vector::Constant(scene_.dimension(), q.lpNorm<Eigen::Infinity>());
}

Vector ForceBalance::in_order_of_scene(const Vector& here) const { return here(places_); }

Vector ForceBalance::in_order_here(const Vector& of_scene) const {
  Vector here(of_scene.size());
  here(places_) = of_scene;
  return here;
}

bool needs_sparse_matrices(const Scene& scene) {
  return scene.dimension() > most_full || scene.rows() > most_full;
}

std::shared_ptr<const Scene> with_start(const Scene& scene, const Start& start) {
  auto copy = std::make_shared<Scene>(scene);
  copy->start = start;
  return with_lagrangian(*copy);
}

std::shared_ptr<const Scene> with_start_and_hidden_rows(const Scene& scene, const Start& start) {
  if (needs_sparse_matrices(scene))
    throw Misuse("scene '" + scene.name + "' has " + std::to_string(scene.dimension()) + " coordinates and " +
                 std::to_string(scene.rows()) + " rows; the full matrices that this takes have " +
                 std::to_string(most_full) + " at most");
  return with_hidden_rows(with_start(scene, start));
}

double largest_entry(const SparseMatrix& matrix) {
  return matrix.nonZeros() > 0 ? matrix.coeffs().cwiseAbs().maxCoeff() : 0.0;
}

double relative_change(const SparseMatrix& from, const SparseMatrix& to) {
  if (from.size() == 0) return 0.0;
  const double size = from.norm();
  return size > 0.0 ? (to - from).norm() / size : to.norm();
}

namespace {

Eigen::CompleteOrthogonalDecomposition<Columns> factors_of_forces(const Columns& one_forms) {
  Eigen::CompleteOrthogonalDecomposition<Columns> decomposition;
  decomposition.setThreshold(dependent_row);
  decomposition.compute(one_forms.transpose());
  return decomposition;
}

}  // namespace

Vector least_multipliers(const Columns& one_forms, const Vector& forces) {
  if (one_forms.rows() == 0) return {};
  return factors_of_forces(one_forms).solve(forces);
}

Columns least_inverse(const Columns& one_forms) {
  return Columns(factors_of_forces(one_forms).pseudoInverse()).transpose();
}

Columns null_space(const Columns& matrix) {
  const Eigen::Index n = matrix.cols();
  if (matrix.rows() == 0 || n == 0) return Columns::Identity(n, n);
  Eigen::ColPivHouseholderQR<Columns> qr;
  qr.setThreshold(dependent_row);
  qr.compute(with_unit_rows(matrix).transpose());
  const Columns all = qr.householderQ() * Columns::Identity(n, n);
  return all.rightCols(n - qr.rank());
}

}  // namespace diracstep
