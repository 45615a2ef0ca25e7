#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <vector>

namespace diracstep {

/// What an integrator needs to go on exactly as if it had never stopped: plain numbers, written one after the
/// other and read back in the same order.  See Integrator::save.
class Snapshot {
 public:
  Snapshot() = default;
  explicit Snapshot(std::vector<double> numbers) : numbers_(std::move(numbers)) {}

  const std::vector<double>& numbers() const { return numbers_; }

  void put(double number) { numbers_.push_back(number); }
  void put(ConstVectorRef numbers) { numbers_.insert(numbers_.end(), numbers.begin(), numbers.end()); }

  /// Both throw Misuse where fewer numbers are left; `whole_number` also for one outside 0 … `most`.
  double number();
  long whole_number(long most);
  void read(VectorRef numbers);
  bool at_end() const { return next_ == numbers_.size(); }
  /// Reads from the first number again.
  void rewind() { next_ = 0; }

 private:
  void require(std::size_t count) const;

  std::vector<double> numbers_;
  std::size_t next_ = 0;
};

}  // namespace diracstep
