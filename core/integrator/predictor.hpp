#pragma once

#include <diracstep/core/steps/step_problem.hpp>
#include <vector>

namespace diracstep {

/// Guesses the unknowns of the next step from those of the last ones.
///
/// Two families of rules: polynomials through the same unknown over the last steps, and, for steps with
/// stages, the polynomial through the stages of the last step plus what that missed in the steps before.
/// Which rule is best depends on the scene and the step; the predictor compares them with the solutions as
/// they come and uses the best.
class Predictor {
 public:
  explicit Predictor(StepProblem& problem);

  void reset() {
    known_ = best_ = 0;
    learned_ = 0;
  }
  /// Whether there is enough history to predict from.
  bool ready() const { return known_ >= 2; }
  void predict(VectorRef x);
  /// Takes in the solution of a step.
  void learn(ConstVectorRef solution);

  /// Whether a step was learned at all, and its solution.
  bool begun() const { return known_ > 0; }
  const Vector& last() const { return history_.front(); }

  void save(Snapshot& to) const;
  void restore(Snapshot& from);

 private:
  struct Rule {
    bool through_stages;  ///< which family
    std::size_t terms;    ///< how many past solutions it takes
  };

  void evaluate(const Rule& rule, VectorRef x);
  void combine_history(std::size_t first, std::size_t terms, const double* weights, VectorRef x,
                       Eigen::Index begin = 0) const;
  double error(const Rule& rule, ConstVectorRef solution);
  void elect(ConstVectorRef solution);

  StepProblem& problem_;
  std::vector<Rule> rules_;
  std::size_t best_ = 0;
  std::vector<Vector> history_;  ///< newest first
  std::size_t known_ = 0;
  long learned_ = 0;
  Vector candidate_, missed_;  ///< of rules through stages
};

}  // namespace diracstep
