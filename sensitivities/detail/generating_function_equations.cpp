#include <diracstep/sensitivities/detail/stage_equations.hpp>
#include <utility>
#include <vector>

namespace diracstep::sensitivity {

namespace {

/// By the chain rule: each quantity has its derivatives by the unknowns x = (end, hλ, inner columns) and by
/// the start z = (q0, θ, p0).  F_x comes out of it as well, also for a step that is solved for λ alone since
/// S solves its graph: then the end is an unknown here all the same.
template <class Matrix>
class GeneratingFunctionEquations final : public StageEquations<Matrix> {
 public:
  GeneratingFunctionEquations(StageParts parts, std::unique_ptr<GeneratingFunction> extended,
                              const StepRule& rule)
      : StageEquations<Matrix>(std::move(parts.problem)),
        scene_(std::move(parts.scene)),
        s_(std::move(extended)),
        rule_(rule),
        graph_(graph_of(s_->type())),
        by_increment_(s_->type() == GeneratingType::one && s_->take_increments()),
        n_(scene_->n()),
        size_(scene_->size()),
        m_(scene_->rows()),
        inner_(s_->inner_columns()),
        unknowns_(n_ + m_ + n_ * inner_),
        plain_(!has_force() && m_ == 0 && inner_ == 0),
        y_(Columns::Zero(size_, s_->columns())),
        hessian_(Columns::Zero(s_->pattern().nonzeros(), s_->pairs())) {}

  int unknowns() const override { return unknowns_; }

  /// L_d by the Legendre transforms of the table in generating_function.hpp: p1 q1 where S lives on p1, less
  /// p0 q0 where it lives on p0, and S with the sign that makes dL_d = p1 dq1 − p0 dq0.
  std::optional<double> action(const SolvedStage& at) override {
    move_to(at);
    const double s = s_->value(at.step, y_);
    StepEnd end;
    this->problem().finish(at.x, end);
    double action = s_->type() == GeneratingType::two || s_->type() == GeneratingType::three ? -s : s;
    if (!graph_.starts_from_position) action -= y_.col(0).head(n_).dot(at.start.q);
    if (!graph_.ends_at_position) action += y_.col(1).head(n_).dot(end.at.q);
    return action;
  }

  void take(const SolvedStage& at, StageJacobians<Matrix>& out) override {
    move_to(at);
    s_->hessian(at.step, y_, hessian_);
    const double h = at.step.size;
    std::vector<Moved> columns{start_column(at), end_column(at)};
    for (int i = 0; i < inner_; ++i) columns.push_back(unknown(n_ + m_ + n_ * i));
    Moved end_position = graph_.ends_at_position ? columns[1] : scaled(gradient(1, columns), graph_.end_sign);
    if (graph_.ends_at_position) add_force_to_start(at, columns);
    BlockSum<Matrix> by_x(unknowns_, unknowns_), by_z(unknowns_, size_ + n_);
    const auto put = [&](int row, const Moved& moved, double factor) {
      by_x.add(row, 0, moved.by_unknowns, factor);
      by_z.add(row, 0, moved.by_start, factor);
    };
    const bool from_position = graph_.starts_from_position;
    put(0, gradient(0, columns), -graph_.start_sign * (from_position ? h : 1.0));
    by_z.add_identity(0, from_position ? size_ : 0, n_, from_position ? h : 1.0);
    if (from_position) {
      if (has_force()) put(0, force(at, end_position, false), h);
      if (m_ > 0) put(0, impulse(at), h);
    }
    if (m_ > 0) put(n_, constraint(at, end_position), 1.0);
    for (int i = 0; i < inner_; ++i) put(n_ + m_ + n_ * i, gradient(2 + i, columns), 1.0);
    Moved end_momentum = graph_.ends_at_position ? scaled(gradient(1, columns), graph_.end_sign) : columns[1];
    if (has_force()) add(end_momentum, force(at, end_position, true));
    out.by_unknowns = by_x.result();
    out.by_start = by_z.result();
    out.end_by_unknowns = stacked(end_position.by_unknowns, end_momentum.by_unknowns);
    out.end_by_start = stacked(end_position.by_start, end_momentum.by_start);
  }

