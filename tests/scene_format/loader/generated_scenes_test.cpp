#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <filesystem>
#include <optional>
#include <random>

#include "../../fuzz/scene_run/generated_scene.hpp"
#include "temporary_folder.hpp"

extern "C" int fuzz_scene_run(const std::uint8_t* data, std::size_t size);

/// Scenes made at random from the grammar, through the compiler and ten steps.
namespace diracstep::testing {
namespace {

std::string bytes(std::mt19937& random) {
  std::string all(20 + random() % 200, '\0');
  for (char& byte : all) byte = static_cast<char>(random());
  return all;
}

std::string scene(const std::string& choices) {
  return GeneratedScene(reinterpret_cast<const std::uint8_t*>(choices.data()), choices.size()).text();
}

/// The bits of q and p after each of ten steps; nothing where the scene is refused.
std::optional<std::string> motion(const std::string& text, const char* compiler, std::string& code) {
  setenv("DIRACSTEP_CC", compiler, 1);
  try {
    const CatalogueScene entry = scene_from_text("generated.toml", text);
    code = entry.code;
    static const Registry registry = Registry::with_built_ins();
    Integrator integrator(entry.scene, registry, kinsol(), {.method = "type1/midpoint", .step = 0.01});
    std::string bits;
    for (int k = 0; k < 10 && integrator.step().ok(); ++k)
      for (const Vector* column : {&integrator.position(), &integrator.momentum()})
        bits.append(reinterpret_cast<const char*>(column->data()),
                    static_cast<std::size_t>(column->size()) * sizeof(double));
    return bits;
  } catch (const Misuse&) {
    return std::nullopt;
  }
}

void step(int scenes, unsigned seed) {
  std::mt19937 random(seed);
  for (int k = 0; k < scenes; ++k) {
    const std::string choices = bytes(random);
    ASSERT_EQ(fuzz_scene_run(reinterpret_cast<const std::uint8_t*>(choices.data()), choices.size()), 0);
  }
  unsetenv("DIRACSTEP_CC");
}

/// Compiled kernels and interpreted ones give the same bits of every step.
void compare(int wanted, unsigned seed) {
  const TemporaryFolder cache;
  setenv("DIRACSTEP_CACHE", cache.path().c_str(), 1);
  std::mt19937 random(seed);
  int compared = 0, moved = 0;
  for (int k = 0; compared < wanted && k < 40 * wanted; ++k) {
    const std::string text = scene(bytes(random));
    std::string code;
    const auto interpreted = motion(text, "none", code);
    if (!interpreted) continue;
    const auto compiled = motion(text, "cc", code);
    ASSERT_TRUE(compiled.has_value()) << text;
    ASSERT_TRUE(code.starts_with("compiled")) << code << '\n' << text;
    ASSERT_EQ(*compiled, *interpreted) << text;
    ++compared;
    moved += interpreted->empty() ? 0 : 1;
  }
  unsetenv("DIRACSTEP_CC");
  unsetenv("DIRACSTEP_CACHE");
  std::printf("%d scenes compared, %d of them moved\n", compared, moved);
  EXPECT_EQ(compared, wanted);
  EXPECT_GT(moved, wanted / 2);
}

TEST(GeneratedScenes, OfTheCorpusAreSteppedOrRefused) {
  int inputs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DIRACSTEP_CORPUS "/../../scene_run/corpus")) {
    const std::string choices = contents(entry.path());
    EXPECT_EQ(fuzz_scene_run(reinterpret_cast<const std::uint8_t*>(choices.data()), choices.size()), 0);
    ++inputs;
  }
  unsetenv("DIRACSTEP_CC");
  EXPECT_GE(inputs, 10);
}
TEST(GeneratedScenes, AreSteppedOrRefused) { step(300, 1); }
TEST(GeneratedScenes, ManyAreSteppedOrRefused_slow) { step(20000, 2); }
TEST(GeneratedScenes, CompiledAndInterpretedMotionsHaveTheSameBits) { compare(8, 3); }
TEST(GeneratedScenes, ManyCompiledAndInterpretedMotionsHaveTheSameBits_slow) { compare(300, 4); }

}  // namespace
}  // namespace diracstep::testing
