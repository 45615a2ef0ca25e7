#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <functional>
#include <string>
#include <vector>

namespace diracstep::command {

/// The path that stands for standard output.
inline constexpr const char* standard_output = "-";

/// A trajectory as CSV: t, the coordinates, v_NAME, p_NAME, lambda_ROW, energy, and further columns,
/// with 17 significant digits.
/// Lines are gathered and written many at a time, always whole ones; only where the process is killed in the
/// middle of a write, or the power fails, may half a line stand at the end.
class TrajectoryFile {
 public:
  /// Where a file stood at some moment.
  struct Mark {
    long lines = 0;  ///< points
    long bytes = 0;
  };

  /// Begins a file.  Throws Misuse where it cannot be opened.
  TrajectoryFile(const std::string& path, const Scene& scene, std::vector<Output> further = {});
  /// Goes on with a file from a mark; what was written after it is dropped.  Throws Misuse where it cannot be
  /// opened, is shorter or has another header.
  TrajectoryFile(const std::string& path, const Scene& scene, Mark mark, std::vector<Output> further = {});
  TrajectoryFile(const TrajectoryFile&) = delete;
  TrajectoryFile& operator=(const TrajectoryFile&) = delete;
  /// Writes what is still gathered where an exception ends the run; close() tells whether that was possible.
  ~TrajectoryFile();

  /// What is written as forces of the rows, where the points of the run have those of some rows only.
  void show_forces(std::function<Vector(const Sample&)> forces) { forces_ = std::move(forces); }

  /// All throw Error where the system refuses to write.
  void write(const Sample& sample);
  void close();
  /// Puts all lines so far on the disk.
  Mark sync();

  long lines() const { return mark_.lines; }

 private:
  void write_shown(const Sample& sample);
  void put(const std::string& line);
  void flush();

  Eigen::Index rows_;  ///< of the scene; an integrator may know more, which are left out
  std::vector<Output> further_;
  std::function<Vector(const Sample&)> forces_;
  OutputFile file_;
  std::string waiting_;
  Mark mark_;
};

}  // namespace diracstep::command
