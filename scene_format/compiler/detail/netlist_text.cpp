#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <diracstep/scene_format/compiler/detail/netlist_text.hpp>
#include <map>
#include <string_view>

namespace diracstep::scene_compiler {

namespace {

bool is_space(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }

/// What a letter behind a number multiplies it with; 1 for units.
const char* power_of_suffix(const std::string& suffix) {
  if (suffix.starts_with("meg")) return "e6";
  if (suffix.starts_with("mil")) return nullptr;
  static const std::map<char, const char*> powers{{'t', "e12"}, {'g', "e9"},  {'k', "e3"},   {'m', "e-3"},
                                                  {'u', "e-6"}, {'n', "e-9"}, {'p', "e-12"}, {'f', "e-15"}};
  const auto found = powers.find(suffix.empty() ? ' ' : suffix[0]);
  return found == powers.end() ? "" : found->second;
}

/// The length of a number at `at`, without suffix; 0 where there is none.
std::size_t number_length(const std::string& text, std::size_t at) {
  std::size_t i = at, digits = 0;
  for (; i < text.size() && (in_number(text[i]) || text[i] == '.'); ++i) digits += in_number(text[i]) ? 1 : 0;
  if (digits == 0) return 0;
  if (i < text.size() && (text[i] == 'e' || text[i] == 'E')) {
    std::size_t j = i + 1;
    if (j < text.size() && (text[j] == '+' || text[j] == '-')) ++j;
    if (j < text.size() && in_number(text[j])) {
      while (j < text.size() && in_number(text[j])) ++j;
      return j - at;
    }
  }
  return i - at;
}

}  // namespace

bool in_word(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }
bool in_number(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }
std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string upper(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

void NetlistText::fail(Place place, const std::string& message) const {
  throw SceneError(file_, place, message);
}

void NetlistText::split() {
  int number = 0;
  std::size_t begin = 0;
  bool ended = false, commands = false;
  while (begin <= text_.size() && !ended) {
    const std::size_t end = std::min(text_.find('\n', begin), text_.size());
    const std::string line = text_.substr(begin, end - begin);
    begin = end + 1;
    ++number;
    if (number == 1) {
      title_ = line;
      continue;
    }
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '*') continue;
    const bool continued = line[first] == '+';
    Words words = words_of(line, continued ? first + 1 : first, number);
    if (words.empty()) continue;
    const std::string begins = lower(words[0].text);
    if (begins == ".endc") {
      commands = false;
      continue;
    }
    if (commands) continue;
    commands = begins == ".control";
    if (continued && lines_.empty()) fail(words[0].place, "there is no line that this one could continue");
    if (continued) {
      lines_.back().insert(lines_.back().end(), words.begin(), words.end());
      continue;
    }
    ended = begins == ".end";
    if (!ended) lines_.push_back(std::move(words));
  }
}

/// Blanks, commas and parentheses part words; '=' is one of its own.
Words NetlistText::words_of(const std::string& line, std::size_t from, int number) const {
  Words words;
  for (std::size_t i = from; i < line.size();) {
    const char c = line[i];
    const Place place{number, static_cast<int>(i) + 1};
    if (c == ';' || (c == '$' && (i == from || is_space(line[i - 1])))) break;
    if (is_space(c) || c == ',' || c == '(' || c == ')') {
      ++i;
    } else if (c == '=') {
      words.push_back({"=", place});
      ++i;
    } else if (c == '{' || c == '\'') {
      const std::size_t end = line.find(c == '{' ? '}' : '\'', i + 1);
      if (end == std::string::npos) fail(place, "an expression that does not end on its line");
      words.push_back({line.substr(i + 1, end - i - 1), {number, place.column + 1}, true});
      i = end + 1;
    } else {
      std::size_t end = i;
      while (end < line.size() && !is_space(line[end]) &&
             std::string_view(",()={};'").find(line[end]) == std::string_view::npos)
        ++end;
      words.push_back({line.substr(i, end - i), place});
      i = end;
    }
  }
  return words;
}

/// Numbers with suffixes as plain ones, names in small letters.
std::string NetlistText::formula_text(const Word& word) const {
  const std::string text = lower(word.text);
  std::string formula;
  for (std::size_t i = 0; i < text.size();) {
    if (in_word(text[i]) || text[i] == '_') {
      const std::size_t begin = i;
      while (i < text.size() && (in_word(text[i]) || in_number(text[i]) || text[i] == '_')) ++i;
      formula += text.substr(begin, i - begin);
      continue;
    }
    const std::size_t length = number_length(text, i);
    if (length == 0) {
      formula += text[i++];
      continue;
    }
    const std::string mantissa = text.substr(i, length);
    i += length;
    const std::size_t begin = i;
    while (i < text.size() && in_word(text[i])) ++i;
    const char* power = power_of_suffix(text.substr(begin, i - begin));
    if (power == nullptr) fail(word.place, fmt::format("'{}': mil is not supported", word.text));
    const bool plain = *power == '\0' || mantissa.find('e') == std::string::npos;
    formula += plain ? mantissa + power : fmt::format("({}*1{})", mantissa, power);
  }
  return formula;
}

bool NetlistText::is_number(const Word& word) {
  const bool sign = word.text[0] == '-' || word.text[0] == '+';
  const std::size_t begin = sign ? 1 : 0, length = number_length(word.text, begin);
  return !word.expression && length > 0 &&
         std::all_of(word.text.begin() + static_cast<std::ptrdiff_t>(begin + length), word.text.end(),
                     in_word);
}

/// A number or an expression in braces.
FormulaText NetlistText::value(const Word& word) const {
  if (word.expression) return {formula_text(word), word.place};
  if (!is_number(word))
    fail(word.place, fmt::format("'{}': expected a number such as 4.7k, or an expression in braces such as "
                                 "{{2*rl}}",
                                 word.text));
  return {formula_text(word), word.place};
}

double NetlistText::number(const Word& word) const {
  const FormulaText text = value(word);
  const char* begin = text.text.c_str();
  char* end = nullptr;
  const double result = std::strtod(begin, &end);
  if (*end != '\0' || !std::isfinite(result))
    fail(word.place, fmt::format("'{}': a plain number is needed here", word.text));
  return result;
}

const Word& NetlistText::word(const Words& line, std::size_t k, const char* what) const {
  if (k >= line.size()) fail(line[0].place, fmt::format("'{}' needs {}", line[0].text, what));
  return line[k];
}

void NetlistText::require_end(const Words& line, std::size_t k) const {
  if (k < line.size())
    fail(line[k].place, fmt::format("'{}' is not known here, in the line of {}", line[k].text, line[0].text));
}

std::string NetlistText::line_text(int number) const {
  std::size_t begin = 0;
  for (int k = 1; k < number; ++k) begin = text_.find('\n', begin) + 1;
  return text_.substr(begin, text_.find('\n', begin) - begin);
}

std::string NetlistText::node(const Word& word) const {
  const std::string name = lower(word.text);
  if (word.expression || word.text == "=") fail(word.place, "expected the name of a node");
  const bool plain = std::ranges::all_of(name, [](char c) { return in_word(c) || in_number(c) || c == '_'; });
  if (!plain) fail(word.place, fmt::format("'{}' is no node: expected letters, digits and _", word.text));
  return name == "gnd" || name == "ground" ? "0" : name;
}

}  // namespace diracstep::scene_compiler
