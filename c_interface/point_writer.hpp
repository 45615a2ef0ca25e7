#pragma once

#include <diracstep/c_interface/handles.hpp>

namespace diracstep::c_interface {

/// Writes points into the caller's arrays, one row each.
class PointWriter {
 public:
  /// `rows`: of the scene; an integrator may know more, whose forces are left out.
  PointWriter(diracstep_points& points, int rows, const std::vector<Invariant>& invariants, bool by_momentum)
      : points_(points), rows_(rows), invariants_(invariants), by_momentum_(by_momentum) {
    points.count = 0;
  }

  /// Throws Failure where there is no room.
  void write(const Sample& point);
  /// Into row `row`, for which there is room.
  void write(const Sample& point, long row);

  bool has(double time) const { return points_.count > 0 && last_time_ == time; }

 private:
  diracstep_points& points_;
  Eigen::Index rows_;
  const std::vector<Invariant>& invariants_;
  bool by_momentum_;
  double last_time_ = 0.0;
};

/// Throws Misuse where numbers of the course are not allowed.
void require_sense(const diracstep_course& course);

}  // namespace diracstep::c_interface
