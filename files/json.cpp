#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/files/json.hpp>
#include <diracstep/files/utf8.hpp>
#include <iterator>

namespace diracstep {

namespace {

std::string number(double value) {
  if (!std::isfinite(value)) return "null";
  std::string text = fmt::format("{}", value);  // the shortest that reads back as the same
  if (text.find_first_not_of("-0123456789") == text.npos) text += ".0";
  return text;
}

/// As it stands inside the quotes.
void write_escaped(std::string& text, std::string_view rest) {
  while (!rest.empty()) {
    const CodePoint c = first_code_point(rest);
    if (c.bytes == 0)
      text += "\uFFFD";
    else if (c.value == '"' || c.value == '\\')
      (text += '\\') += rest.front();
    else if (c.value == '\n')
      text += "\\n";
    else if (c.value == '\t')
      text += "\\t";
    else if (c.value < 0x20)
      fmt::format_to(std::back_inserter(text), "\\u{:04x}", c.value);
    else
      text += rest.substr(0, c.bytes);
    rest.remove_prefix(std::max<std::size_t>(c.bytes, 1));
  }
}

void write_quoted(std::string& text, std::string_view content) {
  text += '"';
  write_escaped(text, content);
  text += '"';
}

void begin_line(std::string& text, int indent, int depth) {
  if (indent < 0) return;
  text += '\n';
  text.append(static_cast<std::size_t>(indent) * static_cast<std::size_t>(depth), ' ');
}

}  // namespace

Json::Json(std::initializer_list<Json> list) : value_(Array(list)) {
  const auto is_member = [](const Json& entry) {
    const Array* const pair = std::get_if<Array>(&entry.value_);
    return pair != nullptr && pair->size() == 2 && std::holds_alternative<std::string>(pair->front().value_);
  };
  if (!std::ranges::all_of(list, is_member)) return;
  Object members;
  for (const Json& entry : list) {
    const Array& pair = std::get<Array>(entry.value_);
    members.emplace_back(std::get<std::string>(pair[0].value_), pair[1]);
  }
  value_ = std::move(members);
}

Json Json::array(std::initializer_list<Json> list) {
  Json json;
  json.value_ = Array(list);
  return json;
}

Json Json::object() {
  Json json;
  json.value_ = Object();
  return json;
}

Json& Json::operator[](std::string_view name) {
  if (std::holds_alternative<std::nullptr_t>(value_)) value_ = Object();
  Object& members = std::get<Object>(value_);
  const auto found = std::ranges::find(members, name, &std::pair<std::string, Json>::first);
  if (found != members.end()) return found->second;
  return members.emplace_back(name, nullptr).second;
}

void Json::add(std::string name, Json value) {
  if (std::holds_alternative<std::nullptr_t>(value_)) value_ = Object();
  std::get<Object>(value_).emplace_back(std::move(name), std::move(value));
}

void Json::push_back(Json value) {
  if (std::holds_alternative<std::nullptr_t>(value_)) value_ = Array();
  std::get<Array>(value_).push_back(std::move(value));
}

bool Json::empty() const {
  if (const Array* const array = std::get_if<Array>(&value_)) return array->empty();
  if (const Object* const object = std::get_if<Object>(&value_)) return object->empty();
  return std::holds_alternative<std::nullptr_t>(value_);
}

std::string Json::dump(int indent) const {
  std::string text;
  write(text, indent, 0);
  return text;
}

void Json::write(std::string& text, int indent, int depth) const {
  const auto all = [&](char open, char close, const auto& members, const auto& write_member) {
    text += open;
    for (std::size_t i = 0; i < members.size(); ++i) {
      if (i > 0) text += ',';
      begin_line(text, indent, depth + 1);
      write_member(members[i]);
    }
    if (!members.empty()) begin_line(text, indent, depth);
    text += close;
  };
  if (const bool* const truth = std::get_if<bool>(&value_)) {
    text += *truth ? "true" : "false";
  } else if (const long long* const integer = std::get_if<long long>(&value_)) {
    text += std::to_string(*integer);
  } else if (const double* const real = std::get_if<double>(&value_)) {
    text += number(*real);
  } else if (const std::string* const content = std::get_if<std::string>(&value_)) {
    write_quoted(text, *content);
  } else if (const Array* const array = std::get_if<Array>(&value_)) {
    all('[', ']', *array, [&](const Json& member) { member.write(text, indent, depth + 1); });
  } else if (const Object* const object = std::get_if<Object>(&value_)) {
    all('{', '}', *object, [&](const auto& member) {
      write_quoted(text, member.first);
      text += indent < 0 ? ":" : ": ";
      member.second.write(text, indent, depth + 1);
    });
  } else {
    text += "null";
  }
}

}  // namespace diracstep
