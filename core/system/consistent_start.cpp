#include <Eigen/QR>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/core/system/saddle_point.hpp>
#include <set>
#include <sstream>

namespace diracstep {

namespace {

/// Unknowns (q, ν):   q − q̂ + Dφ(q)ᵀν = 0,   φ(t,q) = 0: the nearest point of the constraint, full matrices.
class NearestPointProblem final : public NonlinearProblem {
 public:
  NearestPointProblem(ConstraintBlocks blocks, double t, const Vector& given)
      : blocks_(std::move(blocks)),
        rows_(blocks_, static_cast<int>(given.size())),
        t_(t),
        given_(given),
        n_(static_cast<int>(given.size())),
        m_(rows_.rows()),
        pattern_(SparsityPattern::dense(n_ + m_, n_ + m_)),
        residual_blocks_{{"distance", n_, 1.0 + given.lpNorm<Eigen::Infinity>()}, {"constraint", m_, 1.0}} {}

  int size() const override { return n_ + m_; }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return residual_blocks_; }

  void residual(ConstVectorRef x, VectorRef f) override {
    rows_.evaluate(t_, x.head(n_));
    f.head(n_) = x.head(n_) - given_;
    rows_.add_annihilator(x.tail(m_), f.head(n_));
    int row = n_;
    for (const auto& block : blocks_) {
      block->position(t_, x.head(n_), f.segment(row, block->rows()));
      row += block->rows();
    }
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    rows_.evaluate(t_, x.head(n_));
    auto j = values.reshaped(size(), size());
    j.setZero();
    j.topLeftCorner(n_, n_).setIdentity();
    int row = n_;
    for (const auto& block : blocks_) {
      Vector curvature(block->curvature_pattern().nonzeros());
      block->annihilator_derivative(t_, x.head(n_), x.segment(row, block->rows()), curvature);
      Eigen::Index k = 0;
      for (const auto& [i, c] : block->curvature_pattern().entries()) j(i, c) += curvature[k++];
      row += block->rows();
    }
    Eigen::Index k = 0;
    for (const auto& [i, c] : rows_.pattern().entries()) {
      j(n_ + i, c) = j(c, n_ + i) = rows_.coefficients()[k];
      ++k;
    }
  }

 private:
  ConstraintBlocks blocks_;
  ConstraintsAtPoint rows_;
  double t_;
  Vector given_;
  int n_, m_;
  SparsityPattern pattern_;
  std::vector<ResidualBlock> residual_blocks_;
};

[[noreturn]] void throw_not_found(const Scene& scene, const char* what, const SolveReport& report) {
  std::ostringstream message;
  message << "scene '" << scene.name << "': the start cannot be projected: " << what << ": "
          << describe(report.status) << " after " << report.iterations << " iterations, residuals "
          << report.residual_norms[0] << " and " << report.residual_norms[1];
  throw Misuse(message.str());
}

/// Some rows of a block, in order.
class RowSubset final : public ConstraintRows {
 public:
  RowSubset(std::shared_ptr<const ConstraintRows> block, std::vector<int> kept)
      : ConstraintRows(block->holonomic(), subset(block->pattern(), kept), block->curvature_pattern(),
                       names_of(*block, kept)),
        block_(std::move(block)),
        kept_(std::move(kept)) {
    const std::vector<int> numbers = numbers_of(block_->rows(), kept_);
    int k = 0;
    for (const auto& [row, column] : block_->pattern().entries()) {
      if (numbers[static_cast<std::size_t>(row)] >= 0) places_.push_back(k);
      ++k;
    }
  }

