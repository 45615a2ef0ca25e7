#pragma once

#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <functional>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

/// Numbers of all parameters and sizes, in the order of the symbols.
using ParameterValues = std::vector<std::vector<double>>;

/// Computes formulas in extended precision, once for each setting of the loop variables and the time.
/// What depends on neither is computed once.
class Evaluator {
 public:
  /// The value of a coordinate leaf; without it formulas hold no coordinates.
  using Leaf = std::function<long double(const NodeData&)>;

  Evaluator(const SceneProgram& program, const ParameterValues& parameters, std::vector<Node> roots);

  void set_loop(int loop, long value) { loops_[static_cast<std::size_t>(loop)] = value; }
  void set_time(double t) { time_ = t; }
  void set_leaf(Leaf leaf) { leaf_ = std::move(leaf); }

  /// Computes all roots.  Throws SceneError where an array is read outside its range.
  void evaluate();
  long double value(std::size_t root) const { return values_[roots_[root]]; }
  /// A root that counts or points: throws SceneError unless it is a whole number of moderate size.
  long whole(std::size_t root) const;

  /// The first node whose value is not finite although its arguments are; none where all are finite.
  Node undefined() const;
  std::string arguments_of(Node node) const;

 private:
  long index(Node node) const;
  std::size_t at(Node node) const;

  const SceneProgram& program_;
  const ParameterValues& parameters_;
  std::vector<Node> nodes_;
  std::vector<std::size_t> changing_;  ///< places of the nodes that are not known once
  std::vector<std::size_t> roots_;
  std::vector<long double> values_;
  std::vector<long> loops_;
  double time_ = 0.0;
  Leaf leaf_;
  bool started_ = false;

  void compute(std::size_t place);
};

}  // namespace diracstep::scene_compiler
