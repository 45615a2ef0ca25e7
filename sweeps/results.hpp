#pragma once

#include <diracstep/sweeps/block_files.hpp>
#include <diracstep/sweeps/member_run.hpp>
#include <diracstep/sweeps/sweep_folder.hpp>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

/// The line of a member in a block and in results.csv, without its end.
std::string result_line(const Sweep& sweep, long member, const MemberResult& result);

/// Gathers all blocks in results.csv and results.npy, a block at a time, and fills in what the report says of
/// them.  The number of a block that is not whole, and then the results are left as they were.
std::optional<long> gather_results(const Sweep& sweep, const BlockFiles& blocks, const std::string& folder,
                                   SweepReport& report);

}  // namespace diracstep
