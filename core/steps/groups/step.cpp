#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/steps/groups/point.hpp>
#include <diracstep/core/steps/groups/step.hpp>
#include <span>
#include <string>

namespace diracstep {

namespace {

/// A node of a step in the chart around its middle: X = Σ_l α_l V_l.
struct GroupNode {
  double t = 0.0;
  Vector alpha;                           ///< s
  Vector x, q;                            ///< X, and g_c τ(X)
  Columns adjoint_back, dtau, dtau_back;  ///< Ad_{τ(−X)}, dτ_X, dτ_{−X}
  Vector carried;                         ///< Ad_{τ(−X)}ᵀ of the force or the impulse there

  void place(const Space& space, const Columns& v) {
    const Eigen::Index d = space.group_dimension();
    x = v * alpha;
    Columns forth(d, d);
    adjoint_back.resize(d, d);
    dtau.resize(d, d);
    dtau_back.resize(d, d);
    space.maps(x, forth, dtau);
    space.maps(-x, adjoint_back, dtau_back);
  }
};

class GroupStep final : public StepProblem {
 public:
  GroupStep(int s, const Scene& scene)
      : scene_(scene),
        space_(*scene.space),
        s_(s),
        n_(scene.dimension()),
        m_(scene.rows()),
        table_(gauss_lobatto_tableau(s)),
        reduced_(reduced_on_group(scene)),
        rows_at_start_(scene),
        pattern_(SparsityPattern::dense(size(), size())),
        blocks_{{{"momentum", s * n_}, {"constraint", s * m_}}} {
    gauss_.resize(static_cast<std::size_t>(s));
    lobatto_.resize(static_cast<std::size_t>(s) + 1);
    for (int i = 0; i < s; ++i) points_.emplace_back(scene);
    for (int j = 0; j <= s; ++j) rows_.emplace_back(scene), gauss_rows_.emplace_back(scene);
  }

  int size() const override { return s_ * (n_ + m_); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return std::span(blocks_).first(m_ > 0 ? 2 : 1); }

  StepTraits traits() const override {
    StepTraits traits{"stage velocities (" + std::to_string(s_ * n_) + ")", s_ * n_, 3, 0};
    if (m_ > 0) traits.unknowns += ", multipliers (" + std::to_string(s_ * m_) + ")";
    traits.unknowns += " on " + space_.name();
    if (s_ == 1) return traits;
    traits.stages = {{n_, lagrange_basis(table_.c, table_.c.array() + 1.0).transpose()}};
    const Vector lobatto_c = table_.lobatto_c.head(s_);
    if (m_ > 0) traits.stages.push_back({m_, lagrange_basis(lobatto_c, lobatto_c.array() + 1.0).transpose()});
    return traits;
  }

  std::string failure() const override { return failure_; }