  /// Of a step of S alone by products with its second derivatives.
  const Matrix& take_transposed(const SolvedStage& at) override {
    if (!plain_) return StageEquations<Matrix>::take_transposed(at);
    move_to(at);
    s_->hessian(at.step, y_, hessian_);
    h_ = at.step.size;
    this->taken_.by_unknowns =
        part_of<Matrix>(s_->pattern(), hessian_.col(s_->pair(0, 1)).data(), 0, n_, 0, n_);
    this->taken_.by_unknowns *= -equation_factor() * end_factor();
    return this->taken_.by_unknowns;
  }
  Columns pull_end(const Columns& end) override {
    if (!plain_) return StageEquations<Matrix>::pull_end(end);
    Columns result(n_, end.cols());
    for (Eigen::Index k = 0; k < end.cols(); ++k)
      result.col(k) = end_factor() * pulled(end.col(k), Vector::Zero(n_)).end.head(n_);
    return result;
  }
  Columns pull_start(const Columns& end, const Columns& w) override {
    if (!plain_) return StageEquations<Matrix>::pull_start(end, w);
    Columns result = Columns::Zero(size_ + n_, end.cols());
    for (Eigen::Index k = 0; k < end.cols(); ++k) {
      const Pulled of = pulled(end.col(k), w.col(k));
      auto z = result.col(k);
      const bool position = graph_.starts_from_position;
      if (is_position(0)) z.segment(n_, size_ - n_) += of.start.tail(size_ - n_);
      if (is_position(1)) z.segment(n_, size_ - n_) += of.end.tail(size_ - n_);
      z.segment(position ? 0 : size_, n_) += of.start.head(n_);
      if (by_increment_) z.head(n_) += of.end.head(n_);
      z.segment(position ? size_ : 0, n_) -= (position ? h_ : 1.0) * w.col(k);
    }
    return result;
  }

 private:
  /// Cotangents of the columns of S, N numbers each.
  struct Pulled {
    Vector start, end;
  };
  double equation_factor() const { return graph_.start_sign * (graph_.starts_from_position ? h_ : 1.0); }
  double end_factor() const { return graph_.ends_at_position ? 1.0 : 1.0 / h_; }

  /// Of z̄1·z1 − w·F, with z1 and F by the columns as take() has them.
  Pulled pulled(ConstVectorRef end, ConstVectorRef w) const {
    const auto q = end.head(n_), p = end.tail(n_);
    Vector of_start = Vector::Zero(size_), of_end = of_start;
    of_start.head(n_) = equation_factor() * w;
    of_end.head(n_) = graph_.end_sign * (graph_.ends_at_position ? p : q);
    Pulled sum{Vector::Zero(size_), Vector::Zero(size_)};
    const auto values = [&](int i, int j) { return hessian_.col(s_->pair(i, j)).data(); };
    const SparsityPattern& pattern = s_->pattern();
    pattern.transposed_multiply_add(values(0, 0), of_start.data(), sum.start.data());
    pattern.multiply_add(values(0, 1), of_end.data(), sum.start.data());
    pattern.transposed_multiply_add(values(0, 1), of_start.data(), sum.end.data());
    pattern.transposed_multiply_add(values(1, 1), of_end.data(), sum.end.data());
    sum.end.head(n_) += graph_.ends_at_position ? q : p;
    return sum;
  }

  /// A column of n numbers: its derivatives by x and by z.
  struct Moved {
    Matrix by_unknowns, by_start;
  };

  bool has_force() const { return scene_->scene().force != nullptr; }
  static Moved scaled(Moved moved, double factor) {
    moved.by_unknowns *= factor;
    moved.by_start *= factor;
    return moved;
  }
  static void add(Moved& to, const Moved& what) {
    to.by_unknowns += what.by_unknowns;
    to.by_start += what.by_start;
  }
  Matrix stacked(const Matrix& above, const Matrix& below) const {
    BlockSum<Matrix> both(2 * n_, above.cols());
    both.add(0, 0, above);
    both.add(n_, 0, below);
    return both.result();
  }
  /// `matrix`, n×N by X0, as n×(N+n) by z.
  Matrix by_point(const Matrix& matrix, double factor = 1.0) const {
    BlockSum<Matrix> sum(matrix.rows(), size_ + n_);
    sum.add(0, 0, matrix, factor);
    return sum.result();
  }
  Moved unknown(int first, double factor = 1.0) const {
    BlockSum<Matrix> sum(n_, unknowns_);
    sum.add_identity(0, first, n_, factor);
    return {sum.result(), zero<Matrix>(n_, size_ + n_)};
  }

