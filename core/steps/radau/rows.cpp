#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/radau/rows.hpp>
#include <utility>

namespace diracstep {

namespace {

/// Of terms that cancel inside of b: the residual that they leave is accepted, but no step of Newton's method
/// is left out for it.
constexpr double part_that_counts = 1e-3;

}  // namespace

RadauRows::Block::Block(std::shared_ptr<const ConstraintRows> of, int s, int first_row,
                        int first_of_positions)
    : rows(std::move(of)), first(first_row), first_position(first_of_positions) {
  for (Columns* at_nodes : {&a, &derivative}) at_nodes->setZero(rows->pattern().nonzeros(), s);
  curvature.setZero(rows->curvature_pattern().nonzeros(), s);
  for (Columns* at_nodes : {&b, &positions, &multipliers}) at_nodes->setZero(rows->rows(), s);
}

RadauRows::RadauRows(const Scene& scene, const RadauTableau& table)
    : s_(static_cast<int>(table.c.size())),
      n_(scene.dimension()),
      m_(scene.rows()),
      table_(table.a),
      start_(scene.constraints, n_),
      projection_(only_holonomic(scene.constraints), n_) {
  start_rates_.setZero(start_.pattern().nonzeros());
  int row = 0, position = 0;
  for (const auto& rows : scene.constraints) {
    blocks_.emplace_back(rows, s_, row, position);
    row += rows->rows();
    if (rows->holonomic()) position += rows->rows();
  }
}

void RadauRows::plan(BlockPattern& layout, const StageMomentum& momentum, const Force* force) {
  const SparsityPattern& along = projection_.pattern();
  for (Block& block : blocks_) plan(block, layout);
  if (holonomic_rows() == 0) return;
  stiffness_along_ = PatternProduct(momentum.pattern(), false, along, true);
  mixed_along_ = PatternProduct(momentum.pattern(), true, along, true);
  if (force != nullptr) force_along_ = PatternProduct(force->pattern(), false, along, true);
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      const int number = layout.add(stiffness_along_.pattern(), n_ * i, projection_column(k));
      if (lagrangian_layout_ < 0) lagrangian_layout_ = number;
      layout.add(mixed_along_.pattern(), n_ * i, projection_column(k));
    }
  for (int i = 0; force != nullptr && i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      const int number = layout.add(force_along_.pattern(), n_ * i, projection_column(k));
      if (force_layout_ < 0) force_layout_ = number;
    }
  const int most = std::max({stiffness_along_.pattern().nonzeros(), mixed_along_.pattern().nonzeros(),
                             force != nullptr ? force_along_.pattern().nonzeros() : 0});
  product_.setZero(std::max<Eigen::Index>(product_.size(), most));
}

/// Three blocks for each pair of stages, one more where the rows are holonomic; then those of the projection:
/// one for each pair, two for each stage.
void RadauRows::plan(Block& block, BlockPattern& layout) {
  const ConstraintRows& rows = *block.rows;
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      const int number = layout.add(rows.pattern(), n_ * i, velocity_row(block, k), true);
      if (block.layout < 0) block.layout = number;
      layout.add(rows.curvature_pattern(), n_ * i, n_ * k);
      layout.add(rows.pattern(), velocity_row(block, i), n_ * k);
      if (rows.holonomic()) layout.add(rows.pattern(), position_row(block, i), n_ * k);
    }
  if (holonomic_rows() == 0) return;
  const SparsityPattern& along = projection_.pattern();
  block.curvature_along = PatternProduct(rows.curvature_pattern(), false, along, true);
  block.derivative_along = PatternProduct(rows.pattern(), false, along, true);
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) layout.add(block.curvature_along.pattern(), n_ * i, projection_column(k));
  for (int i = 0; i < s_; ++i) {
    layout.add(block.derivative_along.pattern(), velocity_row(block, i), projection_column(i));
    if (rows.holonomic())
      layout.add(block.derivative_along.pattern(), position_row(block, i), projection_column(i));
  }
  const int most =
      std::max(block.curvature_along.pattern().nonzeros(), block.derivative_along.pattern().nonzeros());
  product_.setZero(std::max<Eigen::Index>(product_.size(), most));
}

