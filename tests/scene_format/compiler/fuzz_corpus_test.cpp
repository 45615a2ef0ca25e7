#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

/// The fuzzer's corpus, and damaged copies of the scenes: each is read or refused, nothing else.
namespace diracstep {
namespace {

std::vector<std::string> files(const char* directory) {
  std::vector<std::string> texts;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    std::ifstream file(entry.path(), std::ios::binary);
    texts.push_back((std::ostringstream() << file.rdbuf()).str());
  }
  return texts;
}

void feed(const std::string& text) {
  EXPECT_EQ(LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), 0);
}

TEST(FuzzCorpus, EveryInputIsReadOrRefused) {
  const auto inputs = files(DIRACSTEP_CORPUS);
  EXPECT_GT(inputs.size(), 10u);
  for (const auto& text : inputs) feed(text);
}

TEST(FuzzCorpus, DamagedScenesAreReadOrRefused) {
  std::mt19937 random(1);
  const std::string characters = "()[]{}=\"'.,+-*/^#\n0 19exv_\\\xc3";
  for (const auto& text : files(DIRACSTEP_SCENES)) {
    if (text.size() > 4000) continue;  // the largest take long to differentiate
    for (int k = 0; k < 20; ++k) {
      std::string damaged = text;
      for (int i = 0; i < 3; ++i)
        damaged[random() % damaged.size()] = characters[random() % characters.size()];
      if (k % 4 == 0) damaged.resize(random() % damaged.size());
      feed(damaged);
    }
  }
}

}  // namespace
}  // namespace diracstep
