#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <diracstep/scene_format/compiler/formula_scanner.hpp>
#include <system_error>

namespace diracstep::scene_compiler {

namespace {

bool is_letter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool continues_character(char c) { return (static_cast<unsigned char>(c) & 0xC0u) == 0x80u; }  // UTF-8

std::size_t end_of_word(std::string_view text, std::size_t begin) {
  std::size_t end = begin;
  while (end < text.size() && (is_letter(text[end]) || (end > begin && is_digit(text[end])))) ++end;
  return end;
}

}  // namespace

bool starts_name(char c) { return is_letter(c); }

bool is_name(std::string_view name) {
  return !name.empty() && name.size() <= 64 && end_of_word(name, 0) == name.size();
}

Place FormulaText::place(std::size_t offset) const {
  Place place = start;
  for (std::size_t i = 0; i < std::min(offset, text.size()); ++i) {
    if (text[i] == '\n') {
      ++place.line;
      place.column = 1;
    } else if (!continues_character(text[i])) {
      ++place.column;
    }
  }
  return place;
}

void FormulaScanner::fail(std::size_t offset, const std::string& message) const {
  throw SceneError(file_, text_.place(offset), message);
}

void FormulaScanner::fail_expecting(const std::string& what) {
  const std::string instead = found();
  fail(at_, "expected " + what + ", found " + instead);
}

void FormulaScanner::skip_spaces() {
  while (at_ < text_.text.size() && std::isspace(static_cast<unsigned char>(text_.text[at_]))) ++at_;
}

char FormulaScanner::peek() {
  skip_spaces();
  return at_ < text_.text.size() ? text_.text[at_] : '\0';
}

bool FormulaScanner::follows(std::string_view token) {
  skip_spaces();
  return std::string_view(text_.text).substr(at_, token.size()) == token;
}

bool FormulaScanner::take(char c) {
  if (peek() != c) return false;
  ++at_;
  return true;
}

bool FormulaScanner::take(std::string_view token) {
  if (!follows(token)) return false;
  at_ += token.size();
  return true;
}

void FormulaScanner::expect(char c, const std::string& what) {
  if (!take(c)) fail_expecting(what);
}

void FormulaScanner::expect_end() {
  if (peek() != '\0' || at_ < text_.text.size()) fail_expecting("an operator or the end");
}

std::string FormulaScanner::found() {
  if (peek() == '\0') return "the end of the formula";
  std::size_t end = end_of_word(text_.text, at_);
  if (end == at_)
    for (++end; end < text_.text.size() && continues_character(text_.text[end]);) ++end;
  return fmt::format("'{}'", text_.text.substr(at_, std::min<std::size_t>(end - at_, 40)));
}

bool FormulaScanner::number_follows() {
  const char c = peek();
  return is_digit(c) || (c == '.' && at_ + 1 < text_.text.size() && is_digit(text_.text[at_ + 1]));
}

double FormulaScanner::number() {
  const char* const begin = text_.text.data() + at_;
  const char* end = text_.text.data() + text_.text.size();
  const std::size_t range = text_.text.find("..", at_);  // "1..N" is no number "1."
  if (range != std::string::npos) end = text_.text.data() + range;
  double value = 0.0;
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (error != std::errc() || !std::isfinite(value))
    fail(at_, "a number that cannot be read or is out of range");
  const std::size_t place = at_;
  at_ += static_cast<std::size_t>(stop - begin);
  if (at_ < text_.text.size() && is_letter(text_.text[at_]))
    fail(place, "a number directly followed by a name; write a '*' between them");
  return value;
}

std::string FormulaScanner::word() {
  skip_spaces();
  const std::size_t begin = at_;
  at_ = end_of_word(text_.text, begin);
  return text_.text.substr(begin, at_ - begin);
}

}  // namespace diracstep::scene_compiler
