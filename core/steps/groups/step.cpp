#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/groups/jacobian.hpp>
#include <diracstep/core/steps/groups/stages.hpp>
#include <diracstep/core/steps/groups/step.hpp>
#include <span>
#include <string>

namespace diracstep {

namespace {

template <int D>
class GroupStep final : public StepProblem {
  using Column = typename GroupSizes<D>::Column;

 public:
  GroupStep(int s, const Scene& scene)
      : g_(s, scene),
        jacobian_(g_),
        pattern_(SparsityPattern::dense(size(), size())),
        blocks_{{{"momentum", s * g_.n}, {"constraint", s * g_.m}}} {}

  int size() const override { return g_.s * (g_.n + g_.m); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override {
    return std::span(blocks_).first(g_.m > 0 ? 2 : 1);
  }
  std::string failure() const override { return g_.failure; }

  StepTraits traits() const override {
    StepTraits traits{"stage velocities (" + std::to_string(g_.s * g_.n) + ")", g_.s * g_.n, 3, 0};
    if (g_.m > 0) traits.unknowns += ", multipliers (" + std::to_string(g_.s * g_.m) + ")";
    traits.unknowns += " on " + g_.space.name();
    if (g_.s == 1) return traits;
    traits.stages = {{g_.n, lagrange_basis(g_.table.c, g_.table.c.array() + 1.0).transpose()}};
    const Vector lobatto_c = g_.table.lobatto_c.head(g_.s);
    if (g_.m > 0)
      traits.stages.push_back({g_.m, lagrange_basis(lobatto_c, lobatto_c.array() + 1.0).transpose()});
    return traits;
  }

  void begin(Interval step, const State& start, const StepMemory& memory) override {
    g_.force_size = memory.known ? memory.scales[0] : 0.0;
    curvature_ = memory.known ? memory.scales[1] : 0.0;
    g_.impulse_size = memory.known ? memory.scales[2] : 0.0;
    g_.begin(step, start);
    set_scales();
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    for (int i = 0; i < g_.s; ++i) x.segment(g_.n * i, g_.n) = v0;
    x.tail(g_.m * g_.s).setZero();
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    if (!g_.evaluate(x)) {
      f.setConstant(std::nan(""));
      return;
    }
    set_scales();
    const Column ends = 0.5 * g_.centre.dtau_back.transpose() * (g_.p0 + g_.middle_momentum);
    for (int k = 0; k < g_.s; ++k) {
      Column row = g_.gauss[at(k)].dtau.transpose() * g_.points[at(k)].momentum() - ends;
      for (int i = 0; i < g_.s; ++i) row += g_.gauss_weight(i, k) * g_.phi.col(i);
      for (int j = 0; g_.m > 0 && j < g_.s; ++j)
        row += g_.lobatto_weight(j, k) * (g_.lobatto[at(j)].dtau.transpose() * g_.impulses.col(j));
      g_.space.restrict(row, f.segment(g_.n * k, g_.n));
    }
    for (int k = 0; g_.m > 0 && k < g_.s; ++k) constraint_rows(k, f.segment(g_.n * g_.s + g_.m * k, g_.m));
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    auto matrix = values.reshaped(size(), size());
    if (!g_.evaluate(x)) {
      matrix.setConstant(std::nan(""));
      return;
    }
    jacobian_.take(x, Eigen::Map<Columns>(values.data(), size(), size()));
    curvature_ = jacobian_.curvature();
    set_scales();
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    const bool inside = g_.evaluate(x);
    for (Vector* column : {&end.at.p, &end.at.v}) column->setConstant(g_.n, std::nan(""));
    end.at.q.setConstant(g_.space.storage_size(), std::nan(""));
    if (!inside) return;
    g_.space.move(g_.q0, g_.centre.x, g_.g_c);
    g_.space.move(g_.g_c, g_.centre.x, end.at.q);
    g_.space.restrict(g_.centre.adjoint.transpose() * g_.middle_momentum, end.at.p);
    g_.space.restrict(2.0 / g_.step.size * g_.centre.x, end.at.v);
    end.impulse = g_.table.lobatto_b[0] * x.segment(g_.n * g_.s, g_.m);
    end.memory.known = true;
    end.memory.scales.resize(3);
    end.memory.scales << max_norm(g_.forces), curvature_, g_.impulse_size;
    end.memory.multipliers.resize(0);
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  void constraint_rows(int k, VectorRef out) {
    const GroupRows<D>& inside = g_.gauss_rows[at(k)];
    const GroupNode<D>& node = g_.lobatto[at(k) + 1];
    const Vector rates = inside.forms() * g_.xi.col(k) + inside.offsets();
    Vector positions = Vector::Zero(g_.m);
    if (g_.has_holonomic()) g_.rows[at(k) + 1].positions(node.t, node.q, positions);
    for (int r = 0; r < g_.m; ++r) out[r] = g_.holonomic(r) ? positions[r] / g_.step.size : rates[r];
  }

  /// Of momenta, impulses and what they lose to the round-off of configurations; a velocity of size |q|/h
  /// loses ε|q|/h to it.
  void set_scales() {
    const double h = std::abs(g_.step.size), q = max_norm(g_.q0);
    blocks_[0].scale = scale_of(std::max(max_norm(g_.p0), g_.momentum_size) +
                                h * (g_.force_size + curvature_ * q) + g_.impulse_size);
    const double speed = g_.has_holonomic() ? std::max(g_.velocity_size, q / h) : g_.velocity_size + q;
    if (g_.m > 0) blocks_[1].scale = scale_of(g_.form_size * speed);
  }

  GroupStages<D> g_;
  GroupJacobian<D> jacobian_;
  SparsityPattern pattern_;
  std::array<ResidualBlock, 2> blocks_;
  double curvature_ = 0.0;
};

}  // namespace

std::unique_ptr<StepProblem> group_step(int s, const Scene& scene) {
  switch (scene.space->group_dimension()) {
    case 3:
      return std::make_unique<GroupStep<3>>(s, scene);
    case 6:
      return std::make_unique<GroupStep<6>>(s, scene);
    default:
      return std::make_unique<GroupStep<Eigen::Dynamic>>(s, scene);
  }
}

}  // namespace diracstep
