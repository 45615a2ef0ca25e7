#pragma once

#include <diracstep/files/output_file.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// The finished blocks of a sweep in its folder: blocks/FIRST.csv, a line that says whose they are and a line
/// for each member.
class BlockFiles {
 public:
  /// `identity`: of the sweep, a word.
  BlockFiles(std::string folder, std::string identity, long members, long block);

  long count() const { return (members_ + block_ - 1) / block_; }
  long first(long number) const { return number * block_; }
  long size(long number) const;  ///< members
  std::string path(long number) const;
  bool finished(long number) const;

  /// Throws Error where it cannot be written.
  void write(long number, const std::vector<std::string>& rows) const;
  /// The lines of the members; empty where the file is not whole, or of another sweep.
  std::vector<std::string> read(long number) const;

 private:
  std::string head(long number) const;

  std::string folder_, identity_;
  long members_, block_;
};

}  // namespace diracstep
