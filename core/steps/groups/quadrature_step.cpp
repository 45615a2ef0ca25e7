#include <array>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/steps/groups/point.hpp>
#include <diracstep/core/steps/groups/quadrature_step.hpp>
#include <span>
#include <string>

namespace diracstep {

namespace {

/// The weights of the two ends.
std::array<double, 2> end_weights(const StepRule& rule) {
  std::array<double, 2> weights{};
  for (const StepNode& node : rule.nodes()) {
    if (node.c != 0.0 && node.c != 1.0)
      throw Misuse("a step by the " + name(rule) +
                   " rule on a group: its nodes are the ends of a step alone");
    weights[node.c == 0.0 ? 0 : 1] += node.weight;
  }
  return weights;
}

class GroupQuadratureStep final : public StepProblem {
 public:
  GroupQuadratureStep(const StepRule& rule, const Scene& scene)
      : weights_(end_weights(rule)),
        space_(*scene.space),
        n_(scene.dimension()),
        m_(scene.rows()),
        first_(scene),
        last_(scene),
        first_rows_(scene),
        last_rows_(scene),
        pattern_(SparsityPattern::dense(n_ + m_, n_ + m_)),
        blocks_{{{"momentum", n_}, {"constraint", m_}}} {}

  int size() const override { return n_ + m_; }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return std::span(blocks_).first(m_ > 0 ? 2 : 1); }
  std::string failure() const override { return failure_; }

  StepTraits traits() const override {
    StepTraits traits{"velocity (" + std::to_string(n_) + ")", n_, 2, 0};
    if (m_ > 0) traits.unknowns += ", multipliers (" + std::to_string(m_) + ")";
    traits.unknowns += " on " + space_.name();
    return traits;
  }

  void begin(Interval step, const State& start, const StepMemory& memory) override {
    if (step.start != step_.start) failure_.clear();
    step_ = step;
    q0_ = start.q;
    p0_.resize(space_.group_dimension());
    space_.embed(start.p, p0_);
    v_.setZero(space_.group_dimension());  // what a step before has left would scale the rows
    force_size_ = memory.known ? memory.scales[0] : 0.0;
    impulse_size_ = memory.known ? memory.scales[1] : 0.0;
    if (m_ > 0) first_rows_.evaluate(step.start, q0_);
    evaluated_ = false;
    set_scales();
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    x.head(n_) = v0;
    x.tail(m_).setZero();
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    if (!evaluate(x)) {
      f.setConstant(std::nan(""));
      return;
    }
    space_.restrict(momentum_ - back_.transpose() * carried_, f.head(n_));
    if (m_ == 0) return;
    Vector positions(m_);
    last_rows_.positions(step_.end(), q1_, positions);
    const Vector rates = weights_[0] * (first_rows_.forms() * v_ + first_rows_.offsets()) +
                         weights_[1] * (last_rows_.forms() * v_ + last_rows_.offsets());
    for (int r = 0; r < m_; ++r) f[n_ + r] = holonomic(r) ? positions[r] / step_.size : rates[r];
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    auto matrix = values.reshaped(size(), size());
    if (!evaluate(x)) {
      matrix.setConstant(std::nan(""));
      return;
    }
    const double h = step_.size;
    const Eigen::Index d = space_.group_dimension();
    GroupPoint<Eigen::Dynamic>::Derivatives at;
    Columns momentum(d, d);
    space_.dtau_transposed_along(-h * v_, carried_, momentum);
    momentum *= h;
    const Columns moved = h * dtau_;
    if (weights_[0] != 0.0) {
      first_.derivatives(at);
      momentum += weights_[0] * (at.momentum_xi - h * back_.transpose() * at.force_xi);
    }
    if (weights_[1] != 0.0) {
      last_.derivatives(at);
      momentum += weights_[1] * (at.momentum_xi + at.momentum_g * moved);
    }
    matrix.topLeftCorner(n_, n_) = momentum(space_.tangent(), space_.tangent());
    if (m_ == 0) return;
    const Columns impulse = back_.transpose() * first_rows_.forms().transpose();
    matrix.topRightCorner(n_, m_) = -impulse(space_.tangent(), Eigen::all);
    matrix.bottomRightCorner(m_, m_).setZero();
    Columns turned(m_, d);
    last_rows_.derivative(step_.end(), q1_, v_, turned);
    const Columns rates =
                      weights_[0] * first_rows_.forms() + weights_[1] * (last_rows_.forms() + turned * moved),
                  positions = last_rows_.forms() * dtau_;
    for (int r = 0; r < m_; ++r)
      matrix.block(n_ + r, 0, 1, n_) = (holonomic(r) ? positions : rates).row(r)(space_.tangent());
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    if (!evaluate(x)) {
      end.at.q.setConstant(space_.storage_size(), std::nan(""));
      end.at.p.setConstant(n_, std::nan(""));
      end.at.v.setConstant(n_, std::nan(""));
      return;
    }
    end.at.q = q1_;
    end.at.p.resize(n_);
    space_.restrict(adjoint_.transpose() * carried_ + end_impulse_, end.at.p);
    end.at.v = x.head(n_);
    end.impulse = x.tail(m_);
    end.memory.known = true;
    end.memory.scales.resize(2);
    end.memory.scales << force_size_, impulse_size_;
    end.memory.multipliers.resize(0);
  }

