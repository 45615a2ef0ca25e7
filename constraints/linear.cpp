#include <diracstep/constraints/linear.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {

namespace {

SparsityPattern pattern_of(const Columns& a) {
  std::vector<std::pair<int, int>> entries;
  for (int j = 0; j < a.cols(); ++j)
    for (int r = 0; r < a.rows(); ++r)
      if (a(r, j) != 0.0) entries.emplace_back(r, j);
  return {static_cast<int>(a.rows()), static_cast<int>(a.cols()), entries};
}

class LinearRows final : public ConstraintRows {
 public:
  LinearRows(const Columns& a, std::vector<std::string> names, std::vector<Waveform> b)
      : ConstraintRows(false, pattern_of(a), {static_cast<int>(a.cols()), static_cast<int>(a.cols()), {}},
                       std::move(names)),
        a_(pattern().nonzeros()),
        b_(std::move(b)) {
    Eigen::Index k = 0;
    for (const auto& [row, column] : pattern().entries()) a_[k++] = a(row, column);
  }

  bool workless() const override { return b_.empty(); }

  void coefficients(double t, ConstVectorRef, VectorRef a, VectorRef b) const override {
    a = a_;
    b.setZero();
    for (std::size_t r = 0; r < b_.size(); ++r) b[static_cast<Eigen::Index>(r)] = b_[r].value(t);
  }
  void derivative(double, ConstVectorRef, ConstVectorRef, double, VectorRef d) const override { d.setZero(); }
  void time_derivative(double t, ConstVectorRef, ConstVectorRef, VectorRef d) const override {
    d.setZero();
    for (std::size_t r = 0; r < b_.size(); ++r) d[static_cast<Eigen::Index>(r)] = b_[r].rate(t);
  }
  void annihilator_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const override {
    d.setZero();
  }

 private:
  Vector a_;
  std::vector<Waveform> b_;
};

}  // namespace

std::shared_ptr<const ConstraintRows> linear_rows(const Columns& a, std::vector<std::string> names,
                                                  std::vector<Waveform> b) {
  if (!b.empty()) require_size("the offsets of linear rows", static_cast<long>(b.size()), a.rows());
  return std::make_shared<const LinearRows>(
      a, detail::row_names(std::move(names), static_cast<int>(a.rows())), std::move(b));
}

}  // namespace diracstep
