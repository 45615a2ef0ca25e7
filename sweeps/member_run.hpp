#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/sweeps/recorded.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

/// The scene of a sweep with other parameters.
using SceneMaker = std::function<CatalogueScene(const Parameters& changes)>;

/// How one member ended.
struct MemberResult {
  enum class Status { ok, doubted, failed } status = Status::ok;
  std::string reason = {};           ///< of a doubt or a failure
  double time = 0.0;                 ///< that was reached
  std::vector<double> numbers = {};  ///< of recorded_names(); NaN after a failure
};

/// Runs members of a sweep, each in an integrator of its own, so that its bits depend on nothing else.
class MemberRuns {
 public:
  /// Chooses what the file leaves open, by the first member whose scene can be made: the method, the step,
  /// the end, what is recorded.  Throws Misuse where there is none among the first hundred, and for names
  /// that it has not.
  /// `goes_on`, where there is one, is asked within each run by all threads; where it is false the run ends,
  /// and its result is to be left.
  MemberRuns(const Sweep& sweep, SceneMaker make_scene, const Registry& registry, SolverFactory solvers,
             std::function<bool()> goes_on = {});

  /// The sweep with all that was left open filled in.
  const Sweep& sweep() const { return sweep_; }
  const CatalogueScene& example() const { return example_; }

  /// May be called by several threads at once.  What a member throws is its failure.
  MemberResult run(long number) const;

 private:
  Parameters parameters_of(long number) const;
  CatalogueScene scene_of(long number) const;
  MemberResult take(long number) const;
  MemberResult take_steps(long number, const CatalogueScene& entry) const;
  MemberResult run_with_derivatives(long number, const CatalogueScene& entry,
                                    const IntegratorOptions& options, long steps, Recorded& recorded) const;
  MemberResult run_without_events(const CatalogueScene& entry, const IntegratorOptions& options, long steps,
                                  Recorded& recorded) const;
  MemberResult run_by_local_error(const CatalogueScene& entry, const IntegratorOptions& options,
                                  Recorded& recorded) const;
  MemberResult run_through_events(const CatalogueScene& entry, const IntegratorOptions& options, long steps,
                                  Recorded& recorded) const;
  MemberResult search(const CatalogueScene& entry) const;
  bool goes_on() const { return !goes_on_ || goes_on_(); }
  void take_recommendation();
  void choose_method();

  Sweep sweep_;
  SceneMaker make_scene_;
  const Registry& registry_;
  SolverFactory solvers_;
  std::function<bool()> goes_on_;
  CatalogueScene example_;
  IntegratorOptions options_;
  bool step_given_ = false;
  double local_error_ = 0.0;  ///< of variable steps, where strong damping chose these and no step is given
};

}  // namespace diracstep
