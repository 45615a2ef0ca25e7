#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Where the functions of a scene are not smooth or change fast, as far as its formulas show: the zeros of
/// switching functions g(t, q, v).
///
///   kink   g = a of |a| and sign(a), g = a − b of min(a, b) and max(a, b): a derivative of the scene's
///   functions
///          jumps where g changes sign
///   ramp   g = the argument of tanh or atan: smooth, but all of the change lies within |g| < 2 or so,
///   whatever
///          the units.  Harmless where g changes by less than about 1 in a step
///
/// Whoever accepts steps compares the signs of g at both ends of a step.  A g that depends on the time alone
/// needs no motion to be found: instants() lists its zeros, and with them the centres of pulses.
/// What the formulas do not show is not here: a pulse in q or v written with exp, x/sqrt(x²), a look-up table
/// of many sines.
class Kinks {
 public:
  enum class Kind { kink, ramp };

  /// A time near which the scene's functions change fast whatever the motion.
  struct Instant {
    double time;
    double width;  ///< time within which most of the change lies, in units of t; 0 for a kink
  };

  Kinks() = default;
  Kinks(const Kinks&) = delete;
  Kinks& operator=(const Kinks&) = delete;
  virtual ~Kinks() = default;

  /// Number of switching functions; 0 where the time alone switches.
  int count() const { return static_cast<int>(kinds_.size()); }
  const std::vector<Kind>& kinds() const { return kinds_; }
  /// What each is, for messages: "min(1, max(0, steep*(t - on)))" with its place in the file.
  const std::vector<std::string>& names() const { return names_; }

  /// g(t, q, v), count() values; NaN where a formula is not defined.  On a configuration space q are its
  /// stored numbers, and v is the velocity in the body.
  virtual void evaluate(double t, ConstVectorRef q, ConstVectorRef v, VectorRef g) const = 0;

  /// The instants between two times, ascending by time, each kind of change once.  Exact where the argument
  /// is affine in t; others are looked for at 4000 times and more as far as their phases demand, and pairs of
  /// zeros between these as SignChanges does: a pair can be missed where the argument is flat beside it.
  virtual std::vector<Instant> instants(double first, double last) const = 0;

 protected:
  Kinks(std::vector<Kind> kinds, std::vector<std::string> names)
      : kinds_(std::move(kinds)), names_(std::move(names)) {}

 private:
  std::vector<Kind> kinds_;
  std::vector<std::string> names_;
};

}  // namespace diracstep