  /// The columns of S, the start, the end and λ of the step.
  void move_to(const SolvedStage& at) {
    begin(this->problem(), at);
    StepEnd end;
    this->problem().finish(at.x, end);
    const double h = at.step.size;
    q1_ = end.at.q;
    const bool increment_known = by_increment_ && this->problem().size() == unknowns_;
    increment_ = increment_known ? Vector(at.x.head(n_)) : Vector(q1_ - at.start.q);
    lambda_ = end.impulse;
    Vector p1 = end.at.p, p0 = at.start.p;
    if (m_ > 0 && !graph_.starts_from_position)
      p0 += scene_->template all_coefficients<Matrix>(at.step.start, at.start.q).transpose() * lambda_;
    if (has_force()) {
      Vector minus = Vector::Zero(n_), plus = minus, f = Vector::Zero(size_);
      for (const StepNode& node : step_nodes(rule_)) {
        scene_->scene().force->value(time(at, node), scene_->point(position(at, node)),
                                     scene_->velocity(increment_ / h), f);
        minus += h * node.weight * (1.0 - node.c) * f.head(n_);
        plus += h * node.weight * node.c * f.head(n_);
      }
      p1 -= plus;
      if (!graph_.starts_from_position) p0 += minus;
    }
    y_.setZero();
    const auto put_position = [&](int column, ConstVectorRef q) { y_.col(column) = scene_->point(q); };
    if (graph_.starts_from_position)
      put_position(0, at.start.q);
    else
      y_.col(0).head(n_) = p0;
    if (by_increment_)
      y_.col(1).head(n_) = increment_;
    else if (graph_.ends_at_position)
      put_position(1, q1_);
    else
      y_.col(1).head(n_) = p1;
    for (int i = 0; i < inner_; ++i) put_position(2 + i, at.x.segment(n_ + m_ + n_ * i, n_));
  }
  static double time(const SolvedStage& at, const StepNode& node) {
    return at.step.start + node.c * at.step.size;
  }
  Vector position(const SolvedStage& at, const StepNode& node) const {
    return (1.0 - node.c) * at.start.q + node.c * q1_;
  }

  /// ∂(A(q0)ᵀλ): λ are the unknowns over h.
  Moved impulse(const SolvedStage& at) {
    BlockSum<Matrix> by_x(n_, unknowns_);
    by_x.add(0, n_, Matrix(scene_->template all_coefficients<Matrix>(at.step.start, at.start.q).transpose()),
             1.0 / at.step.size);
    return {by_x.result(), by_point(scene_->template all_annihilator_derivatives<Matrix>(
                               at.step.start, at.start.q, lambda_))};
  }

  Moved start_column(const SolvedStage& at) {
    const bool position = graph_.starts_from_position;
    BlockSum<Matrix> by_z(n_, size_ + n_);
    by_z.add_identity(0, position ? 0 : size_, n_);
    Moved column{zero<Matrix>(n_, unknowns_), by_z.result()};
    if (!position && m_ > 0) add(column, impulse(at));
    return column;
  }

  Moved end_column(const SolvedStage& at) const {
    Moved column = unknown(0, graph_.ends_at_position ? 1.0 : 1.0 / at.step.size);
    if (!by_increment_) return column;
    BlockSum<Matrix> by_z(n_, size_ + n_);
    by_z.add_identity(0, 0, n_);
    column.by_start = by_z.result();
    return column;
  }

  /// F⁻ as part of p̂0 where that is an argument of S.
  void add_force_to_start(const SolvedStage& at, std::vector<Moved>& columns) {
    if (has_force() && !graph_.starts_from_position) add(columns[0], force(at, columns[1], false));
  }

  /// A function of (q0, θ, q1) with such derivatives.
  Moved through(const Matrix& by_point_at_start, const Matrix& by_end, const Moved& end) const {
    return {Matrix(by_end * end.by_unknowns), Matrix(by_point(by_point_at_start) + by_end * end.by_start)};
  }

  /// F⁺ or F⁻.
  Moved force(const SolvedStage& at, const Moved& end, bool plus) {
    const double h = at.step.size;
    Matrix by_start = zero<Matrix>(n_, size_), by_end = zero<Matrix>(n_, n_);
    for (const StepNode& node : step_nodes(rule_)) {
      const double weight = h * node.weight * (plus ? node.c : 1.0 - node.c);
      const auto f = scene_->template force<Matrix>(time(at, node), position(at, node), increment_ / h);
      add_node(node.c, weight, f.by_point, Matrix(f.by_velocity * (1.0 / h)), by_start, by_end);
    }
    return through(by_start, by_end, end);
  }

