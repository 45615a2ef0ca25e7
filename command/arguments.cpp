#include <fmt/format.h>

#include <charconv>
#include <diracstep/command/arguments.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <system_error>

namespace diracstep::command {

namespace {

template <class Number>
Number parse(const std::string& what, const std::string& text, const char* allowed) {
  Number value{};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end)
    throw Misuse(fmt::format("{}: '{}' is not {}", what, text, allowed));
  return value;
}

template <class Number>
std::vector<Number> parse_list(const std::string& option, const std::string& list, const char* allowed) {
  std::vector<Number> values;
  for (const auto& text : names(option, list)) values.push_back(parse<Number>(option, text, allowed));
  return values;
}

}  // namespace

std::vector<std::string> names(const std::string& option, const std::string& list) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  for (int depth = 0; begin <= list.size();) {
    std::size_t end = begin;
    for (; end < list.size() && (depth > 0 || list[end] != ','); ++end)  // type2/legendre(a,b) is one name
      depth += (list[end] == '(') - (list[end] == ')');
    if (end == begin)
      throw Misuse(fmt::format("{}: '{}' has an empty entry; a list such as a,b,c is needed", option, list));
    parts.push_back(list.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

std::vector<double> numbers(const std::string& option, const std::string& list) {
  return parse_list<double>(option, list, "a number");
}

std::vector<int> whole_numbers(const std::string& option, const std::string& list) {
  return parse_list<int>(option, list, "a whole number");
}

Parameters parameters(const std::vector<std::string>& assignments, const std::string& option) {
  Parameters parsed;
  for (const auto& assignment : assignments) {
    const std::size_t sign = assignment.find('=');
    if (sign == std::string::npos || sign == 0)
      throw Misuse(fmt::format("{}: '{}' is not of the form name=value", option, assignment));
    const std::string name = assignment.substr(0, sign);
    parsed[name] = parse<double>(option + " " + name, assignment.substr(sign + 1), "a number");
  }
  return parsed;
}

Momentum momentum(const std::string& text) {
  if (text == "plus") return Momentum::plus;
  if (text == "minus") return Momentum::minus;
  if (text == "projected") return Momentum::projected;
  throw Misuse(fmt::format("--momentum: '{}' is not one of plus, minus, projected", text));
}

}  // namespace diracstep::command
