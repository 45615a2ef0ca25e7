#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <string>

extern "C" {
int fuzz_command(const std::uint8_t* data, std::size_t size);
int fuzz_plugin(const std::uint8_t* data, std::size_t size);
int fuzz_snapshot(const std::uint8_t* data, std::size_t size);
int fuzz_study(const std::uint8_t* data, std::size_t size);
int fuzz_trajectory(const std::uint8_t* data, std::size_t size);
}

/// The fuzzers' corpora and damaged copies of them: each input is taken or refused, and nothing else happens.
namespace diracstep {
namespace {

struct Fuzzer {
  const char* name;
  int (*feed)(const std::uint8_t* data, std::size_t size);
  int copies;  ///< damaged ones of each input
};

void PrintTo(const Fuzzer& fuzzer, std::ostream* out) { *out << fuzzer.name; }

class Corpus : public ::testing::TestWithParam<Fuzzer> {};

TEST_P(Corpus, AndDamagedCopiesAreTakenOrRefused) {
  const auto feed = [](const std::string& bytes) {
    EXPECT_EQ(GetParam().feed(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()), 0);
  };
  std::mt19937 random(1);
  int inputs = 0;
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  const auto corpus = std::filesystem::path(DIRACSTEP_FUZZ) / GetParam().name / "corpus";
  for (const auto& entry : std::filesystem::directory_iterator(corpus)) {
    ++inputs;
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string bytes = (std::ostringstream() << file.rdbuf()).str();
    feed(bytes);
    for (int k = 0; k < GetParam().copies && !bytes.empty(); ++k) {
      std::string damaged = bytes;
      for (int i = 0; i <= k % 3; ++i) damaged[random() % damaged.size()] = static_cast<char>(random());
      if (k % 5 == 4) damaged.resize(random() % damaged.size());
      feed(damaged);
    }
  }
  ::testing::internal::GetCapturedStdout();
  ::testing::internal::GetCapturedStderr();
  EXPECT_GE(inputs, 5);
}

INSTANTIATE_TEST_SUITE_P(All, Corpus,
                         ::testing::Values(Fuzzer{"command", fuzz_command, 5},
                                           Fuzzer{"plugin", fuzz_plugin, 20},
                                           Fuzzer{"snapshot", fuzz_snapshot, 20},
                                           Fuzzer{"study", fuzz_study, 100},
                                           Fuzzer{"trajectory", fuzz_trajectory, 50}),
                         [](const auto& that) { return std::string(that.param.name); });

}  // namespace
}  // namespace diracstep
