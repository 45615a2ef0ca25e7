#include <algorithm>
#include <cctype>
#include <diracstep/scene_format/fields/field_texts.hpp>

namespace diracstep::scene_compiler {

namespace {

bool begins_name(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_'; }

bool continues_name(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

/// The end of the number, name or sign that begins at `at`; 1e5 holds no name.
std::size_t token_end(std::string_view text, std::size_t at) {
  const bool number = std::isdigit(static_cast<unsigned char>(text[at])) != 0;
  std::size_t end = at + 1;
  if (!number && !begins_name(text[at])) return end;
  while (end < text.size() && (continues_name(text[end]) || (number && text[end] == '.'))) ++end;
  return end;
}

/// The position of the parenthesis that closes the one at `open`; npos where there is none.
std::size_t closing(std::string_view text, std::size_t open) {
  int depth = 0;
  for (std::size_t i = open; i < text.size(); ++i) {
    if (text[i] == '(') ++depth;
    if (text[i] == ')' && --depth == 0) return i;
  }
  return std::string_view::npos;
}

std::size_t after_spaces(std::string_view text, std::size_t at) {
  return std::min(text.find_first_not_of(" \t\r\n", at), text.size());
}

}  // namespace

void for_each_name(std::string_view formula,
                   const std::function<std::size_t(std::size_t, std::string_view)>& found) {
  for (std::size_t at = 0; at < formula.size();) {
    const std::size_t end = token_end(formula, at);
    at = begins_name(formula[at]) ? std::max(end, found(at, formula.substr(at, end - at))) : end;
  }
}

std::string with_names_replaced(std::string_view formula, const NameTexts& texts) {
  std::string result;
  std::size_t copied = 0;
  for_each_name(formula, [&](std::size_t at, std::string_view name) {
    const auto text = texts.find(name);
    const std::size_t end = at + name.size(), next = after_spaces(formula, end);
    if (text == texts.end() || (next < formula.size() && formula[next] == '[')) return end;
    result += std::string(formula.substr(copied, at - copied)) + text->second;
    return copied = end;
  });
  return result += formula.substr(copied);
}

bool mentions(std::string_view formula, const std::function<bool(std::string_view)>& name_is) {
  bool is = false;
  for_each_name(formula, [&](std::size_t, std::string_view name) {
    is = is || name_is(name);
    return std::size_t{0};
  });
  return is;
}

std::string with_integrals_replaced(std::string_view formula,
                                    const std::function<std::string(const std::string&)>& text_of) {
  std::string result;
  std::size_t copied = 0;
  for_each_name(formula, [&](std::size_t at, std::string_view name) {
    const std::size_t open = after_spaces(formula, at + name.size());
    if (name != "integral" || open >= formula.size() || formula[open] != '(') return std::size_t{0};
    const std::size_t close = closing(formula, open);
    if (close == std::string_view::npos) return std::size_t{0};
    result += std::string(formula.substr(copied, at - copied)) + '(' +
              text_of(std::string(formula.substr(open + 1, close - open - 1))) + ')';
    return copied = close + 1;
  });
  return result += formula.substr(copied);
}

}  // namespace diracstep::scene_compiler