  void begin(Interval step, const State& start, const StepMemory& memory) override {
    if (step.start != step_.start) failure_.clear();
    step_ = step;
    q0_ = start.q;
    p0_.resize(space_.group_dimension());
    space_.embed(start.p, p0_);
    for (int i = 0; i < s_; ++i) set_node(gauss_[at(i)], table_.c[i], table_.a.row(i));
    for (int j = 0; j <= s_; ++j) set_node(lobatto_[at(j)], table_.lobatto_c[j], table_.lobatto_a.row(j));
    force_size_ = memory.known ? memory.scales[0] : 0.0;
    curvature_ = memory.known ? memory.scales[1] : 0.0;
    impulse_size_ = memory.known ? memory.scales[2] : 0.0;
    momentum_size_ = velocity_size_ = form_size_ = 0.0;
    if (m_ > 0) {
      rows_at_start_.evaluate(step.start, q0_);
      form_size_ = max_norm(rows_at_start_.forms());
    }
    set_scales();
    evaluated_ = false;
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    for (int i = 0; i < s_; ++i) x.segment(n_ * i, n_) = v0;
    x.tail(m_ * s_).setZero();
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    if (!inside_) {
      f.setConstant(std::nan(""));
      return;
    }
    const double h = step_.size;
    const Vector ends = 0.5 * centre_.dtau_back.transpose() * (p0_ + middle_momentum_);
    for (int k = 0; k < s_; ++k) {
      Vector row = gauss_[at(k)].dtau.transpose() * points_[at(k)].momentum() - ends;
      for (int i = 0; i < s_; ++i) row += gauss_weight(i, k) * phi_.col(i);
      for (int j = 0; m_ > 0 && j < s_; ++j)
        row += lobatto_weight(j, k) * (lobatto_[at(j)].dtau.transpose() * impulses_.col(j));
      space_.restrict(row, f.segment(n_ * k, n_));
    }
    if (m_ == 0) return;
    Vector positions(m_);
    for (int k = 0; k < s_; ++k) {
      const auto out = [&](int r) -> double& { return f[n_ * s_ + m_ * k + r]; };
      const Vector rates = gauss_rows_[at(k)].forms() * xi_.col(k) + gauss_rows_[at(k)].offsets();
      if (has_holonomic())
        rows_[at(k) + 1].positions(lobatto_[at(k) + 1].t, lobatto_[at(k) + 1].q, positions);
      for (int r = 0; r < m_; ++r) out(r) = holonomic(r) ? positions[r] / h : rates[r];
    }
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    auto matrix = values.reshaped(size(), size());
    if (!inside_) {
      matrix.setConstant(std::nan(""));
      return;
    }
    matrix.setZero();
    take_derivatives(x);
    for (int l = 0; l < s_; ++l) add_velocity_columns(l, matrix);
    for (int j = 0; m_ > 0 && j < s_; ++j) add_multiplier_columns(j, matrix);
    set_scales();
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    if (!inside_) {
      end.at.q.setConstant(space_.storage_size(), std::nan(""));
      end.at.p.setConstant(n_, std::nan(""));
      end.at.v.setConstant(n_, std::nan(""));
      return;
    }
    space_.move(q0_, y_, g_c_);
    end.at.q.resize(space_.storage_size());
    space_.move(g_c_, y_, end.at.q);
    end.at.p.resize(n_);
    space_.restrict(centre_.adjoint.transpose() * middle_momentum_, end.at.p);
    end.at.v.resize(n_);
    space_.restrict(2.0 / step_.size * y_, end.at.v);
    end.impulse = table_.lobatto_b[0] * x.segment(n_ * s_, m_);
    end.memory.known = true;
    end.memory.scales.resize(3);
    end.memory.scales << max_norm(forces_), curvature_, impulse_size_;
    end.memory.multipliers.resize(0);
  }

 private:
  /// What of the middle of the step enters: Ad_{τ(y)}, dτ_y, dτ_{−y}.
  struct Centre {
    Columns adjoint, dtau, dtau_back;
  };

  Eigen::VectorBlock<const Eigen::Ref<const Vector>> multipliers(ConstVectorRef x, int j) const {
    return x.segment(n_ * s_ + m_ * j, m_);
  }
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  bool holonomic(int r) const { return rows_at_start_.holonomic()[at(r)]; }
  bool has_holonomic() const {
    return std::ranges::find(rows_at_start_.holonomic(), true) != rows_at_start_.holonomic().end();
  }
  bool has_nonholonomic() const {
    return std::ranges::find(rows_at_start_.holonomic(), false) != rows_at_start_.holonomic().end();
  }
  double gauss_weight(int i, int k) const {
    return step_.size * table_.b[i] / table_.b[k] * (table_.a(i, k) - 0.5 * table_.b[k]);
  }
  double lobatto_weight(int j, int k) const {
    return table_.lobatto_b[j] / table_.b[k] * (table_.lobatto_a(j, k) - 0.5 * table_.b[k]);
  }
  double of_centre(int l) const { return 0.5 * step_.size * table_.b[l]; }

  template <class Coefficients>
  void set_node(GroupNode& node, double c, const Coefficients& a) {
    node.t = step_.start + c * step_.size;
    node.alpha = step_.size * (a.transpose() - 0.5 * table_.b);
  }

