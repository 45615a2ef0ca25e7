#pragma once

#include <diracstep/core/numerics/snapshot.hpp>
#include <diracstep/core/steps/step_problem.hpp>
#include <vector>

namespace diracstep {

/// Guesses the unknowns of the next step from those of the last ones.
///
/// Two families of rules: polynomials through the same unknown over the last steps, and, for steps with
/// stages, the polynomial through the stages of the last step plus what that missed in the steps before.
/// Which rule is best depends on the scene and the step; the predictor compares them with the solutions as
/// they are accepted and uses the best.
class Predictor {
 public:
  Predictor(StepTraits traits, int unknowns);

  void clear_history();
  /// Whether there is enough history to predict from.
  bool ready() const { return known_ >= 2; }
  void predict(VectorRef x);

  void accept_step(ConstVectorRef solution);
  /// Takes the solution accepted last out again, into x.  Once after each accept_step().
  void withdraw_step(VectorRef x);

  /// Whether a step was accepted at all, and the last solution.
  bool begun() const { return known_ > 0; }
  const Vector& last() const { return history_.front(); }

  void save(Snapshot& to) const;
  void restore(SnapshotReader& from);

 private:
  struct Rule {
    bool through_stages;  ///< which family
    std::size_t terms;    ///< how many past solutions it takes
  };

  void evaluate(const Rule& rule, VectorRef x);
  void extrapolate_stages(const Vector& last, VectorRef x) const;
  void combine_history(std::size_t first, std::size_t terms, const double* weights, VectorRef x,
                       Eigen::Index begin = 0) const;
  double error(const Rule& rule, ConstVectorRef solution);
  void elect(ConstVectorRef solution);

  StepTraits traits_;
  std::vector<Rule> rules_;
  std::vector<Vector> history_;  ///< newest first, and room for one more, to withdraw the newest
  std::size_t best_ = 0, known_ = 0;
  std::size_t best_before_ = 0, known_before_ = 0;  ///< the last step was accepted
  long accepted_ = 0;
  Vector candidate_, missed_;  ///< of rules through stages
};

}  // namespace diracstep
