#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/sensitivities/detail/gauss_lobatto_products.hpp>
#include <diracstep/sensitivities/detail/stage_equations.hpp>
#include <utility>
#include <vector>

namespace diracstep::sensitivity {

void begin(StepProblem& problem, const SolvedStage& at) {
  const StepTraits traits = problem.traits();
  problem.begin(at.step, at.start, {false, Vector::Zero(traits.scales), Vector::Zero(traits.multipliers)});
}

namespace {

template <class Matrix>
class GaussLobattoEquations final : public StageEquations<Matrix> {
 public:
  GaussLobattoEquations(StageParts parts, int s)
      : StageEquations<Matrix>(std::move(parts.problem)),
        scene_(std::move(parts.scene)),
        s_(s),
        n_(scene_->n()),
        size_(scene_->size()),
        m_(scene_->rows()),
        table_(gauss_lobatto_tableau(s)),
        nodes_(static_cast<std::size_t>(s)),
        products_(scene_, s) {}

  void take(const SolvedStage& at, StageJacobians<Matrix>& out) override {
    begin(this->problem(), at);
    out.by_unknowns = jacobian_of<Matrix>(this->problem(), at.x);
    const Eigen::Index unknowns = at.x.size();
    BlockSum<Matrix> start(unknowns, size_ + n_), end_x(2 * n_, unknowns), end(2 * n_, size_ + n_);
    end.add_identity(0, 0, n_);
    end.add_identity(n_, size_, n_);
    add_lagrangian(at, start, end_x, end);
    int first = 0;
    for (const auto& rows : scene_->scene().constraints) {
      add_rows(*rows, first, at, start, end_x, end);
      first += rows->rows();
    }
    out.by_start = start.result();
    out.end_by_unknowns = end_x.result();
    out.end_by_start = end.result();
  }

  const Matrix& take_transposed(const SolvedStage& at) override {
    begin(this->problem(), at);
    this->taken_.by_unknowns = jacobian_of<Matrix>(this->problem(), at.x);
    products_.take(at);
    return this->taken_.by_unknowns;
  }
  Columns pull_end(const Columns& end) override { return products_.end_by_unknowns(end); }
  Columns pull_start(const Columns& end, const Columns& w) override { return products_.by_start(end, w); }

  /// h Σ b_i L(Q_i, V_i).
  std::optional<double> action(const SolvedStage& at) override {
    const double h = at.step.size;
    const auto v = velocities(at);
    double sum = 0.0;
    for (int i = 0; i < s_; ++i) {
      const Vector q = at.start.q + h * v * table_.a.row(i).transpose();
      sum += h * table_.b[i] *
             scene_->scene().lagrangian->value(at.step.start + table_.c[i] * h, scene_->point(q),
                                               scene_->velocity(v.col(i)));
    }
    return sum;
  }

 private:
  auto velocities(const SolvedStage& at) const { return at.x.head(n_ * s_).reshaped(n_, s_); }

  void add_lagrangian(const SolvedStage& at, BlockSum<Matrix>& start, BlockSum<Matrix>& end_x,
                      BlockSum<Matrix>& end) {
    const double h = at.step.size;
    const auto v = velocities(at);
    for (int i = 0; i < s_; ++i) {
      const Vector q = at.start.q + h * v * table_.a.row(i).transpose();
      scene_->take(at.step.start + table_.c[i] * h, q, v.col(i), true, node(i));
    }
    for (int i = 0; i < s_; ++i) {
      start.add(n_ * i, 0, node(i).v_by_point);
      start.add_identity(n_ * i, size_, n_, -1.0);
      for (int j = 0; j < s_; ++j) start.add(n_ * i, 0, node(j).q_by_point, -h * table_.a_hat(i, j));
      end.add(n_, 0, node(i).q_by_point, h * table_.b[i]);
      end_x.add_identity(0, n_ * i, n_, h * table_.b[i]);
      end_x.add(n_, n_ * i, node(i).q_by_velocity, h * table_.b[i]);
    }
    for (int j = 0; j < s_; ++j) {
      const Matrix stiffness = left_columns(node(j).q_by_point, n_);
      for (int k = 0; k < s_; ++k) end_x.add(n_, n_ * k, stiffness, h * h * table_.b[j] * table_.a(j, k));
    }
  }

  void add_rows(const ConstraintRows& rows, int first, const SolvedStage& at, BlockSum<Matrix>& start,
                BlockSum<Matrix>& end_x, BlockSum<Matrix>& end) {
    const double h = at.step.size;
    const auto v = velocities(at);
    const auto row = [&](int j) { return n_ * s_ + m_ * j + first; };
    for (int j = 0; j <= s_; ++j) {
      const double t = at.step.start + table_.lobatto_c[j] * h;
      const Vector q = at.start.q + h * v * table_.lobatto_a.row(j).transpose();
      const Matrix a = scene_->coefficients<Matrix>(rows, t, q);
      if (j > 0 && rows.holonomic()) start.add(row(j - 1), 0, a, 1.0 / h);
      if (j == s_) break;
      const Vector lambda = at.x.segment(row(j), rows.rows());
      const Matrix curvature = scene_->annihilator_derivative<Matrix>(rows, t, q, lambda);
      const double weight = table_.lobatto_b[j];
      for (int i = 0; i < s_; ++i) start.add(n_ * i, 0, curvature, -table_.e(i, j));
      end.add(n_, 0, curvature, weight);
      end_x.add(n_, row(j), Matrix(left_columns(a, n_).transpose()), weight);
      const Matrix by_position = left_columns(curvature, n_);
      for (int k = 0; k < s_; ++k) end_x.add(n_, n_ * k, by_position, weight * h * table_.lobatto_a(j, k));
    }
    for (int i = 0; !rows.holonomic() && i < s_; ++i) {
      const Vector q = at.start.q + h * v * table_.a.row(i).transpose();
      start.add(row(i), 0,
                scene_->derivative<Matrix>(rows, at.step.start + table_.c[i] * h, q, v.col(i), 1.0));
    }
  }

