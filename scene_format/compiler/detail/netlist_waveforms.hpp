#pragma once

#include <diracstep/scene_format/compiler/detail/netlist_text.hpp>

namespace diracstep::scene_compiler {

/// What an independent source drives as a function of t: "5", "dc 5", "{v}", "PULSE(…)", "SIN(…)",
/// "EXP(…)", "SFFM(…)", "PWL(…)"; a waveform counts where a value stands beside it, and AC is passed over.
class NetlistWaveforms {
 public:
  /// Both outlive this.  The document has the step and the end of .tran, and takes the points of PWL as
  /// inputs.
  NetlistWaveforms(const NetlistText& text, SceneDocument& document) : text_(text), document_(document) {}

  /// Words of a line from the fourth on, behind the name of the source and two nodes.  Throws SceneError.
  FormulaText waveform(const Words& line);

 private:
  void require_count(const Words& line, std::size_t count, std::size_t least, std::size_t most,
                     const char* form) const;
  static bool is_wave(const std::string& form);
  static bool is_value(const Word& word);
  FormulaText named(const std::string& form, const Words& line, const std::vector<Word>& words, Place place);
  std::string exponential(const Words& line, const std::vector<std::string>& v) const;
  std::string modulated(const Words& line, const std::vector<std::string>& v) const;
  std::string pulse(const Words& line, const std::vector<Word>& words,
                    const std::vector<std::string>& v) const;
  std::string sine(const Words& line, const std::vector<std::string>& v) const;
  FormulaText piecewise(const Words& line, const std::vector<Word>& words);
  double step() const { return document_.step; }
  double end() const { return document_.t_end; }

  const NetlistText& text_;
  SceneDocument& document_;
};

}  // namespace diracstep::scene_compiler
