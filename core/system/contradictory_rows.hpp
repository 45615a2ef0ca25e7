#pragma once

#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

class RowsBesideOthers;

/// Whether rows whose one-forms depend on those of others demand something else than these.  With
/// A_d = C A_o, rows A v + b = 0 agree where  b_d = C b_o,  and holonomic ones where a pose of the others
/// meets them.  Looked at, for up to 100 rows, at the start and at poses around it that the others allow, at
/// its time and at times from 1e-6 to 1e6 from it in steps of half a decade; rows that part for a short
/// while between these are not seen.
///
/// Empty, or a line that names such a row and those that it contradicts.
std::string contradiction(const Scene& scene, const Start& start, const std::vector<std::string>& dependent);

/// The scene without rows that depend on its others, which are kept in Scene::whole.
std::shared_ptr<const Scene> with_rows_left_out(const std::shared_ptr<const Scene>& scene,
                                                const std::vector<std::string>& dependent);

/// Names of the rows of Scene::whole that the scene is without.
std::vector<std::string> rows_left_out(const Scene& scene);

/// The forces of all rows of Scene::whole at a point, of those of the rows of the scene, whose one-forms are
/// independent there: of all that act alike,
///
///   A_wᵀ Λ = Aᵀ λ,   the Λ that is least in the Euclidean norm of its numbers.
///
/// `lambda` may go on beyond the scene's own rows, with the forces of hidden ones, which do not count.  As
/// given where none were left out.
Vector forces_of_whole(const Scene& scene, double t, const Vector& q, const Vector& lambda);

/// The forces of the scene's own rows that act as those of all rows of Scene::whole do, Aᵀ λ = A_wᵀ Λ.  As
/// given where none were left out.
Vector forces_of_kept(const Scene& scene, double t, const Vector& q, const Vector& of_whole);

/// Holds a motion to the rows that were left out of its scene: what is redundant at the start may demand
/// something else later.  Rates of more than 100 rows are not looked at.
class LeftOutRows {
 public:
  /// For a scene with Scene::whole.
  explicit LeftOutRows(const Scene& scene);
  LeftOutRows(const LeftOutRows&) = delete;
  LeftOutRows& operator=(const LeftOutRows&) = delete;
  ~LeftOutRows();

  /// Empty, or a line that names a row which a point q of the other rows breaks, or which demands other
  /// rates than these there.
  std::string broken_at(double t, const Vector& q);
  /// The same of the rates alone, at a point of the other rows near q.
  std::string other_rates_near(double t, const Vector& q);
  /// Whether rates are looked at: not where no row depends on the time or has a rate of its own.
  bool has_rates() const { return has_rates_; }

 private:
  std::unique_ptr<RowsBesideOthers> rows_;
  bool has_rates_;
};

/// Names of the other rows whose combination the one-form of a row is nearest to at the start; `dependent` is
/// not among them.
std::vector<std::string> combined_rows(const Scene& scene, const Start& start, const std::string& row,
                                       const std::vector<std::string>& dependent);

}  // namespace diracstep
