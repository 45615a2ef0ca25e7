#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <diracstep/command/files/trajectory_file.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>

/// libFuzzer's entry: a trajectory that a resumed run is to go on with.  The first eight bytes are the size
/// the checkpoint states, the rest is the file: it goes on behind a right header and no later than it ends,
/// or is refused with a message and left as it was.
namespace {

using namespace diracstep;

std::string contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return (std::ostringstream() << file.rdbuf()).str();
}

const std::string& scratch_file() {
  static const std::string path =
      (std::filesystem::temp_directory_path() / ("diracstep_fuzz_" + std::to_string(getpid()))).string();
  static const int removal = std::atexit([] { std::filesystem::remove(scratch_file()); });
  if (removal != 0) std::abort();
  return path;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto scene = make_scene("knife_edge").scene;
  std::int64_t stated = 0;
  if (size < sizeof stated) return 0;
  std::memcpy(&stated, data, sizeof stated);
  const std::string before(reinterpret_cast<const char*>(data) + sizeof stated, size - sizeof stated);
  std::ofstream(scratch_file(), std::ios::binary) << before;
  try {
    command::TrajectoryFile file(scratch_file(), *scene, {.lines = 1, .bytes = stated});
    file.close();
    if (contents(scratch_file()) != before.substr(0, static_cast<std::size_t>(stated))) std::abort();
  } catch (const Misuse& refused) {
    if (*refused.what() == '\0' || contents(scratch_file()) != before) std::abort();
  }
  return 0;
}
