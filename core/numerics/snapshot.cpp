#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/snapshot.hpp>
#include <sstream>

namespace diracstep {

void Snapshot::require(std::size_t count) const {
  if (numbers_.size() - next_ >= count) return;
  throw Misuse("the snapshot ends after " + std::to_string(numbers_.size()) + " numbers; at least " +
               std::to_string(next_ + count) + " are needed: it is of another scene, method or version");
}

double Snapshot::number() {
  require(1);
  return numbers_[next_++];
}

long Snapshot::whole_number(long most) {
  const double value = number();
  if (value >= 0.0 && value <= static_cast<double>(most) && value == std::floor(value))
    return static_cast<long>(value);
  std::ostringstream message;
  message << "number " << next_ << " of the snapshot is " << value << "; a whole number from 0 to " << most
          << " is needed: it is of another scene, method or version";
  throw Misuse(message.str());
}

void Snapshot::read(VectorRef numbers) {
  const auto count = static_cast<std::size_t>(numbers.size());
  require(count);
  numbers = Vector::Map(numbers_.data() + next_, numbers.size());
  next_ += count;
}

}  // namespace diracstep
