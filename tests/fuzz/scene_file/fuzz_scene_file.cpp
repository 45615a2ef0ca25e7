#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <string>

/// libFuzzer's entry: any bytes as a scene file either compile to kernels or are refused with a message.
///   clang++ -fsanitize=fuzzer,address …, see tests/fuzz/CMakeLists.txt
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const auto program = diracstep::scene_compiler::compile_scene("fuzz.toml", text);
    if (program->source.empty()) std::abort();
  } catch (const diracstep::Misuse& refused) {
    if (*refused.what() == '\0') std::abort();
  }
  return 0;
}
