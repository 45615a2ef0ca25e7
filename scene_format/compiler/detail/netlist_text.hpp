#pragma once

#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

std::string lower(std::string text);
std::string upper(std::string text);
bool in_number(char c);
bool in_word(char c);

/// A word of a line: a name, a number or an expression in braces, with its place.
struct Word {
  std::string text;
  Place place;
  bool expression = false;
};

/// A line with those that continue it.
using Words = std::vector<Word>;

/// The lines of a netlist in the language of SPICE, taken apart.  Errors are SceneErrors at their place.
class NetlistText {
 public:
  /// Both outlive this.
  NetlistText(const std::string& file, const std::string& text) : file_(file), text_(text) { split(); }

  const std::string& file() const { return file_; }
  /// The first line.
  const std::string& title() const { return title_; }
  /// Those behind the title and up to .end, without comments and what stands
  /// between .control and .endc.
  const std::vector<Words>& lines() const { return lines_; }
  /// As it stands in the file.
  std::string line_text(int number) const;
  /// Blanks, commas and parentheses part words; '=' is one of its own.
  Words words_of(const std::string& line, std::size_t from, int number) const;

  /// A number or an expression in braces, with suffixes as powers of ten and names in small letters.
  FormulaText value(const Word& word) const;
  static bool is_number(const Word& word);
  double number(const Word& word) const;
  /// The name of a node, "0" for all names of the ground.
  std::string node(const Word& word) const;
  /// Word k of a line, which is to be there.
  const Word& word(const Words& line, std::size_t k, const char* what) const;
  /// Refuses what stands in a line from word k on.
  void require_end(const Words& line, std::size_t k) const;
  [[noreturn]] void fail(Place place, const std::string& message) const;

 private:
  void split();
  std::string formula_text(const Word& word) const;

  const std::string& file_;
  const std::string& text_;
  std::string title_;
  std::vector<Words> lines_;
};

}  // namespace diracstep::scene_compiler
