#include <array>
#include <diracstep/core/methods/legendre.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <vector>

namespace diracstep {

namespace {

/// One product s · p·q that the transform adds; columns of the transform.
struct Pairing {
  int p, q;
  double sign;
};

/// Where q0 and q1 of L_d stand among the columns of the transform, the sign of L_d, and the pairings.
struct Shape {
  int q0, q1, added_columns;
  double sign;
  std::vector<Pairing> pairings;
};

Shape shape_of(GeneratingType type) {
  switch (type) {
    case GeneratingType::two:
      return {0, 2, 1, -1.0, {{1, 2, 1.0}}};
    case GeneratingType::three:
      return {2, 1, 1, -1.0, {{0, 2, -1.0}}};
    case GeneratingType::four:
      return {2, 3, 2, 1.0, {{0, 2, 1.0}, {1, 3, -1.0}}};
    case GeneratingType::one:
      break;
  }
  throw Misuse("the discrete Legendre transform leads to types 2, 3 and 4");
}

class LegendreTransform final : public GeneratingFunction {
 public:
  LegendreTransform(GeneratingType type, std::unique_ptr<GeneratingFunction> lagrangian)
      : GeneratingFunction(type, lagrangian->pattern().with_diagonal(),
                           lagrangian->inner_columns() + shape_of(type).added_columns),
        lagrangian_(std::move(lagrangian)),
        shape_(shape_of(type)) {
    if (lagrangian_->type() != GeneratingType::one)
      throw Misuse("the discrete Legendre transform starts from a generating function of type 1");
    columns_ = {shape_.q0, shape_.q1};
    for (int i = 0; i < lagrangian_->inner_columns(); ++i) columns_.push_back(2 + shape_.added_columns + i);
    inner_y_.resize(dimension(), lagrangian_->columns());
    inner_gradient_ = inner_y_;
    inner_blocks_.resize(lagrangian_->pattern().nonzeros(), lagrangian_->pairs());
    for (const auto& [row, column] : lagrangian_->pattern().entries()) {
      places_.push_back(pattern().position(row, column));
      mirrored_places_.push_back(pattern().position(column, row));
    }
    for (int i = 0; i < dimension(); ++i) diagonal_.push_back(pattern().position(i, i));
  }

  double value(Interval step, ConstColumnsRef y) override {
    take(y);
    double sum = shape_.sign * lagrangian_->value(step, inner_y_);
    for (const Pairing& pairing : shape_.pairings)
      sum += pairing.sign * y.col(pairing.p).dot(y.col(pairing.q));
    return sum;
  }

  void gradient(Interval step, ConstColumnsRef y, ColumnsRef g) override {
    take(y);
    lagrangian_->gradient(step, inner_y_, inner_gradient_);
    g.setZero();
    for (std::size_t c = 0; c < columns_.size(); ++c)
      g.col(columns_[c]) = shape_.sign * inner_gradient_.col(static_cast<Eigen::Index>(c));
    for (const Pairing& pairing : shape_.pairings) {
      g.col(pairing.p) += pairing.sign * y.col(pairing.q);
      g.col(pairing.q) += pairing.sign * y.col(pairing.p);
    }
  }

  void hessian(Interval step, ConstColumnsRef y, ColumnsRef blocks) override {
    take(y);
    lagrangian_->hessian(step, inner_y_, inner_blocks_);
    blocks.setZero();
    const int count = static_cast<int>(columns_.size());
    for (int i = 0; i < count; ++i)
      for (int j = i; j < count; ++j) copy_block(i, j, blocks);
    for (const Pairing& pairing : shape_.pairings)  // p before q in every shape
      for (const int k : diagonal_) blocks(k, pair(pairing.p, pairing.q)) += pairing.sign;
  }

  void guess_inner(Interval step, ConstVectorRef q0, ConstVectorRef p0, ConstVectorRef v0,
                   ColumnsRef inner) override {
    if (shape_.q0 >= 2) inner.col(shape_.q0 - 2) = q0;
    if (shape_.q1 >= 2) inner.col(shape_.q1 - 2) = q0 + step.size * v0;
    lagrangian_->guess_inner(step, q0, p0, v0, inner.rightCols(lagrangian_->inner_columns()));
  }

 private:
  void take(ConstColumnsRef y) {
    for (std::size_t c = 0; c < columns_.size(); ++c)
      inner_y_.col(static_cast<Eigen::Index>(c)) = y.col(columns_[c]);
  }

  /// Block (i,j) of L_d to its columns here; transposed where their order is the other way round.
  void copy_block(int i, int j, ColumnsRef blocks) const {
    const int row = columns_[static_cast<std::size_t>(i)], column = columns_[static_cast<std::size_t>(j)];
    const auto& places = row <= column ? places_ : mirrored_places_;
    const auto target = pair(std::min(row, column), std::max(row, column));
    const auto source = inner_blocks_.col(lagrangian_->pair(i, j));
    for (std::size_t k = 0; k < places.size(); ++k)
      blocks(places[k], target) = shape_.sign * source[static_cast<Eigen::Index>(k)];
  }

  std::unique_ptr<GeneratingFunction> lagrangian_;
  Shape shape_;
  std::vector<int> columns_;  ///< columns of L_d among the columns here
  std::vector<int> places_, mirrored_places_, diagonal_;
  Columns inner_y_, inner_gradient_, inner_blocks_;
};

}  // namespace

std::unique_ptr<GeneratingFunction> legendre(GeneratingType type,
                                             std::unique_ptr<GeneratingFunction> lagrangian) {
  return std::make_unique<LegendreTransform>(type, std::move(lagrangian));
}

}  // namespace diracstep
