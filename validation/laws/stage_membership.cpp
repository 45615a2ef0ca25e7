#include <algorithm>
#include <cmath>
#include <diracstep/core/dirac/dirac_structure.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/validation/laws/single_step.hpp>
#include <diracstep/validation/laws/stage_membership.hpp>

namespace diracstep {

namespace {

/// The stages of one solved step, and what follows from them.
class StageSpace {
 public:
  StageSpace(const Scene& scene, const Method& method)
      : scene_(scene),
        table_(gauss_lobatto_tableau(method.info.stages)),
        s_(method.info.stages),
        n_(scene.dimension()),
        m_(scene.rows()),
        function_(method.generating_function(scene)),
        rows_(scene.constraints, n_) {}

  /// From the unknowns (V_1 … V_s, λ_0 … λ_{s−1}) of a step from (q0,p0) to (q1,p1).
  double residual(Interval step, const Vector& x, const PhasePoint& start, const PhasePoint& end) {
    const Columns v = x.head(n_ * s_).reshaped(n_, s_), q = at(table_.a, step, start.q, v);
    const Columns impulses = impulses_at(step, x, at(table_.lobatto_a, step, start.q, v));
    const Vector p_hat = start.p + impulses.rowwise().sum();
    return std::max(graph_residual(step, v, impulses, {start.q, p_hat}, end),
                    row_residual(step, q, v, start.q));
  }

 private:
  static Columns at(const Columns& coefficients, Interval step, const Vector& q0, const Columns& v) {
    return ((step.size * v * coefficients.transpose()).colwise() + q0).eval();
  }

  Columns impulses_at(Interval step, const Vector& x, const Columns& lobatto_q) {
    Columns impulses = Columns::Zero(n_, s_);
    for (int j = 0; j < s_; ++j) {
      rows_.evaluate(step.start + table_.lobatto_c[j] * step.size, lobatto_q.col(j));
      Vector impulse = Vector::Zero(n_);
      rows_.add_annihilator(x.segment(n_ * s_ + m_ * j, m_), impulse);
      impulses.col(j) = table_.lobatto_b[j] * impulse;
    }
    return impulses;
  }

  double graph_residual(Interval step, const Columns& v, const Columns& impulses, const PhasePoint& start,
                        const PhasePoint& end) {
    const GraphOf graph = graph_of(function_->type());
    Columns y = Columns::Zero(n_, function_->columns()), g = y;
    y.col(0) = graph.starts_from_position ? start.q : start.p;
    y.col(1) = graph.ends_at_position ? end.q : end.p;
    y.middleCols(2, s_) = v;
    const bool first = function_->type() == GeneratingType::one;
    if (first) y.col(2 + s_) = end.p;
    function_->gradient(step, y, g);
    const Vector at_start = graph.starts_from_position ? start.p : start.q;
    const Vector at_end = graph.ends_at_position ? end.p : end.q;
    double largest = std::max(max_norm(graph.start_sign * g.col(0) - at_start),
                              max_norm(graph.end_sign * g.col(1) - at_end));
    const Columns work = (first ? -step.size : step.size) * impulses * table_.lobatto_a.topRows(s_);
    largest = std::max(largest, max_norm(g.middleCols(2, s_) - work));
    return first ? std::max(largest, max_norm(g.col(2 + s_))) : largest;
  }

  double row_residual(Interval step, const Columns& q, const Columns& v, const Vector& q0) const {
    const Columns lobatto_q = at(table_.lobatto_a, step, q0, v);
    double largest = 0.0;
    for (const auto& block : scene_.constraints)
      for (int j = 0; j < s_; ++j) {
        Vector a(block->pattern().nonzeros()), out(block->rows());
        if (block->holonomic()) {
          block->position(step.start + table_.lobatto_c[j + 1] * step.size, lobatto_q.col(j + 1), out);
        } else {
          const Vector stage = v.col(j);
          block->coefficients(step.start + table_.c[j] * step.size, q.col(j), a, out);
          block->pattern().multiply_add(a.data(), stage.data(), out.data());
        }
        largest = std::max(largest, max_norm(out));
      }
    return largest;
  }

  const Scene& scene_;
  GaussLobattoTableau table_;
  int s_, n_, m_;
  std::unique_ptr<GeneratingFunction> function_;
  ConstraintsAtPoint rows_;
};

}  // namespace

double stage_membership_residual(const Registry& registry, const std::shared_ptr<const Scene>& scene,
                                 const IntegratorOptions& options, long steps) {
  const Method method = registry.method(options.method);
  if (!method.info.rows_inside || scene->force)
    throw Misuse("membership in the stage space is for typeN/gl:S on scenes without forces");
  laws::SingleStep take(method, *scene);
  StageSpace space(*scene, method);
  PhasePoint start{scene->start.q, laws::start_momentum(*scene)};
  double largest = 0.0;
  for (long k = 0; k < steps; ++k) {
    const Interval step{scene->start.time + static_cast<double>(k) * options.step, options.step};
    const auto taken = take(step, start.q, start.p, scene->start.v);
    const PhasePoint end{taken.q1, taken.p1};
    if (!end.q.allFinite()) return std::nan("");
    largest = std::max(largest, space.residual(step, taken.unknowns, start, end));
    start = end;
  }
  return largest;
}

}  // namespace diracstep
