#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <diracstep/command/files/checkpoint_file.hpp>
#include <diracstep/files/output_file.hpp>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "misuse.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace diracstep {
namespace {

using testing::expect_misuse;

Checkpoint example() {
  Snapshot state;
  state.put("position", Vector{{0.1, -0.0, std::nan("")}});
  state.put("time", 1e-310);
  state.put("size", HUGE_VAL);
  return {{{"scene", "knife_edge"}, {"step", "0.1"}}, 12, 3456, state};
}

std::string contents(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return (std::ostringstream() << file.rdbuf()).str();
}

TEST(CheckpointFile, ReadsBackBitByBit) {
  const std::string bytes = encoded(example());
  const Checkpoint read = decoded(bytes, "c");
  EXPECT_EQ(read.run, example().run);
  EXPECT_EQ(read.points, 12);
  EXPECT_EQ(read.bytes, 3456);
  EXPECT_EQ(encoded(read), bytes);
}

TEST(CheckpointFile, EveryDamagedBitIsFound) {
  const std::string bytes = encoded(example());
  for (std::size_t i = 0; i < bytes.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = bytes;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << bit));
      expect_misuse([&] { (void)decoded(damaged, "c"); }, {"'c' is no checkpoint"});
    }
  for (std::size_t size = 0; size < bytes.size(); ++size)
    expect_misuse([&] { (void)decoded(std::string_view(bytes).substr(0, size), "c"); },
                  {"'c' is no checkpoint"});
}

TEST(CheckpointFile, OtherRunsAreRefusedWithBothValues) {
  require_same_run(example(), example().run, "c");
  expect_misuse(
      [] {
        require_same_run(example(), {{"scene", "knife_edge"}, {"step", "0.2"}}, "c");
      },
      {"'c'", "step is 0.1", "here it is 0.2"});
  expect_misuse(
      [] {
        require_same_run(example(), {{"scene", "knife_edge"}}, "c");
      },
      {"step is 0.1", "nothing"});
}

TEST(CheckpointFile, FactsThatCouldNotBeFoundOutDoNotTellRunsApart) {
  Checkpoint saved = example();
  saved.run.emplace_back("processor", "unknown");
  auto run = example().run;
  run.emplace_back("processor", "one of this machine");
  require_same_run(saved, run, "c");
}

TEST(CheckpointFuzz, CorpusAndDamagedCopiesAreReadOrRefused) {
  std::mt19937 random(1);
  int inputs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DIRACSTEP_CHECKPOINT_CORPUS)) {
    ++inputs;
    const std::string bytes = contents(entry.path());
    for (int k = 0; k < 200; ++k) {
      std::string damaged = bytes;
      for (int i = 0; i < k % 4 && !damaged.empty(); ++i)
        damaged[random() % damaged.size()] = static_cast<char>(random());
      LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(damaged.data()), damaged.size());
    }
  }
  EXPECT_GE(inputs, 9);
}

}  // namespace
}  // namespace diracstep
