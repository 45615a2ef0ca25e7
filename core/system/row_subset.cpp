#include <diracstep/core/system/row_subset.hpp>
#include <set>

namespace diracstep {

namespace {

/// Some rows of a block, in order.
class RowSubset final : public ConstraintRows {
 public:
  RowSubset(std::shared_ptr<const ConstraintRows> block, std::vector<int> kept, bool constant)
      : ConstraintRows(block->holonomic(), subset(block->pattern(), kept), block->curvature_pattern(),
                       names_of(*block, kept)),
        block_(std::move(block)),
        kept_(std::move(kept)),
        constant_(constant) {
    const std::vector<int> numbers = numbers_of(block_->rows(), kept_);
    int k = 0;
    for (const auto& [row, column] : block_->pattern().entries()) {
      if (numbers[static_cast<std::size_t>(row)] >= 0) places_.push_back(k);
      ++k;
    }
  }

  bool constant() const override { return constant_; }
  bool workless() const override { return block_->workless(); }
  std::string origin(int row) const override { return block_->origin(kept_[static_cast<std::size_t>(row)]); }
  void position(double t, ConstVectorRef q, VectorRef phi) const override {
    Vector all(block_->rows());
    block_->position(t, q, all);
    take_rows(all, phi);
  }
  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    Vector all(block_->pattern().nonzeros()), offset(block_->rows());
    block_->coefficients(t, q, all, offset);
    take_values(all, a);
    take_rows(offset, b);
  }
  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    Vector all(block_->pattern().nonzeros());
    block_->derivative(t, q, w, s, all);
    take_values(all, d);
  }
  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    Vector all(block_->rows());
    block_->time_derivative(t, q, v, all);
    take_rows(all, d);
  }
  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    Vector all = Vector::Zero(block_->rows());
    for (std::size_t r = 0; r < kept_.size(); ++r) all[kept_[r]] = lambda[static_cast<Eigen::Index>(r)];
    block_->annihilator_derivative(t, q, all, d);
  }

 private:
  /// The number of each row among the kept ones; -1 for those left out.
  static std::vector<int> numbers_of(int rows, const std::vector<int>& kept) {
    std::vector<int> numbers(static_cast<std::size_t>(rows), -1);
    for (std::size_t r = 0; r < kept.size(); ++r)
      numbers[static_cast<std::size_t>(kept[r])] = static_cast<int>(r);
    return numbers;
  }
  static SparsityPattern subset(const SparsityPattern& pattern, const std::vector<int>& kept) {
    const std::vector<int> numbers = numbers_of(pattern.rows(), kept);
    std::vector<std::pair<int, int>> entries;
    for (const auto& [row, column] : pattern.entries())
      if (const int number = numbers[static_cast<std::size_t>(row)]; number >= 0)
        entries.emplace_back(number, column);
    return {static_cast<int>(kept.size()), pattern.columns(), entries};
  }
  static std::vector<std::string> names_of(const ConstraintRows& block, const std::vector<int>& kept) {
    std::vector<std::string> names;
    for (const int row : kept) names.push_back(block.names()[static_cast<std::size_t>(row)]);
    return names;
  }
  void take_rows(const Vector& all, VectorRef out) const {
    for (std::size_t r = 0; r < kept_.size(); ++r) out[static_cast<Eigen::Index>(r)] = all[kept_[r]];
  }
  void take_values(const Vector& all, VectorRef out) const {
    for (std::size_t k = 0; k < places_.size(); ++k) out[static_cast<Eigen::Index>(k)] = all[places_[k]];
  }

  std::shared_ptr<const ConstraintRows> block_;
  std::vector<int> kept_;    ///< ascending, so the entries keep their order
  std::vector<int> places_;  ///< values of the kept rows among all
  bool constant_;
};

}  // namespace

std::shared_ptr<const ConstraintRows> rows_of_block(const std::shared_ptr<const ConstraintRows>& block,
                                                    const std::vector<int>& kept, bool constant) {
  return std::make_shared<const RowSubset>(block, kept, constant);
}

std::shared_ptr<const Scene> without_rows(const Scene& scene, const std::vector<std::string>& names) {
  auto copy = std::make_shared<Scene>(scene);
  copy->constraints.clear();
  const std::set<std::string> left_out(names.begin(), names.end());
  for (const auto& block : scene.constraints) {
    std::vector<int> kept;
    for (int r = 0; r < block->rows(); ++r)
      if (!left_out.contains(block->names()[static_cast<std::size_t>(r)])) kept.push_back(r);
    if (static_cast<int>(kept.size()) == block->rows())
      copy->constraints.push_back(block);
    else if (!kept.empty())
      copy->constraints.push_back(rows_of_block(block, kept, block->constant()));
  }
  return copy;
}

}  // namespace diracstep
