#include <diracstep/core/methods/adjoint.hpp>
#include <vector>

namespace diracstep {

namespace {

class Adjoint final : public GeneratingFunction {
 public:
  explicit Adjoint(std::unique_ptr<GeneratingFunction> s)
      : GeneratingFunction(adjoint_type(s->type()), s->pattern(), s->inner_columns()),
        s_(std::move(s)),
        mirror_(pattern().transposed_positions()),
        y_(dimension(), columns()),
        gradient_(dimension(), columns()),
        blocks_(pattern().nonzeros(), pairs()) {}

  double value(Interval step, ConstColumnsRef y) override { return -s_->value(reversed(step), exchanged(y)); }

  void gradient(Interval step, ConstColumnsRef y, ColumnsRef g) override {
    s_->gradient(reversed(step), exchanged(y), gradient_);
    for (int j = 0; j < columns(); ++j) g.col(j) = -gradient_.col(other(j));
  }

  void hessian(Interval step, ConstColumnsRef y, ColumnsRef blocks) override {
    s_->hessian(reversed(step), exchanged(y), blocks_);
    for (int i = 0; i < columns(); ++i)
      for (int j = i; j < columns(); ++j) {
        if (other(i) <= other(j)) {
          blocks.col(pair(i, j)) = -blocks_.col(pair(other(i), other(j)));
          continue;
        }
        for (Eigen::Index k = 0; k < blocks.rows(); ++k)
          blocks(k, pair(i, j)) = -blocks_(mirror_[static_cast<std::size_t>(k)], pair(other(j), other(i)));
      }
  }

  bool take_increments() override { return increments_ = s_->take_increments(); }

  void guess_inner(Interval step, ConstVectorRef q0, ConstVectorRef p0, ConstVectorRef v0,
                   ColumnsRef inner) override {
    // The inner columns were made for a step that starts at q1.
    s_->guess_inner(reversed(step), q0 + step.size * v0, p0, v0, inner);
  }

 private:
  static Interval reversed(Interval step) { return {step.end(), -step.size}; }
  static int other(int column) { return column < 2 ? 1 - column : column; }
  const Columns& exchanged(ConstColumnsRef y) {
    for (int j = 0; j < columns(); ++j) y_.col(j) = y.col(other(j));
    if (increments_) {
      y_.col(0) = y.col(0) + y.col(1);
      y_.col(1) = -y.col(1);
    }
    return y_;
  }

  std::unique_ptr<GeneratingFunction> s_;
  bool increments_ = false;
  std::vector<int> mirror_;
  Columns y_, gradient_, blocks_;
};

}  // namespace

GeneratingType adjoint_type(GeneratingType type) {
  if (type == GeneratingType::two) return GeneratingType::three;
  if (type == GeneratingType::three) return GeneratingType::two;
  return type;
}

std::unique_ptr<GeneratingFunction> adjoint(std::unique_ptr<GeneratingFunction> generating_function) {
  return std::make_unique<Adjoint>(std::move(generating_function));
}

}  // namespace diracstep
