#pragma once

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/sweeps/sweep.hpp>
#include <functional>
#include <string>
#include <vector>

namespace diracstep {

/// Who does which part of a sweep.
struct SweepOptions {
  std::string folder;
  long part = 1, parts = 1;  ///< this process takes the blocks part − 1, part − 1 + parts, …
  int threads = 0;           ///< 0: one for each processor
  /// In place of parts: the next number of a block, drawn by all processes from one counter.
  std::function<long()> next_block = {};
  std::function<bool()> goes_on = {};  ///< asked within members too; false ends it
  std::function<void(double done, const std::string& what)> progress =
      {};  ///< of this process's part, 0 to 1
};

/// A column of numbers over all members that have one.
struct SweepColumn {
  std::string name;
  long count = 0;
  double least = 0.0, mean = 0.0, most = 0.0;
};

/// What stands in the folder after a part was done.
struct SweepReport {
  std::string method;
  long members = 0, block = 0;
  long done = 0;      ///< members in finished blocks, of all parts
  long run_here = 0;  ///< members that this process ran
  bool complete = false;
  bool merged_here = false;              ///< the results were written by this process
  long ok = 0, doubted = 0, failed = 0;  ///< where it is complete
  std::vector<std::string> reasons;      ///< the first doubts and failures
  std::vector<SweepColumn> columns;
  std::vector<std::string> messages;  ///< blocks that were damaged
};

/// Runs the members of a sweep that no finished block in the folder holds, and where none is left writes
///
///   results.csv   a line for each member: member, what varies, status (ok, doubted or failed), t, what was
///                 recorded, reason; 17 digits
///   report.html   maps over two of the numbers that vary, and distributions
///   results.npy   the same without the reason, as a structured array of NumPy; NaN where there is no number
///
/// Beside them stand sweep.json, which says what the sweep is, and blocks/FIRST.csv, each written whole or
/// not at all once its members are done.  Any number of processes may share the folder: a block that another
/// one is at is left out.  The results are the same bytes for every number of threads, parts and
/// interruptions, on machines whose mathematical functions give the same bits.
///
/// Throws Misuse where the folder holds another sweep, naming what differs, or files that are none; Error
/// where it cannot be written.  What was finished stays.
SweepReport run_sweep(const Sweep& sweep, const std::function<CatalogueScene(const Parameters&)>& make_scene,
                      const Registry& registry, const SolverFactory& solvers, const SweepOptions& options);

}  // namespace diracstep