  /// Everything the residual is made of, at x, unless x is where it was last taken.
  void evaluate(ConstVectorRef x) {
    if (evaluated_ && last_x_ == x) return;
    evaluated_ = true;
    last_x_ = x;
    const Eigen::Index d = space_.group_dimension();
    v_.resize(d, s_);
    for (int i = 0; i < s_; ++i) space_.embed(x.segment(n_ * i, n_), v_.col(i));
    y_ = 0.5 * step_.size * (v_ * table_.b);
    place_nodes();
    if (!inside_) return;
    middle_momentum_ = centre_.adjoint.transpose() * p0_;
    add_forces();
    if (m_ > 0) add_rows(x);
    velocity_size_ = max_norm(xi_);
    set_scales();
  }

  void place_nodes() {
    const Eigen::Index d = space_.group_dimension();
    for (Columns* matrix : {&centre_.adjoint, &centre_.dtau, &centre_.dtau_back}) matrix->resize(d, d);
    Columns unused(d, d);
    space_.maps(y_, centre_.adjoint, centre_.dtau);
    space_.maps(-y_, unused, centre_.dtau_back);
    g_c_.resize(space_.storage_size());
    if (!reduced_) space_.move(q0_, y_, g_c_);
    double part = space_.part_of_chart(y_);
    for (GroupNode& node : gauss_) {
      node.place(space_, v_);
      part = std::max(part, space_.part_of_chart(node.x));
      move_to(node);
    }
    for (std::size_t j = 0; m_ > 0 && j < lobatto_.size(); ++j) {
      lobatto_[j].place(space_, v_);
      part = std::max(part, space_.part_of_chart(lobatto_[j].x));
      if (j == 0)
        lobatto_[j].q = q0_;
      else
        move_to(lobatto_[j]);
    }
    inside_ = part < 1.0;
    if (inside_) return;
    failure_ = "a step turned by more than its retraction is injective on, from its middle by " +
               std::to_string(part) + " of that; take a smaller one";
  }

  void move_to(GroupNode& node) {
    node.q = q0_;
    if (!reduced_) space_.move(g_c_, node.x, node.q);
  }

  void add_forces() {
    const Eigen::Index d = space_.group_dimension();
    for (Columns* columns : {&xi_, &phi_, &forces_}) columns->resize(d, s_);
    Columns along(d, d);
    momentum_size_ = 0.0;
    for (int i = 0; i < s_; ++i) {
      GroupNode& node = gauss_[at(i)];
      GroupPoint& point = points_[at(i)];
      xi_.col(i) = node.dtau * v_.col(i);
      point.evaluate(node.t, node.q, xi_.col(i));
      space_.dtau_along(node.x, v_.col(i), along);
      forces_.col(i) = point.force();
      phi_.col(i) = along.transpose() * point.momentum() + node.dtau.transpose() * point.force();
      node.carried = node.adjoint_back.transpose() * point.force();
      middle_momentum_ += step_.size * table_.b[i] * node.carried;
      momentum_size_ = std::max(momentum_size_, max_norm(point.momentum()));
    }
    force_size_ = std::max(force_size_, max_norm(forces_));
  }

  void add_rows(ConstVectorRef x) {
    impulses_.resize(space_.group_dimension(), s_);
    for (int j = 0; j < s_; ++j) {
      GroupNode& node = lobatto_[at(j)];
      rows_[at(j)].evaluate(node.t, node.q);
      impulses_.col(j) = rows_[at(j)].impulse(multipliers(x, j));
      node.carried = node.adjoint_back.transpose() * impulses_.col(j);
      middle_momentum_ += table_.lobatto_b[j] * node.carried;
    }
    impulse_size_ = std::max(impulse_size_, max_norm(impulses_));
    for (int k = 0; has_nonholonomic() && k < s_; ++k) {
      gauss_rows_[at(k)].evaluate(gauss_[at(k)].t, gauss_[at(k)].q);
      form_size_ = std::max(form_size_, max_norm(gauss_rows_[at(k)].forms()));
    }
  }

  /// Derivatives at all nodes, and those of dτ.
  struct NodeDerivatives {
    GroupPoint::Derivatives of;
    Columns along, momentum_along, force_along, hessian, carried;
    Columns impulse, impulse_along;  ///< at a Lobatto node
  };

