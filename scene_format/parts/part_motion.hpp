#pragma once

#include <diracstep/scene_format/parts/scene_part.hpp>
#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace diracstep {

/// What goes to another part and comes from it in one exchange.
struct PartMessage {
  int with;
  std::vector<double> out, in;  ///< `in` has the size of what is expected
};

/// Messages and bytes that a part has sent.
struct PartTraffic {
  long messages = 0, bytes = 0;
};

/// The motion of one part: q and p of its own coordinates, and q of others at its edges.
class PartMotion {
 public:
  explicit PartMotion(std::unique_ptr<ScenePart> part);

  const ScenePart& part() const { return *part_; }
  double time() const { return time_; }
  auto q() const { return q_.head(part_->own()); }
  Vector v() const;
  double kinetic_energy() const { return 0.5 * (part_->mass().array() * v().array().square()).sum(); }
  double energy() const { return part_->energy(time_, q_, v()); }
  const PartTraffic& traffic() const { return traffic_; }

  /// p ← p + h ∂L/∂q, at the q of the last look().
  void kick(double h);
  /// q ← q + h v, t ← t + h.
  void drift(double h);
  /// The messages with the values at the edges; their `in` is to be filled before take().
  std::vector<PartMessage>& messages();
  void take();
  /// ∂L/∂q at the current q.
  void look() { part_->force(time_, q_, force_); }

 private:
  std::unique_ptr<ScenePart> part_;
  double time_;
  Vector q_, p_, force_;
  std::vector<PartMessage> messages_;
  PartTraffic traffic_;
};

/// Fills `in` of the messages of these parts from `out` of the other ones.
using PartExchange = std::function<void(std::span<PartMotion>)>;

/// Between parts of one process.
void exchange_here(std::span<PartMotion> parts);

/// So many steps of type1/trapezoidal (Störmer, Verlet), composed to `order` (composition.hpp):
///
///   p½ = p + h/2 ∂L/∂q(q),   q1 = q + h M⁻¹(p½ − c),   p1 = p½ + h/2 ∂L/∂q(q1)
///
/// with one exchange a stage, of the values that the terms at the edges of parts share.  `goes_on` is asked
/// after each step.  Throws Misuse for an order there is no composition of.
void run_parts(std::span<PartMotion> parts, const PartExchange& exchange, int order, double step, long steps,
               const std::function<bool(long step)>& goes_on);

}  // namespace diracstep
