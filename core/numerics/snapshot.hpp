#pragma once

#include <cstddef>
#include <diracstep/core/numerics/types.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace diracstep {

/// What an integrator needs to go on exactly as if it had never stopped: fields of numbers, each under a
/// name, in the order in which they were written.  See Integrator::save.
///
/// A field is read back under its name and with its size only (SnapshotReader), so that a snapshot of another
/// scene, method or version is refused with the name of the first field that does not fit.
class Snapshot {
 public:
  /// Changes with the names, sizes or meanings of the fields that this library writes.
  static constexpr int layout = 1;

  struct Field {
    std::string name;  ///< no line break in it
    std::size_t size;  ///< how many numbers; 0 for the title of a section
    bool operator==(const Field&) const = default;
  };

  void section(std::string_view title);
  void put(std::string_view name, double number);
  void put(std::string_view name, ConstVectorRef numbers);
  /// Each number as several doubles, the largest first.
  void put_extended(std::string_view name, const ExtendedVector& numbers);

  const std::vector<Field>& fields() const { return fields_; }
  /// Of all fields, one behind the other.
  const std::vector<double>& numbers() const { return numbers_; }
  std::vector<double>& numbers() { return numbers_; }

  /// As bytes: a line with the layout, a line for each field with its size and name, an empty line, and the
  /// numbers as they lie in memory.
  std::string bytes() const;
  /// Throws Misuse, saying what is wrong, for anything but what bytes() of this layout makes.
  static Snapshot from_bytes(std::string_view bytes);

 private:
  void add(std::string_view name, std::size_t size);

  std::vector<Field> fields_;
  std::vector<double> numbers_;
};

/// Reads the fields of a snapshot in their order.  Every function throws Misuse where the next field has
/// another name or size, or holds a number that is not allowed, and names it.
class SnapshotReader {
 public:
  /// The snapshot outlives the reader.
  explicit SnapshotReader(const Snapshot& from) : from_(from) {}

  void section(std::string_view title) { (void)take(title, 0); }
  double number(std::string_view name) { return *take(name, 1); }
  /// From 0 to `most`.
  long whole_number(std::string_view name, long most);
  bool flag(std::string_view name) { return whole_number(name, 1) == 1; }
  void read(std::string_view name, VectorRef numbers);
  void read_extended(std::string_view name, ExtendedVector& numbers);
  void require_end() const;

 private:
  const double* take(std::string_view name, std::size_t size);

  const Snapshot& from_;
  std::size_t field_ = 0, number_ = 0;
};

}  // namespace diracstep
