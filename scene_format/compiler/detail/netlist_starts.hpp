#pragma once

#include <diracstep/scene_format/compiler/detail/netlist_text.hpp>
#include <map>

namespace diracstep::scene_compiler {

/// The voltages of nodes at the start, of `.ic` lines.
class NetlistStarts {
 public:
  /// The text outlives this.
  explicit NetlistStarts(const NetlistText& text) : text_(text) {}

  void read(const Words& line);
  /// Starts the capacitors at these nodes that have no start of their own; their other ends are at 0 V where
  /// nothing else is stated.  Throws SceneError for a node without a capacitor.
  void fill(SceneDocument& document) const;

 private:
  const NetlistText& text_;
  std::map<std::string, FormulaText> voltages_;
};

}  // namespace diracstep::scene_compiler
