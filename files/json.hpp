#pragma once

#include <concepts>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace diracstep {

/// A JSON document to be written: members of objects keep their order.  It is small where a library for
/// reading and writing is not: every source that builds one compiles in a fraction of the time.
class Json {
 public:
  Json() = default;  ///< null
  Json(std::nullptr_t) {}
  Json(bool value) : value_(value) {}
  Json(double value) : value_(value) {}
  template <std::integral Integer>
  requires(!std::same_as<Integer, bool>) Json(Integer value) : value_(static_cast<long long>(value)) {}
  Json(const char* text) : value_(std::string(text)) {}
  Json(std::string_view text) : value_(std::string(text)) {}
  Json(std::string text) : value_(std::move(text)) {}
  template <class T>
  Json(const std::vector<T>& values) : value_(Array()) {
    for (const T& value : values) push_back(value);
  }
  /// {{"name", value}, …} is an object, any other list an array.
  Json(std::initializer_list<Json> list);

  static Json array(std::initializer_list<Json> list = {});
  static Json object();

  /// The member of a name, added as null where there is none; null becomes an object.
  Json& operator[](std::string_view name);
  /// Adds a member without looking whether there is one of that name; null becomes an object.
  void add(std::string name, Json value);
  /// Adds to an array; null becomes one.
  void push_back(Json value);

  bool empty() const;  ///< null, or an array or object without members

  /// The text: in one line, or with each member on a line of its own, `indent` blanks further in.  A number
  /// that is not finite becomes null, and bytes that are no UTF-8 the replacement character.
  std::string dump(int indent = -1) const;

 private:
  using Array = std::vector<Json>;
  using Object = std::vector<std::pair<std::string, Json>>;

  void write(std::string& text, int indent, int depth) const;

  std::variant<std::nullptr_t, bool, long long, double, std::string, Array, Object> value_ = nullptr;
};

}  // namespace diracstep
