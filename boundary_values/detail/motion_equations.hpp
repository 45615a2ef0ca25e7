#pragma once

#include <diracstep/boundary_values/boundary_values.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/sensitivities/detail/stage_equations.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

namespace diracstep::boundary {

using sensitivity::Sparse;

/// What an unknown is: at an end of a step, or one of the step's own, or μ.
enum Kind { position_kind, momentum_kind, velocity_kind, unknown_kind, multiplier_kind, kinds };

/// Parameters of the scene that each step has its own values of.
struct StepParameters {
  std::shared_ptr<sensitivity::ExtendedScene> scene;  ///< with these as parameters
  Vector start;                                       ///< their values in the guess
  /// Called with a step of the size in the options and its values before anything of that step is computed.
  std::function<void(Interval step, ConstVectorRef values)> use;
};

/// All steps of a motion as one system.  Unknowns u, in the order of time:
///
///   v0, (q0, p0), x_0, (q1, p1), x_1, …, (qN, pN), vN, μ
///
/// without v0, vN and μ where L is linear in v.  Equations of the motion, fewer than unknowns by freedom(),
/// the numbers of a start:
///
///   ∂L/∂v(q0, v0) = p0;   F(x_k; z_k) = 0,  z_{k+1} = G(x_k; z_k);   ∂L/∂v(qN, vN) − Aᵀμ = pN,  A vN + b = 0
///
/// and those of the ends: A v0 + b = 0, φ(q0) = 0, the conditions.  The parameters of the steps, where they
/// have any, stand behind all of that.
class MotionEquations {
 public:
  MotionEquations(const Integrator& integrator, const Registry& registry, long steps,
                  BoundaryConditions conditions, std::optional<StepParameters> parameters = {});

  int unknowns() const { return unknowns_; }  ///< without the parameters of the steps
  int parameters_at(long step) const { return unknowns_ + static_cast<int>(step) * parameter_count(); }
  int parameter_count() const { return parameters_ ? static_cast<int>(parameters_->start.size()) : 0; }
  long steps() const { return static_cast<long>(step_ends_.size()) - 1; }
  int node_at(long k) const { return step_ends_[static_cast<std::size_t>(k)].second; }
  Interval step(long k) const;
  void use_parameters(long step, const Vector& u);
  int freedom() const { return n_ + nv_; }
  int start_rows() const { return m_ + m_h_; }  ///< equations of the ends before the conditions
  int n() const { return n_; }
  const Scene& scene() const { return *prepared_; }

  Vector guess(const GuessedMotion& path);
  struct Residual {
    Vector motion, ends;
  };
  Residual residual(const Vector& u);
  struct Jacobian {
    Sparse motion, ends;
  };
  Jacobian jacobian(const Vector& u);

  /// Derivatives of what is held in the linear system though it may not be: of q0 for the first n conditions,
  /// of qN for the last n, by multipliers of the holonomic rows.  Lines as the equations of the ends.
  Columns slack(const Vector& u);

  double duration() const { return end_time_ - start_time_; }
  const std::vector<Kind>& kind() const { return kind_; }

  /// Where q0 (n) and v0 stand among the unknowns, in this order; and qN, vN.
  std::vector<int> start_unknowns() const;
  std::vector<int> end_unknowns() const;

  struct Node {
    double t;
    Vector q, p;
  };
  /// The ends of the steps.
  std::vector<Node> nodes(const Vector& u) const;
  Vector start_velocity(const Vector& u) const { return u.head(nv_); }
  Vector end_velocity(const Vector& u) const { return u.segment(end_ + 2 * n_, nv_); }
  /// With v on the rows.
  Vector start_momentum(const Vector& u) const { return u.segment(nv_ + n_, n_); }
  Vector end_momentum(const Vector& u);
  /// Σ L_d, where the step states it.
  std::optional<double> action(const Vector& u);

 private:
  struct Stage {
    std::size_t part;
    Interval step;
    int node, x, next;  ///< where z_k, x_k and z_{k+1} stand
    int row;
    long number;  ///< of the step it is a part of
  };

  void place_stages(const Integrator& integrator, const Registry& registry, long steps);
  SolvedStage at(const Stage& stage, const Vector& u);
  sensitivity::StageEquations<Sparse>& equations(const Stage& stage) { return *parts_[stage.part]; }
  void add_by_start(const Stage& stage, int row, const Sparse& by_start, double factor,
                    sensitivity::BlockSum<Sparse>& to) const;
  Vector momentum(double t, const Vector& q, const Vector& v);
  Vector rows_residual(double t, const Vector& q, const Vector& v) const;
  Sparse holonomic(double t, const Vector& q);
  int end_rows_at() const { return unknowns_ - freedom() - (nv_ > 0 ? n_ + m_ : 0); }

  std::shared_ptr<const Scene> prepared_;
  std::shared_ptr<sensitivity::ExtendedScene> scene_;
  std::vector<std::unique_ptr<sensitivity::StageEquations<Sparse>>> parts_;
  BoundaryConditions conditions_;
  std::optional<StepParameters> parameters_;
  int n_, nv_, m_, m_h_ = 0;
  double start_time_, end_time_ = 0.0, step_size_;
  std::vector<Stage> stages_;
  std::vector<std::pair<double, int>> step_ends_;  ///< time, and where its node stands
  int end_ = 0, unknowns_ = 0;
  std::vector<Kind> kind_;
};

}  // namespace diracstep::boundary
