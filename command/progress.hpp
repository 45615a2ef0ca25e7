#pragma once

#include <chrono>
#include <string>

namespace diracstep {

/// One line on standard error that shows how far something is and how long it will take; nothing at all where
/// standard error is not a terminal.  The line is wiped when the object goes.
class Progress {
 public:
  /// `done_before` is the part that was done earlier and tells nothing of the time the rest will take.
  explicit Progress(double done_before = 0.0);
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress();

  /// `part` runs from 0 to 1.  Cheap to call often: the line changes a few times a second at most.
  void show(double part, const std::string& what);
  /// Wipes the line, so that something else can be written.
  void wipe();

 private:
  using Clock = std::chrono::steady_clock;

  bool terminal_;
  bool shown_ = false;
  double done_before_;
  Clock::time_point start_;
  Clock::time_point next_;
};

}  // namespace diracstep
