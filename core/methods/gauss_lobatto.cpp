#include <diracstep/core/methods/gauss_lobatto.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <vector>

namespace diracstep {

namespace {

/// A product factor · y_i·y_j of two columns, i < j; `per_step` products carry a factor h.
struct ColumnProduct {
  int i, j;
  double factor;
  bool per_step;
};

class GaussLobattoFunction final : public GeneratingFunction {
 public:
  GaussLobattoFunction(GeneratingType type, int s, std::shared_ptr<const Lagrangian> lagrangian)
      : GeneratingFunction(type, lagrangian->pattern().with_diagonal(),
                           type == GeneratingType::one ? s + 1 : s),
        lagrangian_(std::move(lagrangian)),
        s_(s),
        table_(gauss_lobatto_tableau(s)),
        base_(type == GeneratingType::three ? 1 : 0),
        sign_(type == GeneratingType::one ? 1.0 : -1.0),
        from_base_(table_.a) {
    if (type == GeneratingType::three) from_base_.rowwise() -= table_.b.transpose();
    moving_ = {base_};
    for (int k = 0; k < s; ++k) moving_.push_back(2 + k);
    plan_pairings();
    const SparsityPattern& inside = lagrangian_->pattern();
    for (const auto& [row, column] : inside.entries()) {
      places_.push_back(pattern().position(row, column));
      mirrored_places_.push_back(pattern().position(column, row));
    }
    for (int i = 0; i < dimension(); ++i) diagonal_.push_back(pattern().position(i, i));
    for (Vector* column : {&q_, &v_, &lq_, &lv_}) column->setZero(dimension());
    for (Vector* values : {&lqq_, &lqv_, &lvv_}) values->setZero(inside.nonzeros());
  }

  double value(Interval step, ConstColumnsRef y) override {
    double sum = 0.0;
    for (int i = 0; i < s_; ++i) {
      const double t = move_to(i, step, y);
      sum += sign_ * step.size * table_.b[i] * lagrangian_->value(t, q_, v_);
    }
    for (const ColumnProduct& p : pairings_) sum += factor(p, step) * y.col(p.i).dot(y.col(p.j));
    return sum;
  }

  void gradient(Interval step, ConstColumnsRef y, ColumnsRef g) override {
    g.setZero();
    for (int i = 0; i < s_; ++i) {
      const double t = move_to(i, step, y), w = sign_ * step.size * table_.b[i];
      lagrangian_->gradient(t, q_, v_, lq_, lv_);
      g.col(base_) += w * lq_;
      for (int k = 0; k < s_; ++k) g.col(2 + k) += w * step.size * from_base_(i, k) * lq_;
      g.col(2 + i) += w * lv_;
    }
    for (const ColumnProduct& p : pairings_) {
      g.col(p.i) += factor(p, step) * y.col(p.j);
      g.col(p.j) += factor(p, step) * y.col(p.i);
    }
  }

  void hessian(Interval step, ConstColumnsRef y, ColumnsRef blocks) override {
    blocks.setZero();
    for (int i = 0; i < s_; ++i) {
      const double t = move_to(i, step, y), w = sign_ * step.size * table_.b[i];
      lagrangian_->hessian(t, q_, v_, lqq_, lqv_, lvv_);
      add_node(i, step.size, w, blocks);
    }
    for (const ColumnProduct& p : pairings_)
      for (const int place : diagonal_) blocks(place, pair(p.i, p.j)) += factor(p, step);
  }

  void guess_inner(Interval /*step*/, ConstVectorRef /*q0*/, ConstVectorRef p0, ConstVectorRef v0,
                   ColumnsRef inner) override {
    inner.leftCols(s_).colwise() = v0;
    if (type() == GeneratingType::one) inner.col(s_) = p0;
  }

 private:
  void plan_pairings() {
    const int mu = 2 + s_;
    switch (type()) {
      case GeneratingType::one:
        pairings_ = {{0, mu, -1.0, false}, {1, mu, 1.0, false}};
        for (int k = 0; k < s_; ++k) pairings_.push_back({2 + k, mu, -table_.b[k], true});
        break;
      case GeneratingType::two:
        pairings_ = {{0, 1, 1.0, false}};
        for (int k = 0; k < s_; ++k) pairings_.push_back({1, 2 + k, table_.b[k], true});
        break;
      case GeneratingType::three:
        pairings_ = {{0, 1, -1.0, false}};
        for (int k = 0; k < s_; ++k) pairings_.push_back({0, 2 + k, table_.b[k], true});
        break;
      case GeneratingType::four:
        throw Misuse("the Gauss-Lobatto generating functions are of types 1, 2 and 3");
    }
  }

  static double factor(const ColumnProduct& p, Interval step) {
    return p.per_step ? p.factor * step.size : p.factor;
  }

  /// Q_i and V_i into q_ and v_; the time there.
  double move_to(int i, Interval step, ConstColumnsRef y) {
    q_ = y.col(base_);
    for (int k = 0; k < s_; ++k) q_ += step.size * from_base_(i, k) * y.col(2 + k);
    v_ = y.col(2 + i);
    return step.start + table_.c[i] * step.size;
  }

  /// Derivatives of Q_i by the base and by V_k.
  double along(int i, int column, double h) const {
    return column == base_ ? 1.0 : h * from_base_(i, column - 2);
  }

  /// The second derivatives of w L(Q_i,V_i), which moves with the base and with every V_k.
  void add_node(int i, double h, double w, ColumnsRef blocks) const {
    for (std::size_t a = 0; a < moving_.size(); ++a)
      for (std::size_t b = a; b < moving_.size(); ++b) {
        const int row = moving_[a], column = moving_[b];
        auto block = blocks.col(pair(row, column));
        add(block, places_, w * along(i, row, h) * along(i, column, h), lqq_);
        if (column == 2 + i) add(block, places_, w * along(i, row, h), lqv_);
        if (row == 2 + i) add(block, mirrored_places_, w * along(i, column, h), lqv_);
        if (row == 2 + i && column == 2 + i) add(block, places_, w, lvv_);
      }
  }

  template <class Block>
  static void add(Block& block, const std::vector<int>& places, double factor, const Vector& values) {
    for (std::size_t e = 0; e < places.size(); ++e)
      block[places[e]] += factor * values[static_cast<Eigen::Index>(e)];
  }

  std::shared_ptr<const Lagrangian> lagrangian_;
  int s_;
  GaussLobattoTableau table_;
  int base_;                 ///< the column that the stages start from
  double sign_;              ///< of h Σ b_i L
  Columns from_base_;        ///< Q_i = base + h Σ_k from_base_ik V_k
  std::vector<int> moving_;  ///< the columns that Q_i and V_i depend on
  std::vector<ColumnProduct> pairings_;
  std::vector<int> places_, mirrored_places_, diagonal_;
  Vector q_, v_, lq_, lv_, lqq_, lqv_, lvv_;
};

}  // namespace

std::unique_ptr<GeneratingFunction> gauss_lobatto_function(GeneratingType type, int s,
                                                           std::shared_ptr<const Lagrangian> lagrangian) {
  return std::make_unique<GaussLobattoFunction>(type, s, std::move(lagrangian));
}

}  // namespace diracstep
