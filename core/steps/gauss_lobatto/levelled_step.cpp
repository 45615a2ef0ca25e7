#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/levelled_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <limits>

namespace diracstep {

namespace {

class LevelledStep final : public StepProblem {
 public:
  LevelledStep(int s, const Scene& scene, const FirstOrderMotions& motions)
      : scene_(scene),
        equations_(scene_, motions),
        s_(s),
        n_(scene.dimension()),
        m_(scene.rows()),
        states_(equations_.states()),
        constraints_(equations_.constraint_count()),
        table_(gauss_lobatto_tableau(s)),
        pattern_(SparsityPattern::dense(size(), size())) {
    blocks_.push_back({"rate", states_ * s_});
    blocks_.push_back({"projection", states_});
    if (constraints_ > 0) blocks_.push_back({"constraint", constraints_});
  }

  int size() const override { return states_ * (s_ + 1) + constraints_; }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }
  StepTraits traits() const override {
    StepTraits traits{"rates of positions and momenta at the stages (" + std::to_string(s_ * states_) +
                          "), projection (" + std::to_string(states_ + constraints_) + ")",
                      s_ * states_, 1, equations_.unknowns()};
    if (s_ == 1) return traits;  // one stage is no polynomial
    traits.stages.push_back({states_, lagrange_basis(table_.c, table_.c.array() + 1.0).transpose()});
    traits.stages.push_back({states_ + constraints_, Columns::Ones(1, 1)});
    return traits;
  }

  void begin(Interval step, const State& start, const StepMemory& memory) override {
    step_ = step;
    z0_ = equations_.state(start.q, start.p);
    evaluated_ = false;
    solved_start_ =
        memory.known && equations_.resume(step.start, z0_, memory.multipliers, memory.scales[0], at_start_);
    if (!solved_start_) solved_start_ = equations_.begin(step.start, z0_, start.v, at_start_);
    nodes_.resize(static_cast<std::size_t>(s_) + 1);
    for (ResidualBlock& block : blocks_) block.scale = smallest_scale;
    if (!solved_start_) at_start_.constraints_by_state.setZero(constraints_, states_);
    if (!solved_start_) return;
    equations_.differentiate(step.start, z0_, at_start_);
    for (Node& of : nodes_) of.at = at_start_;
    const double size = std::max(max_norm(z0_), max_norm(at_start_.constraints)) / std::abs(step_.size);
    blocks_[0].scale = scale_of(max_norm(at_start_.rate) * equations_.loss());
    blocks_[1].scale = scale_of(size);
    known_ = blocks_;
  }

  std::string failure() const override {
    return solved_start_
               ? ""
               : "the equations of motion and their time derivatives have no solution near the start";
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    x.setZero();
    for (int i = 0; i < s_; ++i) {
      if (solved_start_) x.segment(states_ * i, states_) = at_start_.rate;
      x.segment(states_ * i, n_) = v0;
    }
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    for (int i = 0; i < s_; ++i)
      f.segment(states_ * i, states_) = x.segment(states_ * i, states_) - node(i).at.rate;
    f.segment(shift_place(), states_) =
        (x.segment(shift_place(), states_) -
         node(s_).at.constraints_by_state.transpose() * x.tail(constraints_)) /
        step_.size;
    f.tail(constraints_) = node(s_).at.constraints / step_.size;
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    auto j = values.reshaped(size(), size());
    j.setZero();
    const Eigen::Index projection = shift_place() + states_;
    for (int i = 0; i <= s_; ++i) {
      Node& of = node(i);
      equations_.differentiate(node_time(i), of.z, of.at);
      const Columns by_z =
          i < s_ ? Columns(-of.at.rate_by_state) : Columns(of.at.constraints_by_state / step_.size);
      auto rows = i < s_ ? j.middleRows(states_ * i, states_) : j.bottomRows(constraints_);
      for (int k = 0; k < s_; ++k) rows.middleCols(states_ * k, states_) = step_.size * weight(i, k) * by_z;
      rows.middleCols(projection, constraints_) = by_z * at_start_.constraints_by_state.transpose();
      if (i == s_) rows.middleCols(shift_place(), states_) = by_z;
      if (i < s_) j.block(states_ * i, states_ * i, states_, states_).diagonal().array() += 1.0;
    }
    j.block(shift_place(), shift_place(), states_, states_).diagonal().setConstant(1.0 / step_.size);
    j.block(shift_place(), projection, states_, constraints_) =
        -node(s_).at.constraints_by_state.transpose() / step_.size;
  }