void RadauRows::begin(double t, ConstVectorRef q0) {
  if (m_ > 0) {
    start_.evaluate(t, q0);
    start_.distribution().derivative(t, q0, Vector::Zero(n_), 1.0, start_rates_);
  }
  if (holonomic_rows() > 0) projection_.evaluate(t, q0);
}

void RadauRows::project(const double* x, NodePoints& at) const {
  if (holonomic_rows() == 0) return;
  for (int i = 0; i < s_; ++i)
    projection_.pattern().transposed_multiply_add(projection_.coefficients().data(), x + projection_column(i),
                                                  at.gauss.col(i).data(), at.step.size);
}

void RadauRows::evaluate(const NodePoints& at, const double* x, Columns& impulses) {
  impulses.setZero();
  for (Block& block : blocks_) {
    block.rows->coefficients_at(at.at_gauss(), block.a.data(), block.b.data());
    if (block.rows->holonomic()) block.rows->positions(at.at_gauss(), block.positions.data());
    for (int i = 0; i < s_; ++i)
      block.rows->pattern().transposed_multiply_add(block.a.col(i).data(), x + velocity_row(block, i),
                                                    impulses.col(i).data());
  }
}

void RadauRows::residual(const NodePoints& at, const double* x, double* f) const {
  const double per_step = 1.0 / at.step.size;
  for (const Block& block : blocks_)
    for (int i = 0; i < s_; ++i) {
      double* const rate = f + velocity_row(block, i);
      std::copy_n(block.b.col(i).data(), block.b.rows(), rate);
      block.rows->pattern().multiply_add(block.a.col(i).data(), x + n_ * i, rate);
      for (Eigen::Index r = 0; block.rows->holonomic() && r < block.positions.rows(); ++r)
        f[position_row(block, i) + r] = per_step * block.positions(r, i);
    }
}

void RadauRows::second_derivatives(const NodePoints& at, const double* x, Block& block) {
  for (int i = 0; i < s_; ++i)
    std::copy_n(x + velocity_row(block, i), block.multipliers.rows(), block.multipliers.col(i).data());
  block.rows->derivatives(at.at_gauss(x), block.derivative.data());
  block.rows->annihilator_derivatives(at.at_gauss(), block.multipliers.data(), block.curvature.data());
}

void RadauRows::add_to_jacobian(const NodePoints& at, const double* x, const StageMomentum& momentum,
                                const BlockPattern& layout, VectorRef& values) {
  const double h = at.step.size;
  for (Block& block : blocks_) {
    second_derivatives(at, x, block);
    add_rows(at, block, layout, values);
    if (holonomic_rows() > 0) add_projection(h, block, layout, values);
  }
  if (holonomic_rows() == 0) return;
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      const int number = lagrangian_layout_ + 2 * (i * s_ + k);
      add_product(stiffness_along_, momentum.curvatures().col(k).data(), -h * h * table_(i, k), layout,
                  number, values);
      if (i == k) add_product(mixed_along_, momentum.mixed().col(i).data(), h, layout, number + 1, values);
      if (force_layout_ >= 0)
        add_product(force_along_, momentum.force_gradients().col(k).data(), -h * h * table_(i, k), layout,
                    force_layout_ + i * s_ + k, values);
    }
}

void RadauRows::add_rows(const NodePoints& at, Block& block, const BlockPattern& layout, VectorRef& values) {
  const double h = at.step.size;
  const bool holonomic = block.rows->holonomic();
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k) {
      const int number = block.layout + (holonomic ? 4 : 3) * (i * s_ + k);
      layout.add_to(values.data(), number, -table_(i, k), block.a.col(k).data());
      sum_.setZero(block.curvature.rows());
      for (int j = 0; j < s_; ++j) sum_ -= h * table_(i, j) * table_(j, k) * block.curvature.col(j);
      layout.add_to(values.data(), number + 1, 1.0, sum_.data());
      layout.add_to(values.data(), number + 2, h * table_(i, k), block.derivative.col(i).data());
      if (i == k) layout.add_to(values.data(), number + 2, 1.0, block.a.col(i).data());
      if (holonomic) layout.add_to(values.data(), number + 3, table_(i, k), block.a.col(i).data());
    }
}

