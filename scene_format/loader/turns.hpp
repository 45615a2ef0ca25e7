#pragma once

#include <diracstep/scene_format/compiler/evaluator.hpp>
#include <functional>
#include <string>
#include <vector>

namespace diracstep {

/// The turns of nested loops of a scene file, outermost first.  The program and the parameters must outlive
/// them.
class Turns {
 public:
  /// More turns than SizeLimits::repeated, empty inner loops counted as one, throw SceneError.
  /// `counting`: rows are counted by the turns of that many of the first loops.
  Turns(const scene_compiler::SceneProgram& program, const scene_compiler::ParameterValues& parameters,
        std::vector<int> loops, std::size_t counting);

  /// Calls `visit(row)` in each turn; `row` counts from 0.
  void run(const std::function<void(long)>& visit) { descend(0, visit); }

  /// Values of the loops in the current turn.
  const std::vector<long>& values() const { return values_; }
  /// Gives them to a formula.
  void set(scene_compiler::Evaluator& formula) const;
  /// ", at i = 3, j = 4", for a message; empty without loops.
  std::string text() const;

 private:
  [[noreturn]] void refuse() const;
  void descend(std::size_t depth, const std::function<void(long)>& visit);

  const scene_compiler::SceneProgram& program_;
  std::vector<int> loops_;
  std::size_t counting_;
  std::vector<long> values_;
  std::vector<scene_compiler::Evaluator> bounds_;
  long rows_ = 0, turns_ = 0, most_;
};

}  // namespace diracstep