  ExtendedScene::LagrangianAt<Matrix>& node(int i) { return nodes_[static_cast<std::size_t>(i)]; }

  std::shared_ptr<ExtendedScene> scene_;
  int s_, n_, size_, m_;
  GaussLobattoTableau table_;
  std::vector<ExtendedScene::LagrangianAt<Matrix>> nodes_;
  GaussLobattoProducts products_;
};

/// With P = Dθ(q0)ᵀν:
///   F_i = θ(Q_i) − p0 − P − h Σ â_ij ∂L/∂q_j,   F_s = θ(q1) − p0 − P − h Σ b_j ∂L/∂q_j − σ Dθ(q1)ᵀν
template <class Matrix>
class PhaseSpaceEquations final : public StageEquations<Matrix> {
 public:
  PhaseSpaceEquations(StageParts parts, int s)
      : StageEquations<Matrix>(std::move(parts.problem)),
        scene_(std::move(parts.scene)),
        s_(s),
        n_(scene_->n()),
        sign_(s % 2 == 0 ? 1.0 : -1.0),
        table_(gauss_lobatto_tableau(s)) {}

  void take(const SolvedStage& at, StageJacobians<Matrix>& out) override {
    begin(this->problem(), at);
    out.by_unknowns = jacobian_of<Matrix>(this->problem(), at.x);
    const int size = scene_->size();
    const double h = at.step.size;
    const auto v = at.x.head(n_ * s_).reshaped(n_, s_);
    const Vector nu = at.x.tail(n_), q1 = at.start.q + h * v * table_.b + (1.0 + sign_) * nu;
    ExtendedScene::LagrangianAt<Matrix> node, end_node;
    scene_->take(at.step.end(), q1, Vector::Zero(n_), false, end_node);
    const Matrix projection = along(at.step.start, at.start.q, nu),
                 end_projection = along(at.step.end(), q1, nu);
    BlockSum<Matrix> start(at.x.size(), size + n_), end_x(2 * n_, at.x.size()), end(2 * n_, size + n_);
    for (int i = 0; i <= s_; ++i) {
      start.add(n_ * i, 0, projection, -1.0);
      start.add_identity(n_ * i, size, n_, -1.0);
    }
    for (int j = 0; j < s_; ++j) {
      const Vector q = at.start.q + nu + h * v * table_.a.row(j).transpose();
      scene_->take(at.step.start + table_.c[j] * h, q, v.col(j), false, node);
      start.add(n_ * j, 0, node.v_by_point);
      for (int i = 0; i < s_; ++i) start.add(n_ * i, 0, node.q_by_point, -h * table_.a_hat(i, j));
      start.add(n_ * s_, 0, node.q_by_point, -h * table_.b[j]);
    }
    start.add(n_ * s_, 0, end_node.v_by_point);
    start.add(n_ * s_, 0, end_projection, -sign_);
    end.add_identity(0, 0, n_);
    end.add(n_, 0, end_node.v_by_point);
    const Matrix theta = left_columns(end_node.v_by_point, n_);
    for (int k = 0; k <= s_; ++k) {
      const double weight = k < s_ ? h * table_.b[k] : 1.0 + sign_;
      end_x.add_identity(0, n_ * k, n_, weight);
      end_x.add(n_, n_ * k, theta, weight);
    }
    out.by_start = start.result();
    out.end_by_unknowns = end_x.result();
    out.end_by_start = end.result();
  }

 private:
  /// ∂(Dθ(q)ᵀν)/∂X, a difference of ∂²L/∂q∂X, which is linear in v.
  Matrix along(double t, const Vector& q, const Vector& nu) {
    ExtendedScene::LagrangianAt<Matrix> at_nu, at_rest;
    scene_->take(t, q, nu, false, at_nu);
    scene_->take(t, q, Vector::Zero(n_), false, at_rest);
    return at_nu.q_by_point - at_rest.q_by_point;
  }

  std::shared_ptr<ExtendedScene> scene_;
  int s_, n_;
  double sign_;
  GaussLobattoTableau table_;
};

}  // namespace

template <class Matrix>
std::unique_ptr<StageEquations<Matrix>> gauss_lobatto_equations(StageParts parts, int s) {
  return std::make_unique<GaussLobattoEquations<Matrix>>(std::move(parts), s);
}
template std::unique_ptr<StageEquations<Columns>> gauss_lobatto_equations(StageParts, int);
template std::unique_ptr<StageEquations<Sparse>> gauss_lobatto_equations(StageParts, int);

template <class Matrix>
std::unique_ptr<StageEquations<Matrix>> phase_space_equations(StageParts parts, int s) {
  return std::make_unique<PhaseSpaceEquations<Matrix>>(std::move(parts), s);
}
template std::unique_ptr<StageEquations<Columns>> phase_space_equations(StageParts, int);
template std::unique_ptr<StageEquations<Sparse>> phase_space_equations(StageParts, int);

}  // namespace diracstep::sensitivity
