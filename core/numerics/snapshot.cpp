#include <charconv>
#include <cmath>
#include <cstring>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/snapshot.hpp>
#include <limits>
#include <optional>
#include <sstream>

namespace diracstep {

namespace {

constexpr std::string_view magic = "diracstep snapshot ";

/// So many doubles hold a long double: two with the 64 bits of x87, three with 113.
constexpr int doubles_of_extended = (std::numeric_limits<long double>::digits + 52) / 53;

[[noreturn]] void refuse(const std::string& why) {
  throw Misuse("the snapshot " + why + ": it is of another scene, method or version");
}

std::optional<std::size_t> whole(std::string_view text) {
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// The next line, taken off; none where there is no line break.
std::optional<std::string_view> take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end + 1);
  return line;
}

}  // namespace

void Snapshot::add(std::string_view name, std::size_t size) { fields_.push_back({std::string(name), size}); }

void Snapshot::section(std::string_view title) { add(title, 0); }

void Snapshot::put(std::string_view name, double number) {
  add(name, 1);
  numbers_.push_back(number);
}

void Snapshot::put(std::string_view name, ConstVectorRef numbers) {
  add(name, static_cast<std::size_t>(numbers.size()));
  numbers_.insert(numbers_.end(), numbers.begin(), numbers.end());
}

void Snapshot::put_extended(std::string_view name, const ExtendedVector& numbers) {
  add(name, static_cast<std::size_t>(numbers.size() * doubles_of_extended));
  for (long double rest : numbers)
    for (int k = 0; k < doubles_of_extended; ++k) {
      const auto leading = static_cast<double>(rest);
      numbers_.push_back(leading);
      rest -= leading;
    }
}

std::string Snapshot::bytes() const {
  std::string text = std::string(magic) + std::to_string(layout) + '\n';
  for (const Field& field : fields_) text += std::to_string(field.size) + ' ' + field.name + '\n';
  text += '\n';
  const std::size_t start = text.size();
  text.resize(start + numbers_.size() * sizeof(double));
  if (!numbers_.empty()) std::memcpy(text.data() + start, numbers_.data(), numbers_.size() * sizeof(double));
  return text;
}

Snapshot Snapshot::from_bytes(std::string_view bytes) {
  const auto first = take_line(bytes);
  if (!first || !first->starts_with(magic))
    throw Misuse("these bytes are no snapshot: their header is another");
  const std::string_view version = first->substr(magic.size());
  if (version != std::to_string(layout))
    throw Misuse("the snapshot has layout " + std::string(version) + "; this version reads layout " +
                 std::to_string(layout));
  Snapshot snapshot;
  std::size_t count = 0;
  for (auto line = take_line(bytes);; line = take_line(bytes)) {
    if (!line) throw Misuse("the snapshot is cut off among the names of its fields");
    if (line->empty()) break;
    const std::size_t space = line->find(' ');
    const auto size = whole(line->substr(0, space));
    if (space == std::string_view::npos || !size || *size > bytes.size() / sizeof(double))
      throw Misuse("the snapshot has no field as in its line '" + std::string(line->substr(0, 80)) + "'");
    snapshot.add(line->substr(space + 1), *size);
    count += *size;
  }
  if (bytes.size() % sizeof(double) != 0 || count != bytes.size() / sizeof(double))
    throw Misuse("the snapshot announces " + std::to_string(count) + " numbers, and " +
                 std::to_string(bytes.size()) + " bytes follow");
  snapshot.numbers_.resize(count);
  if (count > 0) std::memcpy(snapshot.numbers_.data(), bytes.data(), bytes.size());
  return snapshot;
}

const double* SnapshotReader::take(std::string_view name, std::size_t size) {
  const std::string wanted = "'" + std::string(name) + "'";
  if (field_ == from_.fields().size()) refuse("ends before " + wanted);
  const Snapshot::Field& field = from_.fields()[field_];
  if (field.name != name) refuse("has '" + field.name + "' where " + wanted + " is needed");
  if (field.size != size)
    refuse("has " + std::to_string(field.size) + " numbers for " + wanted + " where " + std::to_string(size) +
           " are needed");
  const double* const numbers = from_.numbers().data() + number_;
  ++field_;
  number_ += size;
  return numbers;
}

long SnapshotReader::whole_number(std::string_view name, long most) {
  const double value = number(name);
  if (value >= 0.0 && value <= static_cast<double>(most) && value == std::floor(value))
    return static_cast<long>(value);
  std::ostringstream why;
  why << "has " << value << " for '" << name << "' where a whole number from 0 to " << most << " is needed";
  refuse(why.str());
}

void SnapshotReader::read(std::string_view name, VectorRef numbers) {
  const double* const from = take(name, static_cast<std::size_t>(numbers.size()));
  numbers = Vector::Map(from, numbers.size());
}

void SnapshotReader::read_extended(std::string_view name, ExtendedVector& numbers) {
  const double* from = take(name, static_cast<std::size_t>(numbers.size() * doubles_of_extended));
  for (long double& entry : numbers) {
    entry = 0.0L;
    for (int k = 0; k < doubles_of_extended; ++k) entry += *from++;
  }
}

void SnapshotReader::require_end() const {
  if (field_ < from_.fields().size())
    refuse("goes on with '" + from_.fields()[field_].name + "' after the last field needed");
}

}  // namespace diracstep
