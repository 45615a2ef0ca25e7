#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/rest_sizes.hpp>
#include <optional>
#include <vector>

namespace diracstep {

/// The times on the way to `end` near which the scene's functions jump or change fast, as its formulas show
/// (Kinks::instants), in the order of the motion; none where they are more than 200.  Steps by their local
/// error end there: both the whole and its halves could pass a pulse by, and behind a jump a small step is
/// tried first.
std::vector<double> instants_on_the_way(const Scene& scene, double end);

/// Whether something may happen behind a while without any local error: L depends on the time, or the force
/// or the rows at the start do at 32 times between it and `end`, or formulas have kinks in q and v.
bool may_change_later(const Scene& scene, double end);

/// The size of ordinary variable steps, by their local error: for methods of the damping family, which are
/// not reversible at any size.
///
/// A step of size h is taken whole and in two halves; the halves count.  Their difference e, in q and p, is
/// to stay below eps:
///
///   max_i |e_i| / s_i ≤ eps,   s_i = max(|y_i| so far, 1e-6 T |ẏ_i|, 1e-10 of the largest s, 4e-16/eps of
///   it)
///
/// for positions and momenta apart, T being the time to the end.  The largest s is no less than what the
/// forces at the start would do in the step, were they not balanced (RestSizes): at rest all else is
/// round-off of it.  The difference is about 2^p − 1 times the error of the halves of a method of order p.
/// The next step is 0.9 eps/|e| to the power 1/(p + 1) times as long, at most ten times; a step that is
/// refused shrinks by the power 1/(s + 1) of its s stages, which is how its error falls where it is stiff
/// (Hairer, Wanner, Solving Ordinary Differential Equations II, IV.8), at most to a tenth.
///
/// A step ends behind the first kink in q and v that the motion crosses, the halves where the whole does:
/// each side is judged by its own error, and a first step is taken behind it.
///
/// Where e falls no faster than the size and becomes another one for a size that differs by a thousandth, it
/// is round-off, as that of the charge of 100 µF beside junctions of 1 pF before anything has charged it, or
/// of what moves with a velocity that is round-off: a hundred times as much is then allowed of that
/// component.
class LocalErrorControl {
 public:
  /// `span` is T; steps below `smallest` are accepted, with 0 none are.
  LocalErrorControl(double eps, int order, double span, double smallest);

  /// The motion begins at this point.
  void start(const Integrator& at);

  /// A first step, without sign, when nothing is known of the motion, or after a jump.
  double first_size() const { return first_part * span_; }

  /// Takes one step of `fine` beside one of `whole`, of the size given or, where that has too large an error
  /// or fails, or crosses a kink, a smaller one; `size` becomes the one taken, `next` the one to try next.
  /// Both integrators are to end steps at kinks.  Fails, with `fine` where it was, where the size would fall
  /// below the round-off of the time, and where many steps are stuck at a kink, which no size resolves.
  StepReport advance(Integrator& fine, Integrator& whole, double& size, double& next);

  /// Steps that had too large an error or failed.
  long refused() const { return refused_; }

 private:
  static constexpr double first_part = 1e-6;
  /// The sizes of q and p so far.
  struct Sizes {
    Vector q, p;
  };

  /// The component with the largest error in parts of what is allowed.
  struct Worst {
    double part = 0.0, difference = 0.0;
    Eigen::Index component = 0;  ///< of (q, p)
  };

  bool is_round_off(Integrator& fine, Integrator& whole, double start, double size, const Worst& worst);
  bool take_both(Integrator& fine, Integrator& whole, double& size, StepReport& report);
  Worst error(const Integrator& fine, const Integrator& whole, double size, bool by_forces);
  Worst error(const Integrator& fine, const Integrator& whole, double size);
  Vector differences(const Integrator& fine, const Integrator& whole) const;

  double eps_, span_, smallest_;
  int order_;
  long refused_ = 0;
  int stuck_ = 0;    ///< steps one after the other that crossed a kink undivided
  int sliding_ = 0;  ///< tiny steps one after the other that cross kinks
  bool crossed_ = false;
  Sizes seen_;
  Vector least_;  ///< of the sizes of (q, p), by round-off
  std::optional<RestSizes> rest_;
  Vector q_, p_, v_, sizes_;  ///< where the step starts; workspace
};

}  // namespace diracstep