  bool constant() const override { return block_->constant(); }
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
};

/// Up to so many rows full matrices take less time.
constexpr int max_rows_in_full = 100;

/// Aᵀ with columns of size 1, since rows may come in any units.
Columns full_one_forms(const ConstraintsAtPoint& rows) {
  Columns one_forms = rows.pattern().full(rows.coefficients()).transpose();
  for (auto column : one_forms.colwise())
    if (const double size = column.norm(); size > 0.0) column /= size;
  return one_forms;
}
Eigen::SparseMatrix<double> sparse_one_forms(const ConstraintsAtPoint& rows) {
  const SparsityPattern& pattern = rows.pattern();
  Eigen::SparseMatrix<double> one_forms =
      Eigen::Map<const Eigen::SparseMatrix<double>>(pattern.rows(), pattern.columns(), pattern.nonzeros(),
                                                    pattern.column_starts().data(),
                                                    pattern.row_indices().data(), rows.coefficients().data())
          .transpose();
  for (int r = 0; r < pattern.rows(); ++r)
    if (const double size = one_forms.col(r).norm(); size > 0.0) one_forms.col(r) /= size;
  return one_forms;
}

std::vector<int> dependent_columns(const Columns& one_forms, double tolerance) {
  Eigen::ColPivHouseholderQR<Columns> qr;
  qr.setThreshold(tolerance);
  qr.compute(one_forms);
  const auto& order = qr.colsPermutation().indices();
  return {order.data() + qr.rank(), order.data() + order.size()};
}

/// The pivots of the Gram matrix are squared distances from the columns before.  The shift keeps those that
/// vanish from dividing, and 1e-12 is what round-off leaves to be told from zero.
std::vector<int> dependent_columns(const Eigen::SparseMatrix<double>& one_forms, double tolerance) {
  const Eigen::SparseMatrix<double> products = one_forms.transpose() * one_forms;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors;
  factors.setShift(1e-14);
  factors.compute(products);
  const Vector pivots = factors.vectorD();
  const auto& order = factors.permutationPinv().indices();
  std::vector<int> dependent;
  for (Eigen::Index k = 0; k < pivots.size(); ++k)
    if (!(pivots[k] > std::max(tolerance * tolerance, 1e-12))) dependent.push_back(order[k]);
  return dependent;
}

}  // namespace

ConsistentStart project_start(const Scene& given, const Start& given_start, const SolverFactory& solvers) {
  auto copy = std::make_shared<Scene>(given);
  copy->start = given_start;
  const auto complete = completed(std::move(copy)), extended = with_hidden_rows(complete);
  const Scene& scene = *extended;
  const Start& start = complete->start;
  require_size("the start q", start.q.size(), scene.storage_size());
  require_size("the start v", start.v.size(), scene.dimension());
  ConsistentStart result{start, 0.0, 0.0};
  const Eigen::Index n = start.q.size();
  const ConstraintBlocks holonomic = only_holonomic(scene.constraints);
  if (!holonomic.empty()) {
    NearestPointProblem problem(holonomic, start.time, start.q);
    Vector x = Vector::Zero(problem.size());
    x.head(n) = start.q;
    const SolveReport report = solvers(problem)->solve(x);
    if (!report.ok()) throw_not_found(scene, "no nearest point of the holonomic rows", report);
    result.start.q = x.head(n);
    result.position_moved = (result.start.q - start.q).norm();
  }
  if (scene.rows() == 0) return result;
  Vector lq(n), p(n), x = Vector::Zero(n + scene.rows());
  scene.lagrangian->gradient(start.time, result.start.q, start.v, lq, p);
  VelocityProblem problem(scene, true);
  problem.begin(start.time, result.start.q, p);
  x.head(n) = start.v;
  const SolveReport report = solvers(problem)->solve(x);
  if (!report.ok()) throw_not_found(scene, "no nearest velocity of the distribution", report);
  result.start.v = x.head(n);
  result.velocity_moved = (result.start.v - start.v).norm();
  return result;
}

std::vector<std::string> redundant_rows(const Scene& scene, const Start& start, double tolerance) {
  if (scene.rows() == 0) return {};
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(start.time, start.q);
  const std::vector<int> numbers = scene.rows() <= max_rows_in_full
                                       ? dependent_columns(full_one_forms(rows), tolerance)
                                       : dependent_columns(sparse_one_forms(rows), tolerance);
  if (numbers.empty()) return {};
  const std::vector<std::string> names = scene.row_names();
  std::vector<std::string> dependent;
  for (const int r : numbers) dependent.push_back(names[static_cast<std::size_t>(r)]);
  std::ranges::sort(dependent);
  return dependent;
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
      copy->constraints.push_back(std::make_shared<const RowSubset>(block, kept));
  }
  return copy;
}

}  // namespace diracstep
