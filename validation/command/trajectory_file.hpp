#pragma once

#include <cstdio>
#include <diracstep/core/integrator.hpp>
#include <memory>
#include <string>

namespace diracstep::command {

/// A trajectory as CSV: t, the coordinates, v_NAME, p_NAME, lambda_ROW, energy, with 17 significant digits.
class TrajectoryFile {
 public:
  /// Throws Misuse where the file cannot be opened.
  TrajectoryFile(const std::string& path, const Scene& scene);

  /// Both throw std::runtime_error where the system refuses to write.
  void write(const Sample& sample);
  void close();

  long lines() const { return lines_; }

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  void put(const std::string& line);
  [[noreturn]] void refuse() const;

  Eigen::Index rows_;  ///< of the scene; an integrator may know more, which are left out
  std::string path_;
  std::unique_ptr<std::FILE, Close> file_;
  long lines_ = 0;
};

}  // namespace diracstep::command
