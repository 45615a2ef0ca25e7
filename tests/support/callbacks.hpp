#pragma once

#include <diracstep/plugins/diracstep_scene.h>
#include <gtest/gtest.h>

#include <array>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <memory>
#include <utility>

namespace diracstep::testing {

/// The mixed law scene under a force, as callbacks of the C++ scene: values only.
class AsCallbacks {
 public:
  explicit AsCallbacks(std::shared_ptr<const Scene> scene) : scene_(std::move(scene)) {
    l_.data = scene_->lagrangian.get();
    l_.value = [](const void* data, double t, const double* x, const double* y, double* f) {
      const auto& function = *static_cast<const PhaseFunction*>(data);
      *f = function.value(t, in(x), in(y));
      return 0;
    };
    for (std::size_t b = 0; b < scene_->constraints.size(); ++b) {
      const ConstraintRows& rows = *scene_->constraints[b];
      blocks_[b].data = &rows;
      blocks_[b].rows = rows.rows();
      blocks_[b].holonomic = rows.holonomic() ? 1 : 0;
      blocks_[b].position = [](const void* data, double t, const double* q, double* phi) {
        static_cast<const ConstraintRows*>(data)->position(t, in(q), Eigen::Map<Vector>(phi, 1));
        return 0;
      };
      blocks_[b].coefficients = [](const void* data, double t, const double* q, double* a, double* b_) {
        static_cast<const ConstraintRows*>(data)->coefficients(t, in(q), Eigen::Map<Vector>(a, 3),
                                                               Eigen::Map<Vector>(b_, 1));
        return 0;
      };
      if (rows.holonomic()) blocks_[b].coefficients = nullptr;
      list_[b] = &blocks_[b];
    }
    f_.data = scene_->force.get();
    f_.value = [](const void* data, double t, const double* q, const double* v, double* f) {
      static_cast<const Force*>(data)->value(t, in(q), in(v), Eigen::Map<Vector>(f, 3));
      return 0;
    };
    c_.name = "callbacks";
    c_.dimension = 3;
    c_.lagrangian = &l_;
    c_.row_blocks = static_cast<int>(scene_->constraints.size());
    c_.rows = list_.data();
    c_.force = scene_->force ? &f_ : nullptr;
    c_.start_time = scene_->start.time;
    c_.start_q = scene_->start.q.data();
    c_.start_v = scene_->start.v.data();
    c_.step = 0.05;
    c_.end_time = 1.0;
  }
  AsCallbacks(const AsCallbacks&) = delete;
  AsCallbacks& operator=(const AsCallbacks&) = delete;

  diracstep_scene& scene() { return c_; }
  diracstep_function& lagrangian() { return l_; }
  diracstep_rows& rows(std::size_t block) { return blocks_[block]; }

 private:
  static Eigen::Map<const Vector> in(const double* x) { return {x, 3}; }

  std::shared_ptr<const Scene> scene_;
  diracstep_function l_{};
  std::array<diracstep_rows, 2> blocks_{};
  std::array<const diracstep_rows*, 2> list_{};
  diracstep_force f_{};
  diracstep_scene c_{};
};

inline Sample end_of(const std::shared_ptr<const Scene>& scene, const char* method) {
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = 0.05});
  const RunReport report = run_steps(integrator, 20, Momentum::projected, 20, nullptr);
  EXPECT_TRUE(report.ok()) << report.last.failure;
  Sample end;
  EXPECT_TRUE(integrator.sample(Momentum::projected, end).ok());
  return end;
}

}  // namespace diracstep::testing