void RadauRows::add_projection(double h, Block& block, const BlockPattern& layout, VectorRef& values) {
  const bool holonomic = block.rows->holonomic();
  int number = block.layout + (holonomic ? 4 : 3) * s_ * s_;
  for (int i = 0; i < s_; ++i)
    for (int k = 0; k < s_; ++k)
      add_product(block.curvature_along, block.curvature.col(k).data(), -h * table_(i, k), layout, number++,
                  values);
  for (int i = 0; i < s_; ++i) {
    add_product(block.derivative_along, block.derivative.col(i).data(), h, layout, number++, values);
    if (holonomic) add_product(block.derivative_along, block.a.col(i).data(), 1.0, layout, number++, values);
  }
}

void RadauRows::add_product(const PatternProduct& product, const double* left, double factor,
                            const BlockPattern& layout, int number, VectorRef& values) {
  product.multiply(left, projection_.coefficients().data(), product_.data());
  layout.add_to(values.data(), number, factor, product_.data());
}

double RadauRows::form_size_at_start() const {
  return largest_entry(start_.coefficients().data(), start_.coefficients().size());
}

double RadauRows::form_size() const {
  double largest = 0.0;
  for (const Block& block : blocks_)
    largest = std::max(largest, largest_entry(block.a.data(), block.a.size()));
  return largest;
}

double RadauRows::impulse_size(const double* multipliers) const {
  double largest = 0.0;
  for (const Block& block : blocks_)
    for (int i = 0; i < s_; ++i)
      largest = std::max(largest, largest_product(block.a.col(i).data(), block.rows->pattern().row_indices(),
                                                  multipliers + m_ * i + block.first));
  return largest;
}

double RadauRows::curvature_size() const {
  double largest = 0.0;
  for (const Block& block : blocks_)
    largest = std::max(largest, largest_entry(block.curvature.data(), block.curvature.size()));
  return largest;
}

double RadauRows::rate_size(const Columns& q) const {
  double largest = 0.0;
  start_.pattern().for_each([&](Eigen::Index e, int, int c) {
    largest = std::max(largest, part_that_counts * std::abs(start_rates_[e] * q(c, s_ - 1)));
  });
  return largest;
}

void RadauRows::add_impulse_sizes(const double* x, const Vector& q, Vector& sizes) const {
  for (const Block& block : blocks_)
    for (int i = 0; i < s_; ++i) {
      block.rows->pattern().for_each([&](Eigen::Index e, int r, int c) {
        sizes[c] += std::abs(block.a(e, i) * x[velocity_row(block, i) + r]);
      });
      block.rows->curvature_pattern().for_each(
          [&](Eigen::Index e, int r, int c) { sizes[r] += std::abs(block.curvature(e, i) * q[c]); });
    }
}

void RadauRows::size_velocity_terms(const Vector& v, Vector& sizes) const {
  sizes.setZero(m_);
  for (const Block& block : blocks_) {
    block.rows->pattern().for_each(
        [&](Eigen::Index e, int r, int c) { sizes[block.first + r] += std::abs(block.a(e, s_ - 1)) * v[c]; });
    for (Eigen::Index r = 0; r < block.b.rows(); ++r)
      sizes[block.first + r] += block.b.row(r).cwiseAbs().maxCoeff();
  }
}

void RadauRows::size_position_terms(const Vector& q, Vector& sizes) const {
  sizes.setZero(holonomic_rows());
  projection_.pattern().for_each(
      [&](Eigen::Index e, int r, int c) { sizes[r] += std::abs(projection_.coefficients()[e]) * q[c]; });
}

}  // namespace diracstep