  /// A term weight · f(X, w) with X = ((1−c) q0 + c q1, θ) and w = q1 − q0.
  void add_node(double c, double weight, const Matrix& by_x, const Matrix& by_way, Matrix& by_start,
                Matrix& by_end) const {
    BlockSum<Matrix> start(by_x.rows(), size_);
    start.add(0, 0, by_x, weight);
    start.add(0, 0, left_columns(by_x, n_), -weight * c);
    start.add(0, 0, by_way, -weight);
    by_start += start.result();
    by_end += weight * (c * Matrix(left_columns(by_x, n_)) + by_way);
  }

  /// c(q0, q1).
  Moved constraint(const SolvedStage& at, const Moved& end) {
    BlockSum<Matrix> by_x(m_, unknowns_), by_z(m_, size_ + n_);
    int row = 0;
    for (const auto& rows : scene_->scene().constraints) {
      const int m = rows->rows();
      Matrix by_start = zero<Matrix>(m, size_), by_end = zero<Matrix>(m, n_);
      if (rows->holonomic()) {
        const Matrix a = scene_->template coefficients<Matrix>(*rows, at.step.end(), q1_);
        BlockSum<Matrix> start(m, size_);
        start.add(0, 0, a);
        start.add(0, 0, left_columns(a, n_), -1.0);
        by_start = start.result();
        by_end = left_columns(a, n_);
      } else {
        for (const StepNode& node : step_nodes(rule_)) {
          const double t = time(at, node);
          const Vector q = position(at, node);
          const Matrix a = left_columns(scene_->template coefficients<Matrix>(*rows, t, q), n_);
          add_node(node.c, node.weight,
                   scene_->template derivative<Matrix>(*rows, t, q, increment_, at.step.size), a, by_start,
                   by_end);
        }
      }
      const Moved moved = through(by_start, by_end, end);
      by_x.add(row, 0, moved.by_unknowns);
      by_z.add(row, 0, moved.by_start);
      row += m;
    }
    return {by_x.result(), by_z.result()};
  }

  bool is_position(int column) const {
    if (column == 0) return graph_.starts_from_position;
    return column > 1 || graph_.ends_at_position;  // inner columns are positions
  }

  /// ∂²S/∂y_i∂y_j, rows of q in column i, all N of column j.
  Matrix second_derivative(int i, int j) const {
    const double* const values = hessian_.col(s_->pair(std::min(i, j), std::max(i, j))).data();
    if (i <= j) return part_of<Matrix>(s_->pattern(), values, 0, n_, 0, size_);
    return part_of<Matrix>(s_->pattern(), values, 0, size_, 0, n_).transpose();
  }

  /// Of ∂S/∂y_i.
  Moved gradient(int i, const std::vector<Moved>& columns) const {
    Moved sum{zero<Matrix>(n_, unknowns_), zero<Matrix>(n_, size_ + n_)};
    for (int j = 0; j < s_->columns(); ++j) {
      const Matrix second = second_derivative(i, j), by_column = left_columns(second, n_);
      const Moved& column = columns[static_cast<std::size_t>(j)];
      sum.by_unknowns += by_column * column.by_unknowns;
      sum.by_start += by_column * column.by_start;
      if (!is_position(j) || size_ == n_) continue;
      BlockSum<Matrix> by_parameters(n_, size_ + n_);
      by_parameters.add(0, 0, second);
      by_parameters.add(0, 0, by_column, -1.0);
      sum.by_start += by_parameters.result();
    }
    return sum;
  }

  std::shared_ptr<ExtendedScene> scene_;
  std::unique_ptr<GeneratingFunction> s_;
  StepRule rule_;
  GraphOf graph_;
  bool by_increment_;
  int n_, size_, m_, inner_, unknowns_;
  bool plain_;  ///< no force, no rows, no inner columns: S alone
  Columns y_, hessian_;
  double h_ = 0.0;
  Vector q1_, increment_, lambda_;
};

}  // namespace

template <class Matrix>
std::unique_ptr<StageEquations<Matrix>> generating_function_equations(
    StageParts parts, std::unique_ptr<GeneratingFunction> extended, const StepRule& rule) {
  return std::make_unique<GeneratingFunctionEquations<Matrix>>(std::move(parts), std::move(extended), rule);
}
template std::unique_ptr<StageEquations<Columns>> generating_function_equations(
    StageParts, std::unique_ptr<GeneratingFunction>, const StepRule&);
template std::unique_ptr<StageEquations<Sparse>> generating_function_equations(
    StageParts, std::unique_ptr<GeneratingFunction>, const StepRule&);

}  // namespace diracstep::sensitivity
