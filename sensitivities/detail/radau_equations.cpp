#include <diracstep/core/steps/radau/tableau.hpp>
#include <diracstep/sensitivities/detail/stage_equations.hpp>
#include <utility>

namespace diracstep::sensitivity {

namespace {

/// The stages Q_i move with the start as D_i = ∂Q_i/∂X0 = (1 + h ∂(A_hᵀ w_i)/∂q, h ∂(A_hᵀ w_i)/∂θ).
template <class Matrix>
class RadauEquations final : public StageEquations<Matrix> {
 public:
  RadauEquations(StageParts parts, int s)
      : StageEquations<Matrix>(std::move(parts.problem)),
        scene_(std::move(parts.scene)),
        s_(s),
        n_(scene_->n()),
        size_(scene_->size()),
        m_(scene_->rows()),
        table_(radau_tableau(s)) {
    for (const auto& rows : scene_->scene().constraints)
      if (rows->holonomic()) m_h_ += rows->rows();
  }

  void take(const SolvedStage& at, StageJacobians<Matrix>& out) override {
    begin(this->problem(), at);
    out.by_unknowns = jacobian_of<Matrix>(this->problem(), at.x);
    const double h = at.step.size;
    const Eigen::Index unknowns = at.x.size();
    BlockSum<Matrix> start(unknowns, size_ + n_), end_x(2 * n_, unknowns), end(2 * n_, size_ + n_);
    const auto v = at.x.head(n_ * s_).reshaped(n_, s_);
    const Matrix along = projection(at);
    for (int i = 0; i < s_; ++i) {
      const double t = i == s_ - 1 ? at.step.end() : at.step.start + table_.c[i] * h;
      Vector q = at.start.q + h * v * table_.a.row(i).transpose();
      if (m_h_ > 0) q += h * (along * at.x.segment(projection_column(i), m_h_));
      const Matrix moves = point_by_start(at, i);
      ExtendedScene::LagrangianAt<Matrix> node;
      scene_->take(t, q, v.col(i), true, node);
      const Matrix momentum = node.v_by_point * moves;
      start.add(n_ * i, 0, momentum);
      start.add_identity(n_ * i, size_, n_, -1.0);
      Matrix force = h * node.q_by_point;
      if (m_ > 0)
        force +=
            scene_->template all_annihilator_derivatives<Matrix>(t, q, at.x.segment(n_ * s_ + m_ * i, m_));
      const Matrix moved_force = force * moves;
      for (int k = 0; k < s_; ++k) start.add(n_ * k, 0, moved_force, -table_.a(k, i));
      add_rows(at, i, t, q, v.col(i), moves, start);
      if (i < s_ - 1) continue;
      add_end(at, node, along, end_x);
      end.add(0, 0, Matrix(moves.topRows(n_)));
      end.add(n_, 0, momentum);
    }
    out.by_start = start.result();
    out.end_by_unknowns = end_x.result();
    out.end_by_start = end.result();
  }

 private:
  int projection_column(int i) const { return (n_ + m_) * s_ + m_h_ * i; }

  /// A_h(q0)ᵀ, n×m_h.
  Matrix projection(const SolvedStage& at) {
    BlockSum<Matrix> all(n_, m_h_);
    int first = 0;
    for (const auto& rows : scene_->scene().constraints) {
      if (!rows->holonomic()) continue;
      const Matrix a = scene_->template coefficients<Matrix>(*rows, at.step.start, at.start.q);
      all.add(0, first, Matrix(left_columns(a, n_).transpose()));
      first += rows->rows();
    }
    return all.result();
  }

  /// ∂X_i/∂X0, N×N.
  Matrix point_by_start(const SolvedStage& at, int i) {
    BlockSum<Matrix> moves(size_, size_);
    moves.add_identity(0, 0, size_);
    int first = projection_column(i);
    for (const auto& rows : scene_->scene().constraints) {
      if (!rows->holonomic()) continue;
      const Vector w = at.x.segment(first, rows->rows());
      moves.add(0, 0, scene_->template annihilator_derivative<Matrix>(*rows, at.step.start, at.start.q, w),
                at.step.size);
      first += rows->rows();
    }
    return moves.result();
  }

  void add_rows(const SolvedStage& at, int i, double t, const Vector& q, const Vector& v, const Matrix& moves,
                BlockSum<Matrix>& start) {
    int row = n_ * s_ + m_ * i, position = projection_column(i);
    for (const auto& rows : scene_->scene().constraints) {
      start.add(row, 0, Matrix(scene_->template derivative<Matrix>(*rows, t, q, v, 1.0) * moves));
      row += rows->rows();
      if (!rows->holonomic()) continue;
      start.add(position, 0, Matrix(scene_->template coefficients<Matrix>(*rows, t, q) * moves),
                1.0 / at.step.size);
      position += rows->rows();
    }
  }

  /// q1 = Q_s, p1 = ∂L/∂v(Q_s, V_s).
  void add_end(const SolvedStage& at, const ExtendedScene::LagrangianAt<Matrix>& node, const Matrix& along,
               BlockSum<Matrix>& end_x) {
    const double h = at.step.size;
    const Matrix by_position = left_columns(node.v_by_point, n_);
    for (int k = 0; k < s_; ++k) {
      end_x.add_identity(0, n_ * k, n_, h * table_.a(s_ - 1, k));
      end_x.add(n_, n_ * k, by_position, h * table_.a(s_ - 1, k));
    }
    end_x.add(n_, n_ * (s_ - 1), node.v_by_velocity);
    if (m_h_ == 0) return;
    end_x.add(0, projection_column(s_ - 1), along, h);
    end_x.add(n_, projection_column(s_ - 1), Matrix(by_position * along), h);
  }

  std::shared_ptr<ExtendedScene> scene_;
  int s_, n_, size_, m_, m_h_ = 0;
  RadauTableau table_;
};

}  // namespace

template <class Matrix>
std::unique_ptr<StageEquations<Matrix>> radau_equations(StageParts parts, int s) {
  return std::make_unique<RadauEquations<Matrix>>(std::move(parts), s);
}
template std::unique_ptr<StageEquations<Columns>> radau_equations(StageParts, int);
template std::unique_ptr<StageEquations<Sparse>> radau_equations(StageParts, int);

}  // namespace diracstep::sensitivity
