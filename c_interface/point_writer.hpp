#pragma once

#include <diracstep/c_interface/handles.hpp>

namespace diracstep::c_interface {

/// The forces of the scene's rows; an integrator may know more, whose forces are left out.  Nothing where
/// `to` is null; so below.
void write_forces(const CatalogueScene& entry, const Sample& point, double* to);
/// The invariants and the outputs at a point.
void write_numbers(const CatalogueScene& entry, const Sample& point, double* invariants, double* outputs);

/// Writes points into the caller's arrays, one row each.
class PointWriter {
 public:
  /// The entry must outlive this.
  PointWriter(diracstep_points& points, const CatalogueScene& entry) : points_(points), entry_(entry) {
    points.count = 0;
  }

  /// Throws Failure where there is no room.
  void write(const Sample& point);
  /// Into row `row`, for which there is room.
  void write(const Sample& point, long row);

  bool has(double time) const { return points_.count > 0 && last_time_ == time; }

 private:
  diracstep_points& points_;
  const CatalogueScene& entry_;
  double last_time_ = 0.0;
};

/// Throws Misuse where numbers of the course are not allowed.
void require_sense(const diracstep_course& course);

}  // namespace diracstep::c_interface