  void take_derivatives(ConstVectorRef x) {
    const Eigen::Index d = space_.group_dimension();
    derivatives_.resize(lobatto_.size());
    curvature_ = 0.0;
    for (int i = 0; i < s_; ++i) {
      const GroupNode& node = gauss_[at(i)];
      NodeDerivatives& out = derivatives_[at(i)];
      for (Columns* matrix : {&out.along, &out.momentum_along, &out.force_along, &out.hessian, &out.carried})
        matrix->resize(d, d);
      points_[at(i)].derivatives(out.of);
      space_.dtau_along(node.x, v_.col(i), out.along);
      space_.dtau_transposed_along(node.x, points_[at(i)].momentum(), out.momentum_along);
      space_.dtau_transposed_along(node.x, points_[at(i)].force(), out.force_along);
      space_.pairing_hessian(node.x, v_.col(i), points_[at(i)].momentum(), out.hessian);
      space_.coadjoint(node.carried, out.carried);
      curvature_ = std::max(curvature_, out.of.curvature);
    }
    lobatto_carried_.assign(lobatto_.size(), Columns(d, d));
    for (int j = 0; m_ > 0 && j < s_; ++j) {
      const GroupNode& node = lobatto_[at(j)];
      NodeDerivatives& out = derivatives_[at(j)];
      out.impulse.resize(d, d);
      out.impulse_along.resize(d, d);
      rows_[at(j)].impulse_derivative(node.t, node.q, multipliers(x, j), out.impulse);
      space_.dtau_transposed_along(node.x, impulses_.col(j), out.impulse_along);
      space_.coadjoint(node.carried, lobatto_carried_[at(j)]);
    }
    centre_carried_.resize(d, d);
    ends_along_.resize(d, d);
    space_.coadjoint(centre_.adjoint.transpose() * p0_, centre_carried_);
    space_.dtau_transposed_along(-y_, p0_ + middle_momentum_, ends_along_);
  }

  /// How the configuration at a node moves in the body as V_l does.
  Columns motion_of(const GroupNode& node, int l) const {
    return of_centre(l) * (node.adjoint_back * centre_.dtau) + node.alpha[l] * node.dtau;
  }

  template <class Matrix>
  void add_velocity_columns(int l, Matrix& matrix) {
    const Eigen::Index d = space_.group_dimension();
    Columns middle = of_centre(l) * (centre_carried_ * centre_.dtau);
    std::vector<Columns> phi(at(s_)), momentum(at(s_)), impulse(at(s_));
    Columns row_derivative(m_, d);
    for (int i = 0; i < s_; ++i) {
      const GroupNode& node = gauss_[at(i)];
      const NodeDerivatives& of = derivatives_[at(i)];
      const Columns motion = motion_of(node, l);
      Columns rate = node.alpha[l] * of.along;
      if (i == l) rate += node.dtau;
      const Columns dp = of.of.momentum_g * motion + of.of.momentum_xi * rate;
      const Columns df = of.of.force_g * motion + of.of.force_xi * rate;
      momentum[at(i)] = node.alpha[l] * of.momentum_along + node.dtau.transpose() * dp;
      phi[at(i)] = node.alpha[l] * (of.hessian + of.force_along) + of.along.transpose() * dp +
                   node.dtau.transpose() * df;
      if (i == l) phi[at(i)] += of.momentum_along.transpose();
      middle += step_.size * table_.b[i] *
                (node.adjoint_back.transpose() * df - node.alpha[l] * (of.carried * node.dtau_back));
      if (!has_nonholonomic()) continue;
      gauss_rows_[at(i)].derivative(node.t, node.q, xi_.col(i), row_derivative);
      add_row_columns(i, l, row_derivative * motion + gauss_rows_[at(i)].forms() * rate, false, matrix);
    }
    for (int j = 0; m_ > 0 && j < s_; ++j) {
      const GroupNode& node = lobatto_[at(j)];
      const NodeDerivatives& of = derivatives_[at(j)];
      const Columns moved = j == 0 ? Columns::Zero(d, d) : Columns(of.impulse * motion_of(node, l));
      impulse[at(j)] = node.alpha[l] * of.impulse_along + node.dtau.transpose() * moved;
      middle += table_.lobatto_b[j] * (node.adjoint_back.transpose() * moved -
                                       node.alpha[l] * (lobatto_carried_[at(j)] * node.dtau_back));
      if (!has_holonomic()) continue;
      const GroupNode& end = lobatto_[at(j) + 1];
      rows_[at(s_)].evaluate(end.t, end.q);
      add_row_columns(j, l, rows_[at(s_)].forms() * motion_of(end, l) / step_.size, true, matrix);
    }
    const Columns ends = 0.5 * centre_.dtau_back.transpose() * middle - 0.5 * of_centre(l) * ends_along_;
    for (int k = 0; k < s_; ++k) {
      Columns row = momentum[at(k)] - ends;
      for (int i = 0; i < s_; ++i) row += gauss_weight(i, k) * phi[at(i)];
      for (int j = 0; m_ > 0 && j < s_; ++j) row += lobatto_weight(j, k) * impulse[at(j)];
      matrix.block(n_ * k, n_ * l, n_, n_) = row(space_.tangent(), space_.tangent());
    }
  }

