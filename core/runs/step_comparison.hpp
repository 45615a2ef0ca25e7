#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/rest_sizes.hpp>
#include <string>

namespace diracstep {

/// Compares steps with two parts of them: how far apart their ends are, in positions, velocities and momenta,
/// measured by the longest way that such a step went so far.  The parts are unequal, 0.382 and 0.618 of the
/// step: where it spans whole turns of a motion, halves of it see the same phase twice and end where it does.
///
/// Positions are doubted above a quarter of  max h |v|∞ : methods of order 1 stay below at h times the rate
/// of the motion of 1, the others at more.  A step out of rest, in which the velocity grows to more than its
/// own size, is measured by the longest way of the whole run: under a force that grows as a power of the time
/// its parts differ from it by the same part of its own way whatever its size.  Velocities and momenta, whose
/// way may be short at a turning point, are measured by the longest way of the whole run, and doubted above a
/// half of it.
///
/// Steps and parts of them at kinks that the motion crosses are added up apart: a force behind one may be far
/// stiffer than all that the other steps see.
///
/// A step of order 3 and above that differs from its parts by a hundredth of the whole motion, of the way
/// from the first point compared and the largest momentum, is doubted too: no resolved motion has such steps,
/// and in a run that is soon slow, as after a start under drag, it may be the only one.
class StepComparison {
 public:
  static constexpr double first_part = 0.382;
  /// Runs of at most so many steps and coordinates and rows are repeated with finer steps where something
  /// speaks against them.
  static constexpr long most_repeated = 2000;
  static constexpr int most_unknowns_repeated = 12;
  /// By which the ends of both may differ, in parts of the motion, to first order.
  static constexpr double largest_error(int order) { return order > 2 ? 1e-3 : order == 2 ? 1e-2 : 0.1; }

  /// Of a step: where it is looked at for no reason, at a kink, or where the motion turned fast.
  enum class Place { usual, at_kink, fast };

  /// The scene, one with a Lagrangian, must outlive this.  Without `velocities` positions and momenta count
  /// alone: for steps by their local error, where the velocity of what stores nothing, as the voltage of a
  /// diode beside a tight transformer, is read from momenta whose round-off it amplifies.
  explicit StepComparison(const Scene& scene, int order = 1, bool velocities = true)
      : rest_(scene), order_(order), velocities_(velocities) {}

  /// A step of size h from `start`, where it led, and where its parts did.  q, v and p are read.
  void add(const Sample& start, double h, const Sample& whole, const Sample& parts,
           Place place = Place::usual);
  /// What steps and parts of them at kinks differ by, in parts of the motion, added up; 0 where the worst of
  /// them is no worse than ten times the usual ones.
  double sum_at_kinks() const;

  /// Empty, or a line that names the worst step so far.
  std::string text() const;
  /// Whether all that moved is round-off of positions and of forces in balance.
  bool at_rest_throughout() const { return longest_way_ <= rounding_; }
  /// The largest difference of positions so far; NaN before the first.
  double worst() const;
  /// The largest difference of positions so far, in parts of the way of the motion, or of momenta in parts of
  /// the largest.
  double part_of_motion() const;

 private:
  struct Differences {
    double largest = 0.0, way = 0.0, size = 0.0, time = 0.0;
    void add(const Vector& start, const Vector& whole, const Vector& parts, double t);
    bool doubted() const;
  };

  RestSizes rest_;
  double longest_way_ = 0.0, worst_ = std::numeric_limits<double>::quiet_NaN(), worst_time_ = 0.0;
  double out_of_rest_ = 0.0, out_of_rest_time_ = 0.0, rounding_ = 0.0;  ///< a difference; of positions
  Differences velocity_, momentum_, position_;
  int order_;
  bool velocities_;
  Vector first_;  ///< position
  double extent_ = 0.0;
  struct Worst {
    double position = 0.0, momentum = 0.0;
  };
  Worst usual_, at_kinks_, sum_at_kinks_;
  long steps_ = 0;
};

/// Tells the steps behind those in which the velocity changed by more than twice as much as ever before: the
/// motion came to something new, or runs away.
class VelocityChanges {
 public:
  /// A first step that does not start from rest is told too.
  explicit VelocityChanges(Vector start);

  /// After each step.
  void see(ConstVectorRef velocity);
  bool fast() const { return fast_; }

 private:
  Vector velocity_;
  double largest_ = 0.0;
  bool fast_;
};

}  // namespace diracstep
