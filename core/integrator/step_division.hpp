#pragma once

#include <diracstep/core/integrator/kink_passed.hpp>
#include <diracstep/core/integrator/step_sequence.hpp>
#include <diracstep/core/integrator/time_kinks.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Solves a step in parts that meet where a function of the scene jumps or has a kink, so that a method keeps
/// its order there: at known times (TimeKinks), and where the motion crosses a kink in q or v (Scene::kinks),
/// as of contacts, clipped forces, dry friction on the way.
///
/// A step at whose end a switching function has another sign than at its start is solved again, shorter,
/// until it ends a round-off of the time behind the zero, by a secant method on its size; the rest follows.
/// The zero is come to from the near side, since a step with nodes behind a jump has another zero or no
/// solution.  Of a method with a node at the end of its steps, which would take the functions of the far side
/// there for all of a part, the part ends a round-off before the zero, and one of that size leads across.  A
/// pair of zeros within a step shows in no sign at its end: it is looked for at three places
/// along a parabola through the ends, whose curvature is that of the mean velocities of this and the last
/// step, and along the one that the force at its start alone would lead on; so pairs that are narrow beside a
/// step, and flat ones, are not seen.  What lies between two kinks of one step, as a contact that is shorter,
/// is divided until twice as many parts end the step at the same place, and unresolved() says what that
/// leaves: its parts do not become shorter with the step.  So is the way to the first kink, or from the last
/// one, where two halves of it are further from it than those of the other are, as in a contact that has
/// begun before the step or lasts beyond it: to ten times what that other way leaves, by methods of order 3
/// and more.  Where the motion crosses one kink again and again, as at a force that jumps and points back
/// from both sides, the step is solved undivided, and stuck() says so.
///
/// What is done depends on the step and its start alone; what is said of a step that fails before a kink also
/// on the one solved before.
class StepDivision {
 public:
  /// The reader and the sequence outlive the division.
  StepDivision(std::shared_ptr<const Scene> scene, double usual_step, bool node_at_end, PointReader& reader,
               StepSequence& sequence);

  /// From now on a step ends behind the first kink that the motion crosses within it.
  void end_at_kinks() { end_at_kinks_ = true; }
  /// From now on no acceleration at the start of a step tells of kinks ahead: steps of damping methods may be
  /// far longer than the times of stiff forces.
  void take_no_acceleration() { takes_acceleration_ = false; }
  /// From now on the ways to the first kink of a step and from the last one are divided, too.  Steps of a low
  /// order have errors on all of their ways.
  void divide_ways() { divides_ways_ = true; }

  /// Afterwards sequence.end() is where the step ends; no trace of it is left before it is accepted.
  StepSequence::Outcome solve(Interval step, const State& start, Guess guess, Work& work);

  /// A step that solve() could not take, each of its parts in `more` pieces.
  StepSequence::Outcome solve_finer(int more, const State& start, Work& work);

  /// Of the step solved last.
  const std::vector<Interval>& parts() const { return parts_; }
  bool divided() const { return divided_; }
  const std::vector<KinkPassed>& passed() const { return passed_; }
  /// Whether it ended at a kink.
  bool cut_short() const { return end_at_kinks_ && !passed_.empty(); }
  /// Empty, or why it is not divided although the motion crosses a kink, or fails before one.
  const std::string& stuck() const { return stuck_; }
  /// How far its ends by the two finest divisions between its kinks are apart, relative to q and p; 0 where
  /// that is round-off.
  double unresolved() const { return unresolved_; }

  /// The centres of the pulses and ramps of the time in a step.
  void add_pulses(Interval step, std::vector<double>& times) { times_.add_pulses(step, times); }

 private:
  /// A part that ends before the zero of a function, with the value there, and the size that the zero is
  /// taken to be at.
  struct Approach {
    double size, value, zero;
  };

  void read(double t, const State& at, bool exactly, Vector& switches);
  void read_start(const Interval& step, const State& from, bool exactly);
  bool crosses(Interval step, const State& start, const State& end);
  double place_ahead(Interval step, const State& start);
  void find_acceleration(Interval step, const State& start);
  double failed_place(Interval step, const State& start);
  double hidden_place(Interval step, const State& start, const State& end);
  int first_change() const;
  int ahead(const Vector& here) const;
  bool solve_part(Interval part, const State& from, Guess guess, Work& work);
  void keep(const Interval& part, State& from);
  double error_of(const Interval& part, const State& from, Work& work);
  bool find_ends(const State& start, Work& work);
  bool resolve_gaps(const State& start, Work& work);
  bool follow_in(std::size_t parts, const State& start, Work& work);
  double within_gap(double left) const;
  bool follow(const State& start, Work& work);
  bool approach(int number, const Interval& part, const State& from, double within, Approach& to, Work& work);
  bool shorten_before(int number, Interval& part, const State& from, Work& work);
  bool cross(int number, Interval& across, const State& from, Work& work);
  bool shorten(int number, Interval& part, const State& from, Work& work);
  bool give_up(int number, double t);

  std::shared_ptr<const Scene> scene_;
  PointReader* reader_;
  StepSequence* sequence_;
  const Kinks* kinks_;  ///< null where no motion crosses any
  bool node_at_end_, end_at_kinks_ = false;
  TimeKinks times_;
  std::vector<Interval> parts_, undivided_, pieces_;
  std::vector<KinkPassed> passed_;
  std::string stuck_;
  bool divided_ = false;
  std::vector<double> gaps_;  ///< lengths of what is divided, to each kink; 0 where that is not
  std::size_t parts_of_gap_ = 1;
  bool divides_head_ = false, divides_tail_ = false;  ///< the ways to the first kink and from the last one
  double allowed_ = 0.0;                              ///< of unresolved()
  bool takes_acceleration_ = true, divides_ways_ = false;
  double unresolved_ = 0.0;
  SolveReport last_, solved_;  ///< of the part solved last, and of all that were kept
  double to_zero_ = 0.0;       ///< from the end of the part solved last, without sign
  Vector changes_;             ///< of the kinks within the part solved last, for what stuck() says
  Vector start_velocity_;      ///< of the part
  Vector acceleration_;        ///< there, from the forces at the start
  Vector before_, after_, between_, velocity_, speed_, speed_up_, position_;
  Vector force_, momentum_;
};

}  // namespace diracstep