  /// The rows of the constraint of stage k, those that are holonomic or the others.
  template <class Matrix>
  void add_row_columns(int k, int l, const Columns& values, bool of_holonomic, Matrix& matrix) {
    for (int r = 0; r < m_; ++r)
      if (holonomic(r) == of_holonomic)
        matrix.block(n_ * s_ + m_ * k + r, n_ * l, 1, n_) = values.row(r)(space_.tangent());
  }

  template <class Matrix>
  void add_multiplier_columns(int j, Matrix& matrix) {
    const GroupNode& node = lobatto_[at(j)];
    const Columns forms = rows_[at(j)].forms().transpose();
    const Columns here = node.dtau.transpose() * forms;
    const Columns ends =
        0.5 * table_.lobatto_b[j] * centre_.dtau_back.transpose() * (node.adjoint_back.transpose() * forms);
    for (int k = 0; k < s_; ++k) {
      const Columns row = lobatto_weight(j, k) * here - ends;
      matrix.block(n_ * k, n_ * s_ + m_ * j, n_, m_) = row(space_.tangent(), Eigen::all);
    }
  }

  /// Of momenta, impulses and what they lose to the round-off of configurations; a velocity of size |q|/h
  /// loses ε|q|/h to it.
  void set_scales() {
    const double h = std::abs(step_.size), q = max_norm(q0_);
    blocks_[0].scale = scale_of(std::max(max_norm(p0_), momentum_size_) + h * (force_size_ + curvature_ * q) +
                                impulse_size_);
    const double speed = has_holonomic() ? std::max(velocity_size_, q / h) : velocity_size_ + q;
    if (m_ > 0) blocks_[1].scale = scale_of(form_size_ * speed);
  }

  const Scene& scene_;
  const Space& space_;
  int s_, n_, m_;
  GaussLobattoTableau table_;
  bool reduced_;
  GroupRows rows_at_start_;
  std::vector<GroupNode> gauss_, lobatto_;
  std::vector<GroupPoint> points_;
  std::vector<GroupRows> rows_, gauss_rows_;
  SparsityPattern pattern_;
  std::array<ResidualBlock, 2> blocks_;
  Interval step_{};
  Vector q0_, p0_, g_c_, y_, last_x_, middle_momentum_;
  Centre centre_;
  Columns v_, xi_, phi_, forces_, impulses_;
  std::vector<NodeDerivatives> derivatives_;
  std::vector<Columns> lobatto_carried_;
  Columns centre_carried_, ends_along_;
  double force_size_ = 0.0, curvature_ = 0.0, impulse_size_ = 0.0;
  double momentum_size_ = 0.0, velocity_size_ = 0.0, form_size_ = 0.0;
  std::string failure_;
  bool evaluated_ = false;  ///< at last_x_
  bool inside_ = true;      ///< of what the retraction is injective on, there
};

}  // namespace

bool reduced_on_group(const Scene& scene) {
  return scene.lagrangian->structure().x_absent && !scene.force &&
         std::ranges::all_of(scene.constraints,
                             [](const auto& rows) { return rows->constant() && !rows->holonomic(); });
}

std::unique_ptr<StepProblem> group_step(int s, const Scene& scene) {
  return std::make_unique<GroupStep>(s, scene);
}

}  // namespace diracstep
