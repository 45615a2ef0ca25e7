#include <cstdint>
#include <cstdlib>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/study_comparison.hpp>
#include <string>

/// libFuzzer's entry: any bytes as the study.json of --compare are compared with a study, or are refused with
/// a message.
namespace {

using namespace diracstep;

std::vector<Study> study() {
  Study one;
  one.scene = "knife_edge";
  StudyRow row;
  row.method = "type1/midpoint";
  row.order = 2;
  row.step = 0.1;
  row.status = "ok";
  row.error_q = row.error_p = 1e-3;
  one.rows = {row};
  AtError at;
  at.error = 1e-3;
  at.method = "type1/midpoint";
  at.order = 2;
  at.cpu_seconds = 1e-3;
  one.at_error = {at};
  return {one};
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<Study> now = study();
  try {
    const auto changes = compare_studies(now, std::string(reinterpret_cast<const char*>(data), size));
    if (comparison_table(changes).empty()) std::abort();
  } catch (const Misuse& refused) {
    if (*refused.what() == '\0') std::abort();
  }
  return 0;
}
