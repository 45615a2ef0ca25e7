#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <diracstep/command/files/checkpoint_file.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <string>

/// libFuzzer's entry: any bytes, with their own check sum or a right one, are a checkpoint that encodes to
/// the same state, or are refused with a message.  Built as tests/fuzz/CMakeLists.txt says.
namespace {

void feed(const std::string& bytes) {
  try {
    const diracstep::Checkpoint checkpoint = diracstep::decoded(bytes, "fuzz");
    const diracstep::Checkpoint again = diracstep::decoded(diracstep::encoded(checkpoint), "again");
    if (again.points != checkpoint.points || again.bytes != checkpoint.bytes) std::abort();
    if (again.state.bytes() != checkpoint.state.bytes()) std::abort();
  } catch (const diracstep::Misuse& refused) {
    if (*refused.what() == '\0') std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string bytes(reinterpret_cast<const char*>(data), size);
  feed(bytes);
  const std::uint64_t sum = diracstep::check_sum(bytes);
  feed(bytes.append(reinterpret_cast<const char*>(&sum), sizeof sum));
  return 0;
}