 private:
  bool holonomic(int r) const { return first_rows_.holonomic()[static_cast<std::size_t>(r)]; }

  /// False where the step leaves what the retraction is injective on.
  bool evaluate(ConstVectorRef x) {
    if (evaluated_ && last_x_ == x) return inside_;
    evaluated_ = true;
    last_x_ = x;
    const double h = step_.size;
    const Eigen::Index d = space_.group_dimension();
    v_.resize(d);
    space_.embed(x.head(n_), v_);
    const double part = space_.part_of_chart(h * v_);
    inside_ = part < 1.0;
    q1_ = space_.moved(q0_, h * v_);
    if (!inside_) {
      failure_ = "a step turned by more than its retraction is injective on, by " + std::to_string(part) +
                 " of that; take a smaller one";
      return false;
    }
    for (Columns* matrix : {&adjoint_, &dtau_, &back_}) matrix->resize(d, d);
    Columns unused(d, d);
    space_.maps(h * v_, adjoint_, unused, dtau_, back_);
    momentum_.setZero(d);
    end_impulse_.setZero(d);
    carried_ = p0_;
    if (weights_[0] != 0.0) {
      first_.evaluate(step_.start, q0_, v_);
      momentum_ += weights_[0] * first_.momentum();
      carried_ += weights_[0] * h * first_.force();
      force_size_ = std::max(force_size_, max_norm(first_.force()));
    }
    if (weights_[1] != 0.0) {
      last_.evaluate(step_.end(), q1_, v_);
      momentum_ += weights_[1] * last_.momentum();
      end_impulse_ = weights_[1] * h * last_.force();
      force_size_ = std::max(force_size_, max_norm(last_.force()));
    }
    if (m_ > 0) {
      last_rows_.evaluate(step_.end(), q1_);
      const Vector impulse = first_rows_.impulse(x.tail(m_));
      carried_ += impulse;
      impulse_size_ = std::max(impulse_size_, max_norm(impulse));
    }
    set_scales();
    return true;
  }

  /// A velocity of size |q|/h loses ε|q|/h to round-off, and so does its momentum.
  void set_scales() {
    const double h = std::abs(step_.size), q = max_norm(q0_);
    blocks_[0].scale = scale_of(max_norm(p0_) + h * force_size_ + impulse_size_);
    if (m_ > 0) blocks_[1].scale = scale_of(max_norm(first_rows_.forms()) * (max_norm(v_) + q / h));
  }

  std::array<double, 2> weights_;  ///< of the two ends
  const Space& space_;
  int n_, m_;
  GroupPoint<Eigen::Dynamic> first_, last_;
  GroupRows<Eigen::Dynamic> first_rows_, last_rows_;
  SparsityPattern pattern_;
  std::array<ResidualBlock, 2> blocks_;
  Interval step_{};
  Vector q0_, p0_, q1_, v_, last_x_, carried_, momentum_, end_impulse_;
  Columns adjoint_, dtau_, back_;
  double force_size_ = 0.0, impulse_size_ = 0.0;
  std::string failure_;
  bool evaluated_ = false, inside_ = true;
};

}  // namespace

std::unique_ptr<StepProblem> group_quadrature_step(const StepRule& rule, const Scene& scene) {
  return std::make_unique<GroupQuadratureStep>(rule, scene);
}

}  // namespace diracstep
