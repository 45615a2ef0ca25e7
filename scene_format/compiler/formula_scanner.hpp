#pragma once

#include <diracstep/scene_format/compiler/scene_error.hpp>
#include <string>
#include <string_view>

namespace diracstep::scene_compiler {

/// A formula as it stands in a file.
struct FormulaText {
  std::string text;
  Place start = {};  ///< of its first character

  Place place(std::size_t offset) const;
};

/// Walks through the text of a formula: numbers, words and signs, with spaces between them.
class FormulaScanner {
 public:
  FormulaScanner(const std::string& file, const FormulaText& text) : file_(file), text_(text) {}

  /// Offset of what comes next, and a step back to an earlier one.
  std::size_t at() const { return at_; }
  void back_to(std::size_t offset) { at_ = offset; }
  Place place(std::size_t offset) const { return text_.place(offset); }

  /// The next character that is no space; '\0' at the end.
  char peek();
  bool follows(std::string_view token);
  /// Steps over it if it follows.
  bool take(char c);
  bool take(std::string_view token);
  void expect(char c, const std::string& what);
  void expect_end();
  bool number_follows();
  double number();
  /// Letters, digits and underscores, not beginning with a digit; may be empty.
  std::string word();

  /// What comes next, for a message.
  std::string found();
  /// Throws SceneError at this offset.
  [[noreturn]] void fail(std::size_t offset, const std::string& message) const;
  [[noreturn]] void fail_expecting(const std::string& what);

 private:
  void skip_spaces();

  const std::string& file_;
  const FormulaText& text_;
  std::size_t at_ = 0;
};

/// A letter or underscore, then letters, digits and underscores; at most 64.
bool is_name(std::string_view name);
bool starts_name(char c);

}  // namespace diracstep::scene_compiler