  void finish(ConstVectorRef x, StepEnd& done) override {
    evaluate(x);
    const Node& end = node(s_);
    done.at.q = end.z.head(n_);
    done.at.v = (done.at.q - z0_.head(n_)) / step_.size;
    Vector lq(n_);
    done.at.p.resize(n_);
    scene_.lagrangian->gradient(step_.end(), done.at.q, end.at.w.head(n_), lq, done.at.p);
    done.impulse = m_ > 0 ? Vector(step_.size * table_.b[0] * node(0).at.w.segment(n_, m_)) : Vector();
    done.memory.known = true;
    done.memory.scales = Vector::Constant(1, equations_.reach());
    done.memory.multipliers = end.at.w;
  }

 private:
  struct Node {
    Vector z;
    LevelledPoint at;
  };

  int shift_place() const { return states_ * s_; }
  double node_time(int i) const { return i < s_ ? step_.start + table_.c[i] * step_.size : step_.end(); }
  Node& node(int i) { return nodes_[static_cast<std::size_t>(i)]; }
  double weight(int i, int k) const { return i < s_ ? table_.a(i, k) : table_.b[k]; }

  void evaluate(ConstVectorRef x) {
    if (evaluated_ && last_x_ == x) return;
    evaluated_ = true;
    last_x_ = x;
    const Vector base = z0_ + at_start_.constraints_by_state.transpose() * x.tail(constraints_);
    double rate = 0.0;
    for (int i = 0; i <= s_; ++i) {
      Node& of = node(i);
      of.z = base;
      if (i == s_) of.z += x.segment(shift_place(), states_);
      for (int k = 0; k < s_; ++k) of.z += step_.size * weight(i, k) * x.segment(states_ * k, states_);
      if (!solved_start_ || !equations_.solve(node_time(i), of.z, of.at)) {
        of.at = at_start_;  // a guess for the next one
        of.at.rate.setConstant(states_, std::numeric_limits<double>::quiet_NaN());
        of.at.constraints.setConstant(constraints_, std::numeric_limits<double>::quiet_NaN());
        of.at.rate_by_state.setZero(states_, states_);
        of.at.constraints_by_state.setZero(constraints_, states_);
        continue;
      }
      rate =
          std::max({rate, max_norm(of.at.rate), max_norm(x.segment(states_ * std::min(i, s_ - 1), states_))});
      if (i < s_) continue;
      set_scales(rate);
      if (max_norm(x.tail(constraints_)) > 0.0)
        equations_.differentiate(node_time(i), of.z, of.at);
      else
        of.at.constraints_by_state.setZero(constraints_, states_);  // asked for by jacobian() alone
    }
  }

  /// Of the terms at x, beside those at the start.
  void set_scales(double rate) {
    const double size = std::max(max_norm(z0_), equations_.constraint_terms()) / std::abs(step_.size);
    blocks_[0].scale = std::max(known_[0].scale, scale_of(rate * equations_.loss()));
    if (constraints_ > 0) blocks_.back().scale = std::max(known_.back().scale, scale_of(size));
  }

  Scene scene_;
  LevelledEquations equations_;
  int s_, n_, m_, states_, constraints_;
  GaussLobattoTableau table_;
  SparsityPattern pattern_;
  std::vector<ResidualBlock> blocks_, known_;
  Interval step_{0.0, 1.0};
  Vector z0_, last_x_;
  LevelledPoint at_start_;
  std::vector<Node> nodes_;
  bool evaluated_ = false, solved_start_ = false;
};

}  // namespace

std::unique_ptr<StepProblem> levelled_step(int s, const Scene& scene, const FirstOrderMotions& motions) {
  require_determined(scene, motions);
  return std::make_unique<LevelledStep>(s, scene, motions);
}

}  // namespace diracstep
